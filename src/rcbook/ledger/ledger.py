"""The claims of one paper and the judgements made so far; what a notebook fills and shows."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from rcbook.ledger import show
from rcbook.ledger.claim import REPRODUCED, Paper, tolerances
from rcbook.ledger.judge import Judgement, judge
from rcbook.ledger.load import load

MIME = "application/vnd.rcbook.ledger+json"  # the rows of a ledger, from which verdicts are taken
SHOWN = "application/vnd.rcbook.rows+json"  # rows that are only shown


@dataclass(frozen=True)
class Extract:
    """Some rows of a ledger, to look at folded; only a `Ledger` delivers verdicts."""

    rows: Sequence[Mapping]

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict:
        text = "\n".join(map(show.line, self.rows))
        return {"text/plain": text, "text/html": show.folded(self.rows), SHOWN: list(self.rows)}


@dataclass
class Ledger:
    """The claims of one paper and the judgements made so far, in the order of the paper.

    `notebook` is the one whose claims are judged, if it is not the paper's own.
    """

    paper: Paper
    judgements: dict[str, Judgement] = field(default_factory=dict)
    notebook: str = ""
    _fresh: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, key: str, notebook: str = "") -> Ledger:
        """An empty ledger for the paper `key`, in its own notebook or in a further one.

        Raises ValueError for a notebook that the paper does not have.
        """
        paper = load(key)
        names = [chapter.notebook for chapter in paper.chapters]
        if notebook and notebook not in names:
            raise ValueError(f"{key}.toml has no chapter {notebook!r}; it has {', '.join(names)}")
        return cls(paper, notebook=notebook)

    @property
    def _here(self) -> str:
        return self.notebook or self.paper.notebook

    def check(self, id: str, value: object = None, corrected: object = None, **evidence):
        """Judge claim `id` (see `judge`), keep the judgement and return it.

        Raises ValueError for an id the paper does not have, or that another notebook judges.
        """
        if id not in self.paper.claims:
            raise ValueError(
                f"{self.paper.key} has no claim {id!r}; see papers/{self.paper.key}.toml"
            )
        place = self.paper.place(self.paper.claims[id])
        if place != self._here:
            raise ValueError(f"{id} is judged in {place}; check it there")
        self.judgements[id] = judge(self.paper.claims[id], value, corrected, **evidence)
        self._fresh[:] = [*(fresh for fresh in self._fresh if fresh != id), id]
        return self.judgements[id]

    def value(self, id: str, name: str = "") -> object:
        """What was computed for the claim `id`, or the piece `name` of its evidence.

        Raises ValueError for a claim not judged yet, and for evidence it does not have.
        """
        if id not in self.judgements:
            raise ValueError(f"{id} is not judged yet; check it first")
        judgement = self.judgements[id]
        if not name:
            return judgement.computed
        if name not in judgement.evidence:
            known = ", ".join(judgement.evidence)
            raise ValueError(f"{id} has no evidence {name!r}; it has {known or 'none'}")
        return judgement.evidence[name]

    def missing(self) -> list[str]:
        """Ids of the claims of this notebook that are not checked yet."""
        claims = self.paper.claims.items()
        own = (id for id, claim in claims if self.paper.place(claim) == self._here)
        return [id for id in own if id not in self.judgements]

    def rows(self) -> list[dict]:
        """The judged claims as the list of objects that the ledger file holds."""
        judged = (self.judgements[id] for id in self.paper.claims if id in self.judgements)
        return [_row(self.paper, judgement) for judgement in judged]

    def latest(self) -> Extract:
        """The judgements made since the last call, as a short table to show under them."""
        rows = [_row(self.paper, self.judgements[id]) for id in self._fresh]
        self._fresh.clear()
        return Extract(rows)

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict:
        rows = self.rows()
        text = "\n".join(map(show.line, rows))
        return {"text/plain": text, "text/html": summary(rows), MIME: rows}


def summary(rows: Sequence[Mapping], page: str = "") -> str:
    """Counts of `rows` as HTML and, folded, a table of those that are not simply reproduced."""
    plain = (REPRODUCED, REPRODUCED)
    rest = [row for row in rows if (row["verdict"], row["expected_verdict"]) != plain]
    flips = any(row["verdict"] != row["expected_verdict"] for row in rows)
    found = f"<p>{show.counts(rows)}.</p>"
    if rest:
        found += show.details("All but the reproduced ones", show.table(rest, page=page), flips)
    return found


def _row(paper: Paper, judgement: Judgement) -> dict:
    claim = judgement.claim
    return {
        "id": claim.id,
        "paper": claim.paper,
        "where": claim.where,
        "says": claim.says,
        "printed": claim.printed,
        "unit": claim.unit,
        "computed": _finite(judgement.computed),
        "verdict": judgement.verdict,
        "expected_verdict": claim.expected,
        "tolerance": tolerances(claim),
        "tolerance_reason": claim.why_tolerance,
        "convention": paper.conventions[claim.convention]["text"],
        "reason": judgement.reason,
        "erratum": claim.erratum,
        "notebook": paper.place(claim),
        "kind": claim.kind,
        "reading": claim.convention,
        "evidence": _finite(dict(judgement.evidence)),
        "role": claim.role,
        "word": claim.word,
        "flips_under": paper.changes[claim.flips_under]["what"] if claim.flips_under else "",
        "margin": paper.margins.get(claim.id),
    }


def _finite(item: object) -> object:
    """`item` with infinities (a time never reached) as None, because JSON has no infinity."""
    if isinstance(item, dict):
        return {name: _finite(part) for name, part in item.items()}
    if isinstance(item, list):
        return [_finite(part) for part in item]
    return None if isinstance(item, float) and math.isinf(item) else item


def dumps(rows: Sequence[Mapping]) -> str:
    """Ledger rows as the text of the ledger file, at full precision, ending in a newline."""
    return json.dumps(list(rows), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
