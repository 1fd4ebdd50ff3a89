"""A claim: one printed number or statement, as data; what is printed is parsed once."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal, InvalidOperation

from rcbook.ledger.words import ROW_OF, WORDS

REPRODUCED = "reproduced"
CORRECTED = "reproduced with correction"
NOT_REPRODUCED = "not reproduced"
NOT_COMPUTABLE = "not computable"
VERDICTS = (REPRODUCED, CORRECTED, NOT_REPRODUCED, NOT_COMPUTABLE)
KINDS = ("number", "list", "bound", "statement", "measurement")
SCORED = ("headline", "result")
ROLES = (*SCORED, "input", "identity")

_NUMBER = r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"
_BOUNDS = {  # how a bound relates values to its printed numbers
    "one-sided": re.compile(rf"(?P<sign>[<>]=?)({_NUMBER})"),
    "symmetric": re.compile(rf"\+-({_NUMBER})"),
    "inside": re.compile(rf"({_NUMBER})\.\.({_NUMBER})"),
    "range": re.compile(rf"({_NUMBER})<=?\w+<=?({_NUMBER})"),
}
_MENDS = {
    "number": "write one number in digits, such as '0.8373'",
    "list": "write numbers with semicolons between, such as '1;-0.3731'",
    "bound": "write '<20', '>=1.5', '+-50', '0..1' or '0<k<2', without blanks",
}


@dataclass(frozen=True)
class Printed:
    """What a claim prints, parsed: its numbers as digits, and how values relate to them.

    `relation` is `equal`, a key of the bounds, a sign such as `<=`, or empty for words.
    """

    numbers: tuple[str, ...]
    relation: str


@dataclass(frozen=True)
class Claim:
    """One printed number or statement, with the verdict we expect of it and why.

    Raises ValueError when what is printed cannot be read as the kind says.
    """

    id: str
    paper: str
    where: str
    kind: str
    says: str
    printed: str
    unit: str
    expected: str
    role: str = "result"  # one of ROLES; every claim of a file states it
    flips_under: str = ""  # key of the paper's changes: the change that turns the verdict
    word: str = ""  # the unsharp word of the print that `words.toml` makes sharp
    tolerance: float | None = None  # in the claim's unit; None: by the word, or half a digit
    tolerance_reason: str = ""
    convention: str = "primary"  # key of the paper's conventions
    erratum: str = ""  # key of the paper's errata
    mended: str = ""  # `printed` after its erratum, where digits themselves are the misprint
    reason: str = ""  # format string over the evidence
    lost: str = ""  # what is lost that a computation would need, such as a figure
    notebook: str = ""  # where it is judged, if not in the paper's own notebook
    parsed: Printed = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "parsed", parse(self))

    @property
    def beyond_computation(self) -> bool:
        """Whether nothing can be computed for it: a measurement, or something is lost."""
        return self.kind == "measurement" or bool(self.lost)

    @property
    def corrected(self) -> Claim:
        """The claim with its misprinted digits mended, which a corrected value has to meet."""
        return replace(self, printed=self.mended, mended="") if self.mended else self

    @property
    def scored(self) -> bool:
        return self.role in SCORED

    @property
    def why_tolerance(self) -> str:
        """Why the tolerance is what it is, where it is not half a digit."""
        if self.word:
            return f"{self.word}: {WORDS[ROW_OF[self.word]].means}"
        return self.tolerance_reason


@dataclass(frozen=True)
class Chapter:
    """A notebook that judges claims of a paper."""

    notebook: str
    title: str
    idea: Mapping[str, str]  # its row in the table of the one idea: cite, loop, index, period


@dataclass(frozen=True)
class Paper:
    """Everything `papers/KEY.toml` says about one paper."""

    key: str
    title: str  # that of the chapter
    citation: str
    notebook: str
    chapter: int  # its place in the order of reading
    idea: Mapping[str, str]  # as in a `Chapter`
    conventions: Mapping[str, Mapping[str, str]]  # each a `title` and a `text`
    errata: Mapping[str, Mapping[str, str]]
    changes: Mapping[str, Mapping]  # of the model, which turn verdicts; see `falsify`
    claims: Mapping[str, Claim]
    margins: Mapping[str, Mapping] = field(default_factory=dict)  # as `falsify` measured them
    further: Sequence[Chapter] = ()  # whose claims name their notebook

    @property
    def chapters(self) -> tuple[Chapter, ...]:
        """All chapters about the paper, in the order of reading."""
        return Chapter(self.notebook, self.title, self.idea), *self.further

    def place(self, claim: Claim) -> str:
        """The notebook that judges a claim."""
        return claim.notebook or self.notebook


def parse(claim: Claim) -> Printed:
    """What `claim` prints.  Raises ValueError, with the mend, when its kind cannot be read."""
    printed = claim.printed if isinstance(claim.printed, str) else ""
    if claim.kind in ("number", "list"):
        numbers = tuple(printed.split(";"))
        alone = claim.kind == "list" or len(numbers) == 1
        if alone and all(re.fullmatch(_NUMBER, number, re.ASCII) for number in numbers):
            return Printed(numbers, "equal")
    elif claim.kind == "bound":
        for relation, pattern in _BOUNDS.items():
            if match := pattern.fullmatch(printed):
                named = match.groupdict()
                numbers = match.groups()[len(named) :]
                return Printed(numbers, named.get("sign", relation))
    elif isinstance(claim.printed, str):
        return Printed((), "")
    raise ValueError(
        f"{claim.id}: printed {claim.printed!r} cannot be read as a {claim.kind}; "
        f"{_MENDS.get(claim.kind, 'write it in quotes')}"
    )


def tolerance(claim: Claim, printed: str) -> float:
    """By how much a value may differ from `printed`, one of the claim's numbers."""
    if claim.tolerance is not None:
        return claim.tolerance
    row = WORDS[ROW_OF[claim.word]] if claim.word else None
    if row is None or row.number is None:
        return half_width(printed)
    if row.absolute is not None:
        return row.absolute
    return max(half_width(printed), row.value * abs(float(printed)))


def tolerances(claim: Claim) -> float | list[float] | None:
    """The tolerance or tolerances that judge `claim`; None where nothing is rounded."""
    if claim.parsed.relation not in ("equal", "range"):
        return None
    found = [tolerance(claim, printed) for printed in claim.parsed.numbers]
    return found[0] if claim.kind == "number" else found


def half_width(printed: str) -> float:
    """Half a unit of the last printed digit of a number, `'0.8373'` giving 0.00005."""
    return 0.5 * 10.0 ** _last_digit(printed)


def truncate(value: float, printed: str) -> float:
    """`value` cut, not rounded, to as many decimals as `printed` has."""
    unit = Decimal(1).scaleb(_last_digit(printed))
    if not math.isfinite(value):
        raise ValueError(f"{value!r} has no decimals to cut; give a finite number")
    return float(int(Decimal(repr(float(value))) / unit) * unit)


def _last_digit(printed: str) -> int:
    try:
        exponent = Decimal(printed).as_tuple().exponent
    except InvalidOperation:
        exponent = "n"
    if not isinstance(exponent, int):
        raise ValueError(f"{printed!r} is not a printed number; give its digits, such as '0.8373'")
    return exponent
