"""What a paper prints, what we compute for it, and the verdict that follows.

A *claim* is one printed number or statement.  Claims live as data in ``rcbook/papers/KEY.toml``;
a notebook opens the ledger of its paper, checks every claim against a value it has just computed,
and shows the ledger.  Verdicts are derived here from value, printed digits and tolerance; nobody
types them.
"""

from rcbook.ledger.claim import (
    CORRECTED,
    KINDS,
    NOT_COMPUTABLE,
    NOT_REPRODUCED,
    REPRODUCED,
    ROLES,
    SCORED,
    VERDICTS,
    Chapter,
    Claim,
    Paper,
    half_width,
    tolerances,
    truncate,
)
from rcbook.ledger.judge import Judgement, agrees, judge
from rcbook.ledger.ledger import MIME, SHOWN, Extract, Ledger, dumps, summary
from rcbook.ledger.load import load, papers, source
from rcbook.ledger.words import WORDS, Word, word

__all__ = [
    "CORRECTED",
    "KINDS",
    "MIME",
    "NOT_COMPUTABLE",
    "NOT_REPRODUCED",
    "REPRODUCED",
    "ROLES",
    "SCORED",
    "SHOWN",
    "VERDICTS",
    "WORDS",
    "Chapter",
    "Claim",
    "Extract",
    "Judgement",
    "Ledger",
    "Paper",
    "Word",
    "agrees",
    "dumps",
    "half_width",
    "judge",
    "load",
    "papers",
    "source",
    "summary",
    "tolerances",
    "truncate",
    "word",
]
