"""The verdict that follows from a claim and a computed value."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral, Real

from rcbook.ledger import show
from rcbook.ledger.claim import (
    CORRECTED,
    NOT_COMPUTABLE,
    NOT_REPRODUCED,
    REPRODUCED,
    Claim,
    tolerance,
)
from rcbook.ledger.load import quotes

_ROUNDING = 1e-12  # of a value that lies on the end of an interval
_SIGNS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


@dataclass(frozen=True)
class Judgement:
    """A claim beside its computed value and the verdict that follows from both."""

    claim: Claim
    computed: object
    verdict: str
    reason: str
    evidence: Mapping[str, object]

    @property
    def as_expected(self) -> bool:
        return self.verdict == self.claim.expected

    def __repr__(self) -> str:
        return show.line(
            {
                "id": self.claim.id,
                "printed": self.claim.printed,
                "computed": self.computed,
                "verdict": self.verdict,
                "expected_verdict": self.claim.expected,
            }
        )


def agrees(claim: Claim, value: object) -> bool:
    """Whether `value` agrees with what `claim` prints.

    A number agrees within its tolerance; a list, number by number; a statement when it is True;
    `<x`, `>x`, `<=x` and `>=x` when every value obeys; `+-x` and `a..b` when every value lies
    inside; and a range `a<name<b` when the two computed ends agree with the two printed ones.
    Raises ValueError when the value has not the shape the claim asks for.
    """
    if claim.kind == "statement":
        if not isinstance(value, bool):
            raise ValueError(f"{claim.id} is a statement: give True or False, not {value!r}")
        return value
    values = value if isinstance(value, list) else [value]
    if not values or any(isinstance(v, bool | list) for v in values):
        raise ValueError(f"{claim.id}: give a number or a row of numbers, not {value!r}")
    relation, numbers = claim.parsed.relation, [float(n) for n in claim.parsed.numbers]
    if relation in _SIGNS:
        return all(_SIGNS[relation](v, numbers[0]) for v in values)
    if relation == "symmetric":
        return all(abs(v) <= numbers[0] for v in values)
    if relation == "inside":
        return all(numbers[0] - _ROUNDING <= v <= numbers[1] + _ROUNDING for v in values)
    if len(numbers) != len(values):
        raise ValueError(
            f"{claim.id} prints {len(numbers)} number(s) and was given {len(values)}: {value!r}"
        )
    return all(
        abs(v - float(printed)) <= tolerance(claim, printed) * (1 + 1e-9)
        for v, printed in zip(values, claim.parsed.numbers, strict=True)
    )


def judge(claim: Claim, value: object = None, corrected: object = None, **evidence) -> Judgement:
    """Judge `claim` by the value its plain reading gives, else by the corrected reading.

    The verdict is *reproduced* when `value` agrees; *reproduced with correction* when it does not
    and `corrected`, computed under the claim's erratum or convention, does (or agrees with the
    `mended` digits, where the erratum is in the digits); *not reproduced* when neither does; *not
    computable* for a measurement, or where what it needs is lost.  `evidence`
    are the numbers and booleans that the claim's reason quotes; `value`, `corrected` and `printed`
    may be quoted as well.
    An infinite value says that what is printed does not exist; the evidence then stands for it.
    """
    if claim.beyond_computation and (value is not None or corrected is not None):
        raise ValueError(
            f"{claim.id} is a {claim.kind} that cannot be computed (a measurement, or lost): "
            "pass what it means as evidence"
        )
    if taken := evidence.keys() & {"holds", "holds_corrected", "plain", "printed"}:
        raise ValueError(f"{claim.id}: evidence may not be called {', '.join(sorted(taken))}")
    value, corrected = _plain(claim, value), _plain(claim, corrected)
    evidence = {name: _plain(claim, item) for name, item in evidence.items()}
    if deep := [name for name, item in evidence.items() if isinstance(item, list)]:
        raise ValueError(f"{claim.id}: evidence {deep} is a list; name its numbers one by one")
    if claim.beyond_computation:
        verdict, computed = NOT_COMPUTABLE, (evidence or None)
    elif value is None:
        raise ValueError(f"{claim.id}: a {claim.kind} needs a computed value")
    elif agrees(claim, value):
        verdict, computed = REPRODUCED, value
    elif corrected is not None and agrees(claim.corrected, corrected):
        verdict, computed = CORRECTED, corrected
        evidence = {"plain": value, **evidence} if claim.kind != "statement" else evidence
    else:
        verdict, computed = NOT_REPRODUCED, (evidence if value in (math.inf, -math.inf) else value)
    if claim.kind == "statement" and value is not None:
        mended = {} if corrected is None else {"holds_corrected": corrected}
        computed = {"holds": value, **mended, **evidence}
    known = {**evidence, "value": value, "printed": claim.printed}
    known |= {} if corrected is None else {"corrected": corrected}
    return Judgement(claim, computed, verdict, _reason(claim, known), evidence)


def _reason(claim: Claim, known: Mapping[str, object]) -> str:
    """The claim's reason, with what is known in the place of its braces."""
    if absent := quotes(claim.reason) - known.keys():
        raise ValueError(f"{claim.id}: its reason quotes {sorted(absent)}; pass them as evidence")
    try:
        return claim.reason.format(**known)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{claim.id}: its reason cannot be filled in: {error}") from None


def _plain(claim: Claim, item: object) -> object:
    """`item` as Python numbers, because NumPy's are not JSON."""
    if item is None or isinstance(item, bool):
        return item
    if hasattr(item, "tolist"):
        item = item.tolist()
    if isinstance(item, bool):
        return item
    if isinstance(item, Integral):
        return int(item)
    if isinstance(item, Real):
        if math.isnan(item):
            raise ValueError(f"{claim.id}: NaN is no result; give a number, or inf for 'never'")
        return float(item)
    if isinstance(item, Sequence) and not isinstance(item, str):
        return [_plain(claim, part) for part in item]
    raise ValueError(f"{claim.id}: {item!r} is neither a real number nor a list of them")
