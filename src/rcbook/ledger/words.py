"""What the papers' unsharp words mean: one table, the same in all of them."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources

from rcbook.ledger.marks import without_marks


@dataclass(frozen=True)
class Word:
    """A row of the table: words, what they mean, and their number if they have one."""

    words: Sequence[str]
    means: str
    value: float | None = None  # a fraction or a factor of what is printed
    absolute: float | None = None  # a size in the unit of the claim

    @property
    def number(self) -> float | None:
        """The one number of the row; None for a row that is a rule."""
        return self.absolute if self.value is None else self.value


def source() -> dict[str, dict]:
    """The table as its file has it, by the key of each row."""
    file = resources.files("rcbook.ledger").joinpath("words.toml")
    return tomllib.loads(file.read_text(encoding="utf-8"))


WORDS = {key: Word(**row | {"means": without_marks(row["means"])}) for key, row in source().items()}
ROW_OF = {name: key for key, row in WORDS.items() for name in row.words}


def word(name: str) -> float:
    """The fraction, factor or size that `name`, such as `'slight'`, means in every paper.

    Raises ValueError for a word that the table does not have or that names a rule.
    """
    number = WORDS[ROW_OF[name]].number if name in ROW_OF else None
    if number is None:
        known = ", ".join(n for n, key in ROW_OF.items() if WORDS[key].number is not None)
        raise ValueError(f"no number is declared for the word {name!r}; choose one of {known}")
    return number
