"""A checkout of the project: where its notebooks, its book and its ledger are."""

from __future__ import annotations

import os
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
    def stale_mark(self) -> Path:
        """There when a later run than that of the ledger failed."""
        return self.build / "ledger.stale"

    @property
    def html(self) -> Path:
        return self.build / "html"


def find(start: Path) -> Project:
    """The checkout at or above `start`, judged by all papers of the package.

    Raises ValueError when there is none.
    """
    root = root_of(start)
    return Project(root, tuple(ledger.load(key) for key in ledger.papers()))


def root_of(start: Path) -> Path:
    """The folder of the checkout at or above `start`.  Raises ValueError when there is none."""
    for folder in (start, *start.parents):
        if (folder / "book" / "_config.yml").is_file() and (folder / "notebooks").is_dir():
            return folder
    raise ValueError(f"no checkout of rcbook at or above {start}; run this inside a clone")


def read_text(path: Path) -> str:
    """The text in `path`.  Raises ValueError, naming the file, when it is no UTF-8."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path} is no UTF-8 text ({error}); save it as UTF-8") from None


def write(path: Path, text: str) -> None:
    """Put `text` into `path` whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}-{os.getpid()}")
    try:
        beside.write_text(text, encoding="utf-8", newline="\n")
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)
