"""What a paper prints, what we compute for it, and the verdict that follows.

A *claim* is one printed number or statement.  Claims live as data in ``rcbook/papers/KEY.toml``;
a notebook opens the ledger of its paper, checks every claim against a value it has just computed,
and shows the ledger.  Verdicts are derived here from value, printed digits and tolerance; nobody
types them.
"""

from __future__ import annotations

import html
import json
import math
import operator
import re
import string
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from decimal import Decimal, InvalidOperation
from importlib import resources
from numbers import Integral, Real

from rcbook import prose

MIME = "application/vnd.rcbook.ledger+json"

REPRODUCED = "reproduced"
CORRECTED = "reproduced with correction"
NOT_REPRODUCED = "not reproduced"
NOT_COMPUTABLE = "not computable"
VERDICTS = (REPRODUCED, CORRECTED, NOT_REPRODUCED, NOT_COMPUTABLE)
KINDS = ("number", "list", "bound", "statement", "measurement")
SCORED = ("headline", "result")
ROLES = (*SCORED, "input", "identity")

_ROUNDING = 1e-12  # of a value that lies on the end of an interval
_LONG = 8  # a longer list is shown by its ends

_NUMBER = r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"
_ONE_SIDED = re.compile(rf"([<>]=?)({_NUMBER})")
_SYMMETRIC = re.compile(rf"\+-({_NUMBER})")
_INSIDE = re.compile(rf"({_NUMBER})\.\.({_NUMBER})")
_RANGE = re.compile(rf"({_NUMBER})<=?\w+<=?({_NUMBER})")


@dataclass(frozen=True)
class Claim:
    """One printed number or statement, with the verdict we expect of it and why."""

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
    reason: str = ""  # format string over the evidence
    lost: str = ""  # what is lost that a computation would need, such as a figure


@dataclass(frozen=True)
class Paper:
    """Everything `papers/KEY.toml` says about one paper."""

    key: str
    title: str  # that of the chapter
    citation: str
    notebook: str
    chapter: int  # its place in the order of reading
    idea: Mapping[str, str]  # its row in the table of the one idea: cite, loop, index, period
    conventions: Mapping[str, Mapping[str, str]]  # each a `title` and a `text`
    errata: Mapping[str, Mapping[str, str]]
    changes: Mapping[str, Mapping]  # of the model, which turn verdicts; see `falsify`
    claims: Mapping[str, Claim]
    margins: Mapping[str, Mapping] = field(default_factory=dict)  # as `falsify` measured them


@dataclass(frozen=True)
class Word:
    """What an unsharp word means: a `relative` size or factor, an `absolute` one, or a rule."""

    words: Sequence[str]
    means: str
    value: float | None = None
    absolute: float | None = None


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
        flip = "" if self.as_expected else f"  (EXPECTED: {self.claim.expected})"
        printed = self.claim.printed or "-"
        return f"{self.claim.id}: printed {printed}, ours {show(self)}: {self.verdict}{flip}"


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


def _read(item):
    """`item` with the marks of its numbers taken out of every text."""
    if isinstance(item, str):
        return prose.without_marks(item)
    if isinstance(item, dict):
        return {name: _read(part) for name, part in item.items()}
    return item


def words_source() -> dict:
    """The table of unsharp words as its file has it."""
    text = resources.files("rcbook").joinpath("words.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


WORDS = {key: Word(**_read(row)) for key, row in words_source().items()}
_ROWS = {name: row for row in WORDS.values() for name in row.words}


def word(name: str) -> float:
    """The fraction or factor that `name`, such as `'slight'`, means in every paper.

    Raises ValueError for a word that the table does not have or that names a rule.
    """
    row = _ROWS.get(name)
    value = None if row is None else row.absolute if row.value is None else row.value
    if value is None:
        known = ", ".join(n for n, r in _ROWS.items() if (r.value or r.absolute) is not None)
        raise ValueError(f"no number is declared for the word {name!r}; choose one of {known}")
    return value


def papers() -> tuple[str, ...]:
    """Keys of all papers in the package, in the order of their chapters."""
    files = resources.files("rcbook").joinpath("papers").iterdir()
    found = {f.name.removesuffix(".toml"): f for f in files if f.name.endswith(".toml")}
    chapters = {key: tomllib.loads(f.read_text(encoding="utf-8")) for key, f in found.items()}
    return tuple(sorted(found, key=lambda key: (chapters[key].get("chapter", 0), key)))


def load(key: str) -> Paper:
    """Read and validate `papers/KEY.toml`.

    Raises ValueError for an unknown key, a claim given twice, an unknown kind or verdict, a
    reference to a convention or erratum that is not there, and a claim expected to fail whose
    reason quotes nothing computed.
    """
    data = source(key)
    parts = [f.name for f in fields(Paper) if f.name not in ("key", "margins")]
    if absent := [part for part in parts if part not in data]:
        raise ValueError(f"{key}.toml lacks {', '.join(absent)}; add them")
    claims: dict[str, Claim] = {}
    for entry in data["claims"]:
        claim = _claim(key, entry)
        if claim.id in claims:
            raise ValueError(f"{claim.id} stands twice in {key}.toml; remove one")
        _validate(claim, data)
        claims[claim.id] = claim
    margins = resources.files("rcbook").joinpath("papers", f"{key}.margins.json")
    measured = json.loads(margins.read_text(encoding="utf-8")) if margins.is_file() else {}
    given = _read({part: data[part] for part in parts}) | {"claims": claims}
    return Paper(key, **given, margins=measured.get("claims", {}))


def source(key: str) -> dict:
    """What `papers/KEY.toml` holds, marks and all.  Raises ValueError for an unknown key."""
    file = resources.files("rcbook").joinpath("papers", f"{key}.toml")
    if not file.is_file():
        raise ValueError(f"no paper {key!r}; choose one of {', '.join(papers())}")
    return tomllib.loads(file.read_text(encoding="utf-8"))


def _claim(paper: str, entry: Mapping) -> Claim:
    known = {f.name: f.default is MISSING for f in fields(Claim) if f.name != "paper"}
    known["role"] = True
    name = entry.get("id", f"a claim of {paper} without id")
    if unknown := entry.keys() - known:
        raise ValueError(f"{name}: unknown field {', '.join(sorted(unknown))}; remove it")
    if absent := [field for field, needed in known.items() if needed and field not in entry]:
        raise ValueError(f"{name}: lacks {', '.join(absent)}; add it")
    return Claim(paper=paper, **_read(entry))


def _validate(claim: Claim, data: Mapping) -> None:
    conventions, errata, changes = data["conventions"], data["errata"], data["changes"]
    problem = ""
    if not claim.id.startswith(f"{claim.paper}."):
        problem = "its id does not begin with the paper's key"
    elif claim.kind not in KINDS:
        problem = f"kind {claim.kind!r} is none of {', '.join(KINDS)}"
    elif claim.expected not in VERDICTS:
        problem = f"expected {claim.expected!r} is none of {', '.join(VERDICTS)}"
    elif claim.role not in ROLES:
        problem = f"role {claim.role!r} is none of {', '.join(ROLES)}"
    elif claim.flips_under and claim.flips_under not in changes:
        problem = f"flips_under {claim.flips_under!r} is not in [changes]"
    elif claim.flips_under and claim.role not in SCORED:
        problem = f"an {claim.role} has no verdict to flip; remove flips_under"
    elif claim.word and claim.word not in _ROWS:
        problem = f"word {claim.word!r} is not in words.toml"
    elif claim.word and claim.tolerance is not None:
        problem = "it has a word and a tolerance of its own; remove one"
    elif claim.convention not in conventions:
        problem = f"convention {claim.convention!r} is not in [conventions]"
    elif claim.erratum and claim.erratum not in errata:
        problem = f"erratum {claim.erratum!r} is not in [errata]"
    elif (claim.tolerance is not None) != bool(claim.tolerance_reason):
        problem = "a tolerance of its own needs a tolerance_reason, and the other way round"
    elif claim.tolerance is not None and not 0 <= claim.tolerance < math.inf:
        problem = f"tolerance {claim.tolerance!r} is not a finite number of 0 or more"
    elif not isinstance(claim.printed, str) or not _readable(claim):
        problem = f"printed {claim.printed!r} cannot be read as a {claim.kind} (digits in quotes)"
    elif claim.tolerance is not None and tolerances(claim) is None:
        problem = f"a tolerance means nothing for {claim.printed!r}"
    elif _beyond_computation(claim) != (claim.expected == NOT_COMPUTABLE):
        problem = "a measurement, or what says what is `lost`, is not computable, and nothing else"
    elif claim.expected in (NOT_REPRODUCED, NOT_COMPUTABLE) and not claim.reason:
        problem = "it is expected to fail and gives no reason"
    elif claim.expected == NOT_REPRODUCED and not _fields(claim.reason) - {"printed"}:
        problem = "its reason quotes nothing computed; put evidence in {braces}"
    elif claim.expected == CORRECTED and not claim.erratum and claim.convention == "primary":
        problem = "a correction names its erratum or its convention"
    if problem:
        raise ValueError(f"{claim.id}: {problem}")


def _beyond_computation(claim: Claim) -> bool:
    return claim.kind == "measurement" or bool(claim.lost)


def _readable(claim: Claim) -> bool:
    if claim.kind in ("number", "list"):
        parts = claim.printed.split(";")
        alone = claim.kind == "list" or len(parts) == 1
        return alone and all(re.fullmatch(_NUMBER, part) for part in parts)
    return claim.kind != "bound" or any(
        pattern.fullmatch(claim.printed) for pattern in (_ONE_SIDED, _SYMMETRIC, _INSIDE, _RANGE)
    )


def _fields(template: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(template) if name}


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
    if claim.kind == "bound":
        if match := _ONE_SIDED.fullmatch(claim.printed):
            obeys = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
            return all(obeys[match[1]](v, float(match[2])) for v in values)
        if match := _INSIDE.fullmatch(claim.printed):
            low, high = (float(end) for end in match.groups())
            return all(low - _ROUNDING <= v <= high + _ROUNDING for v in values)
        if match := _SYMMETRIC.fullmatch(claim.printed):
            return all(abs(v) <= float(match[1]) for v in values)
        match = _RANGE.fullmatch(claim.printed)
        if match is None:
            raise ValueError(f"{claim.id}: cannot read {claim.printed!r} as a bound")
        printed = list(match.groups())
    else:
        printed = claim.printed.split(";")
    if len(printed) != len(values):
        raise ValueError(
            f"{claim.id} prints {len(printed)} number(s) and was given {len(values)}: {value!r}"
        )
    return all(
        abs(v - float(p)) <= _tolerance(claim, p) * (1 + 1e-9)
        for v, p in zip(values, printed, strict=True)
    )


def _tolerance(claim: Claim, printed: str) -> float:
    if claim.tolerance is not None:
        return claim.tolerance
    row = _ROWS.get(claim.word)
    if row is None or (row.value is None and row.absolute is None):
        return half_width(printed)
    if row.absolute is not None:
        return row.absolute
    return max(half_width(printed), row.value * abs(float(printed)))


def tolerances(claim: Claim) -> float | list[float] | None:
    """The tolerance or tolerances that judge `claim`; None where nothing is rounded."""
    if claim.kind == "number":
        return _tolerance(claim, claim.printed)
    if claim.kind == "list":
        return [_tolerance(claim, p) for p in claim.printed.split(";")]
    if claim.kind == "bound" and (match := _RANGE.fullmatch(claim.printed)):
        return [_tolerance(claim, p) for p in match.groups()]
    return None


def judge(claim: Claim, value: object = None, corrected: object = None, **evidence) -> Judgement:
    """Judge `claim` by the value its plain reading gives, else by the corrected reading.

    The verdict is *reproduced* when `value` agrees; *reproduced with correction* when it does not
    and `corrected`, computed under the claim's erratum or convention, does; *not reproduced* when
    neither does; *not computable* for a measurement, or where what it needs is lost.  `evidence`
    are the numbers and booleans that the claim's reason quotes; `value`, `corrected` and `printed`
    may be quoted as well.
    An infinite value says that what is printed does not exist; the evidence then stands for it.
    """
    if _beyond_computation(claim) and (value is not None or corrected is not None):
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
    if _beyond_computation(claim):
        verdict, computed = NOT_COMPUTABLE, (evidence or None)
    elif value is None:
        raise ValueError(f"{claim.id}: a {claim.kind} needs a computed value")
    elif agrees(claim, value):
        verdict, computed = REPRODUCED, value
    elif corrected is not None and agrees(claim, corrected):
        verdict, computed = CORRECTED, corrected
        evidence = {"plain": value, **evidence} if claim.kind != "statement" else evidence
    else:
        verdict, computed = NOT_REPRODUCED, (evidence if value in (math.inf, -math.inf) else value)
    if claim.kind == "statement" and value is not None:
        mended = {} if corrected is None else {"holds_corrected": corrected}
        computed = {"holds": value, **mended, **evidence}
    known = {**evidence, "value": value, "printed": claim.printed}
    known |= {} if corrected is None else {"corrected": corrected}
    if absent := _fields(claim.reason) - known.keys():
        raise ValueError(f"{claim.id}: its reason quotes {sorted(absent)}; pass them as evidence")
    return Judgement(claim, computed, verdict, claim.reason.format(**known), evidence)


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


@dataclass(frozen=True)
class Extract:
    """Some rows of a ledger without reasons, to look at; only a `Ledger` delivers verdicts."""

    rows: Sequence[Mapping]

    def _repr_html_(self) -> str:
        return table(self.rows, reasons=False)


@dataclass
class Ledger:
    """The claims of one paper and the judgements made so far, in the order of the paper."""

    paper: Paper
    judgements: dict[str, Judgement] = field(default_factory=dict)
    _fresh: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, key: str) -> Ledger:
        """An empty ledger for the paper `key`."""
        return cls(load(key))

    def check(self, id: str, value: object = None, corrected: object = None, **evidence):
        """Judge claim `id` (see `judge`), keep the judgement and return it.

        Raises ValueError for an id the paper does not have.
        """
        if id not in self.paper.claims:
            raise ValueError(f"{self.paper.key} has no claim {id!r}; see papers/*.toml")
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
        """Ids of the claims not checked yet."""
        return [id for id in self.paper.claims if id not in self.judgements]

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
        text = "\n".join(repr(self.judgements[id]) for id in self.judgements)
        return {"text/plain": text, "text/html": self._html(), MIME: self.rows()}

    def _html(self) -> str:
        """Counts, and a table of the claims that are not simply reproduced."""
        rows = self.rows()
        tally = Counter(row["verdict"] for row in rows)
        counts = "; ".join(f"{tally[verdict]} {verdict}" for verdict in VERDICTS)
        rest = [
            r for r in rows if (r["verdict"], r["expected_verdict"]) != (REPRODUCED, REPRODUCED)
        ]
        return f"<p>{len(rows)} claims: {counts}. All but the reproduced ones:</p>{table(rest)}"


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
        "tolerance_reason": _tolerance_reason(claim),
        "convention": paper.conventions[claim.convention]["text"],
        "reason": judgement.reason,
        "erratum": claim.erratum,
        "notebook": paper.notebook,
        "kind": claim.kind,
        "reading": claim.convention,
        "evidence": _finite(dict(judgement.evidence)),
        "role": claim.role,
        "word": claim.word,
        "flips_under": paper.changes[claim.flips_under]["what"] if claim.flips_under else "",
        "margin": paper.margins.get(claim.id),
    }


def _tolerance_reason(claim: Claim) -> str:
    """Why the tolerance is what it is, where it is not half a digit."""
    return f"{claim.word}: {_ROWS[claim.word].means}" if claim.word else claim.tolerance_reason


def _finite(item: object) -> object:
    """`item` with infinities (a time never reached) as None, because JSON has no infinity."""
    if isinstance(item, dict):
        return {name: _finite(part) for name, part in item.items()}
    if isinstance(item, list):
        return [_finite(part) for part in item]
    return None if isinstance(item, float) and math.isinf(item) else item


def show(judgement: Judgement) -> str:
    """The computed value of a judgement, rounded for reading."""
    return show_value(_finite(judgement.computed))


def show_printed(row: Mapping) -> str:
    """What the paper prints for a ledger row, with its unit where it is a number."""
    bare = row["kind"] == "statement" or row["unit"] in ("", "1")
    return row["printed"] if bare else f"{row['printed']} {row['unit']}"


def show_value(computed: object) -> str:
    """A computed value of the ledger file, rounded for reading."""
    if computed is None:
        return "-"
    if isinstance(computed, bool):
        return "holds" if computed else "does not hold"
    if isinstance(computed, dict):
        if "holds" in computed:
            mended = "; corrected, it holds" if computed.get("holds_corrected") else ""
            return show_value(computed["holds"]) + mended
        return "see reason"
    if isinstance(computed, list) and len(computed) > _LONG:
        return f"{min(computed):.6g} to {max(computed):.6g} ({len(computed)} values)"
    if isinstance(computed, list):
        return "; ".join(show_value(part) for part in computed)
    return f"{computed:.6g}"


def table(rows: Sequence[Mapping], reasons: bool = True) -> str:
    """An HTML table of ledger rows: claim, printed, ours, verdict and, if wanted, the reason."""
    heads = ["Claim", "Printed", "Ours", "Verdict"] + ["Reason"] * reasons
    head = "".join(f"<th>{h}</th>" for h in heads)
    body = "".join(_table_row(row, reasons) for row in rows)
    return (
        f'<table class="rcbook-ledger"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
    )


def _table_row(row: Mapping, reasons: bool) -> str:
    e = html.escape
    verdict = e(row["verdict"])
    if row["verdict"] != row["expected_verdict"]:
        verdict += f" <b>(expected: {e(row['expected_verdict'])})</b>"
    where = f"{e(row['where'])} · <code>{e(row['id'])}</code>"
    return (
        f'<tr data-verdict="{e(row["verdict"])}" data-paper="{e(row["paper"])}">'
        f"<td>{e(row['says'])}<br><small>{where}</small></td>"
        f"<td>{e(show_printed(row))}</td><td>{e(show_value(row['computed']))}</td>"
        f"<td>{verdict}</td>" + (f"<td>{e(row['reason'])}</td>" * reasons) + "</tr>"
    )


def dumps(rows: Sequence[Mapping]) -> str:
    """Ledger rows as the text of the ledger file, at full precision, ending in a newline."""
    return json.dumps(list(rows), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
