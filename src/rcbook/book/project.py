"""A checkout of the project: where its notebooks, its book and its ledger are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rcbook import ledger


@dataclass(frozen=True)
class Project:
    """A checkout: where its notebooks and its book are, and the papers it is judged by."""

    root: Path
    papers: tuple[ledger.Paper, ...]

    @property
    def notebooks(self) -> Path:
        return self.root / "notebooks"

    @property
    def book(self) -> Path:
        return self.root / "book"

    @property
    def build(self) -> Path:
        return self.book / "_build"

    @property
    def ledger_file(self) -> Path:
        return self.build / "ledger.json"

    @property
    def html(self) -> Path:
        return self.build / "html"


def find(start: Path) -> Project:
    """The checkout at or above `start`, judged by all papers of the package.

    Raises ValueError when there is none.
    """
    for folder in (start, *start.parents):
        if (folder / "book" / "_config.yml").is_file() and (folder / "notebooks").is_dir():
            return Project(folder, tuple(ledger.load(key) for key in ledger.papers()))
    raise ValueError(f"no checkout of rcbook at or above {start}; run this inside a clone")
