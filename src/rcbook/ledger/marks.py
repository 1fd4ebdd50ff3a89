"""Numbers in the text of the book: each is computed, quotes a paper, or is part of its structure.

A number in prose is followed by an HTML comment, which no reader sees, that accounts for it:

    88.4<!-- {peak:.1f} -->            computed: the run evaluates the braces and compares
    0.0123<!-- claim: KEY.place.what -->  quoted: compared with what that claim prints
    600 rpm<!-- paper: ch. II -->      quoted: where the paper has it
    20 seeds<!-- chosen: enough -->    set by us, as in an exercise

Braces check as many numbers before the comment as there are braces.  The other marks account for
all numbers back to the mark before, or to the start of the paragraph.  Numbers of equations,
figures and their like, years, code, and exponents and indices of formulas need no mark.
"""

from __future__ import annotations

import ast
import re
import string
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

COMPUTED, QUOTED, STRUCTURAL, CHOSEN, UNACCOUNTED = CLASSES = (
    "computed",
    "quotes a paper",
    "structural",
    "chosen",
    "unaccounted",
)

_COMMENT = re.compile(r"<!--\s*(.*?)\s*-->", re.DOTALL)
_DIGITS = r"\d{1,3}(?:,\d{3})+(?![\d,])|\d+(?:\.\d+)?|(?<![\w.)}\]])\.\d+"
_TIMES = r"\s*(?:\\times|\\cdot|×|·)\s*10\s*\^\s*"
_POWER = rf"{_TIMES}(?:\{{\s*[-−+]?\d+\s*\}}|\d)"
_SIGN = r"(?:(?<![\w.)}\]])[-−+])?"
_WORDS = (
    "thirteen|fourteen|fifteen|sixteen|seventeen|eighteen|nineteen|(?:twen|thir|for|fif|six|seven|"
    r"eigh|nine)ty(?:-\w+)?|hundred(?:ths?|s)?|thousand(?:ths?|s)?|millions?|billions?|dozens?"
)
_NUMBER = re.compile(
    rf"(?<![A-Za-z\d.]){_SIGN}(?:{_DIGITS})(?:{_POWER}|[eE][-+]?\d+)?|\b(?:{_WORDS})\b",
    re.IGNORECASE,
)
_PLACES = (
    r"\b(?:eqs?|equations?|figs?|figures?|tables?|cases?|chs?|chapters?|sections?|secs?|"
    r"passes|pass|appendix|exercises?|pages?|pp?|versions?|vol)\.?"
)
_UNITS = r"(?!\s*(?:lb|mm|Hz|rpm|percent|%|µm|ms)(?!\w))"
_ITEM = rf"\(?[A-Z]?\d+[a-z]?\)?(?![.\d]*\d){_UNITS}"
_PLACE = re.compile(
    rf"{_PLACES}\s*\$?{_ITEM}(?:(?:\s*,\s*(?:and\s+)?|\s+(?:and|to|or|with)\s+|[-–]){_ITEM})*",
    re.IGNORECASE,
)
_MONTHS = "January|February|March|April|May|June|July|August|September|October|November|December"
_YEAR = re.compile(
    rf"(?:\((?:[^()]*,\s)?|\b(?:in|since|after|before|{_MONTHS})\s)(?:19[4-9]\d|20[0-3]\d)[a-z]?\b"
    r"(?!\.?\d|\s*[A-Za-z%])"
)
_MATH = re.compile(r"\$\$.+?\$\$|\$[^$]+\$", re.DOTALL)
_SCRIPT = re.compile(r"[_^](?:\{[^{}]*(?:\{[^{}]*\}[^{}]*)*\}|[-−+]?\w)")
_SMALL = re.compile(r"[-−+]?[012]")
_COMMAND = re.compile(r"\\(?!times|cdot)[A-Za-z]+")  # of TeX; a number may follow it at once
_ATTRIBUTES = r"(?:\s+[\w-]+=(?:\"[^\"]*\"|'[^']*'))*\s*/?"
_HIDDEN = re.compile(  # what is no text: code, targets of links, labels, tags, numbers of lists
    r"```(?!\{).*?```|(?<![`}])`[^`\n]+`(?!`)|(?<=\{cite\})`[^`\n]+`|\]\([^)\s]*|^\([\w-]+\)=$|"
    rf"</?[a-zA-Z][\w-]*{_ATTRIBUTES}>|^\s*\d+\.(?=\s)|^#+\s+\d+\.(?=\s)|"
    r"^:(?!alt\b)[\w-]+:[^\n]*$|https?://\S+",
    re.DOTALL | re.MULTILINE,
)
_BLANK_LINE = re.compile(r"\n[ \t]*\n")


@dataclass(frozen=True)
class Number:
    """One number of a text: where it stands, and what accounts for it."""

    text: str
    start: int
    kind: str  # one of CLASSES
    script: bool = False  # an exponent or index of a formula, which no mark means
    expression: str = ""  # of a computed one
    spec: str = ""

    @property
    def end(self) -> int:
        return self.start + len(self.text)


def without_marks(text: str) -> str:
    """`text` without its comments, as a reader sees it."""
    return _COMMENT.sub("", text)


def numbers(
    text: str, printed: Callable[[str], str] | None = None, runs: bool = True
) -> list[Number]:
    """Every number of `text` in order, with what accounts for it.

    `printed` gives what a claim prints, by its id; `runs` says whether a run evaluates the text.
    Raises ValueError for a mark that has more braces than there are numbers before it in its
    paragraph, that cannot be read, that names no claim, or that has braces where nothing runs.
    """
    marks = list(_COMMENT.finditer(text))
    seen = _blank(text, [*marks, *_HIDDEN.finditer(text)])
    seen = _blank(
        seen, [m for f in _MATH.finditer(seen) for m in _COMMAND.finditer(seen, *f.span())]
    )
    found = [Number(m[0], m.start(), *_by_itself(seen, m)) for m in _NUMBER.finditer(seen)]
    since = 0
    for mark in marks:
        if "{" in mark[1] and not runs:
            raise ValueError(f"<!-- {mark[1]} -->: nothing runs this text; use another mark")
        begin = _start(text, mark.start())
        before = [
            i for i, n in enumerate(found) if begin <= n.start < mark.start() and not n.script
        ]
        for i, number in _marked(mark[1], found, before, max(begin, since), printed):
            found[i] = number
        if _is_mark(mark[1]):
            since = mark.end()
    return found


def _start(text: str, at: int) -> int:
    """Where the paragraph, or the row of a table, begins that `at` stands in."""
    line = text.rfind("\n", 0, at) + 1
    if text[line:].startswith("|"):
        return line
    return max((m.end() for m in _BLANK_LINE.finditer(text, 0, at)), default=0)


def _blank(text: str, spans: Iterable[re.Match]) -> str:
    """`text` with `spans` blanked out, of the same length."""
    for span in spans:
        hidden = re.sub(r"[^\n]", " ", span[0])
        text = text[: span.start()] + hidden + text[span.end() :]
    return text


def _by_itself(text: str, number: re.Match) -> tuple[str, bool]:
    """What a number is that no mark accounts for, and whether it is an exponent or an index."""
    inside = next((m for m in _MATH.finditer(text) if _within(number, m)), None)
    if inside is not None:
        scripts = _SCRIPT.finditer(text, inside.start(), inside.end())
        if any(_within(number, m) for m in scripts):
            return STRUCTURAL, True
        if _SMALL.fullmatch(number[0]):
            return STRUCTURAL, False
    places = (*_PLACE.finditer(text), *_YEAR.finditer(text))
    return (STRUCTURAL if any(_within(number, m) for m in places) else UNACCOUNTED), False


def _within(inner: re.Match, outer: re.Match) -> bool:
    return outer.start() <= inner.start() and inner.end() <= outer.end()


def _is_mark(mark: str) -> bool:
    return "{" in mark or mark.partition(":")[0] in ("claim", "paper", "chosen")


def _marked(mark, found, before, since, printed) -> Iterable[tuple[int, Number]]:
    """The numbers that `mark` accounts for, by their place in `found`."""
    word, _, rest = mark.partition(":")
    if "{" in mark:
        fields = _fields(mark)
        if len(fields) > len(before):
            raise ValueError(f"<!-- {mark} --> checks {len(fields)} numbers; fewer stand before it")
        for i, (expression, spec) in zip(before[-len(fields) :], fields, strict=True):
            yield i, replace(found[i], kind=COMPUTED, expression=expression, spec=spec)
    elif word in ("claim", "paper", "chosen"):
        if not rest.strip():
            raise ValueError(f"<!-- {mark} --> does not say where or why; add it behind the colon")
        known = _values(printed(rest.strip())) if word == "claim" and printed else None
        kind = CHOSEN if word == "chosen" else QUOTED
        for i in before:
            number = found[i]
            if number.start < since or number.kind != UNACCOUNTED:
                continue
            if known is None or _value(number.text) in known:
                yield i, replace(number, kind=kind)


def _fields(mark: str) -> list[tuple[str, str]]:
    try:
        parsed = list(string.Formatter().parse(mark))
    except ValueError as error:
        raise ValueError(f"<!-- {mark} --> cannot be read: {error}") from None
    fields = [(name, spec or "") for _, name, spec, _ in parsed if name is not None]
    if not all(name and spec for name, spec in fields):
        raise ValueError(f"<!-- {mark} -->: give {{expression:format}} in every brace")
    for expression, spec in fields:
        _check_expression(expression, spec)
    return fields


def _check_expression(expression: str, spec: str) -> None:
    """Refuse what computes nothing from the run, and what could change it."""
    try:
        nodes = list(ast.walk(ast.parse(expression.strip(), mode="eval")))
    except SyntaxError as error:
        raise ValueError(f"{{{expression}}} cannot be read: {error.msg}") from None
    names = [node.id for node in nodes if isinstance(node, ast.Name)]
    reached = [node.attr for node in nodes if isinstance(node, ast.Attribute)]
    if not names or spec.endswith("s"):
        raise ValueError(f"{{{expression}:{spec}}} takes no number from the run; name one of it")
    if any(isinstance(node, ast.NamedExpr) for node in nodes) or {"check", "judge"} & {
        *names,
        *reached,
    }:
        raise ValueError(f"{{{expression}}} changes the run; a mark only reads")
    if any(name.startswith("__") for name in (*names, *reached)):
        raise ValueError(f"{{{expression}}} reaches inside; name a plain value")


def _values(printed: str) -> set[tuple[str, int]]:
    return {_value(m[0]) for m in _NUMBER.finditer(printed)} - {None}


def _value(number: str) -> tuple[str, int] | None:
    """Digits and power of a typed number; None for a word.

    Signs are left out, because prose says 'minus' in many ways.
    """
    try:
        mantissa, exponent = _canonical(number)
    except ValueError:
        return None
    return mantissa.lstrip("-"), exponent


def _canonical(number: str) -> tuple[str, int]:
    """Digits and power of ten of a number as typed or as formatted: `'4\\times10^{8}'` is 4, 8."""
    plain = number.strip().replace("−", "-").replace(",", "").rstrip("%").lstrip("+")
    plain = re.sub(rf"{_TIMES}\{{?\s*([-+]?\d+)\s*\}}?", r"e\1", plain)
    mantissa, _, exponent = plain.lower().partition("e")
    if not re.fullmatch(r"-?\d*\.?\d+", mantissa, re.ASCII):
        raise ValueError(f"{number!r} is no number in digits")
    if not float(mantissa):
        mantissa = mantissa.lstrip("-")
    return mantissa, int(exponent or 0)


def is_number(computed: str) -> bool:
    """Whether a formatted result is a finite number."""
    try:
        return bool(_canonical(computed))
    except ValueError:
        return False


def same(typed: str, computed: str) -> bool:
    """Whether a typed number is what was computed and formatted."""
    try:
        return _canonical(typed) == _canonical(computed)
    except ValueError:
        return False


def rewritten(text: str, values: Mapping[int, str]) -> str:
    """`text` with the numbers that begin at the given places replaced by what was computed.

    The way of writing stays: a sign as a minus, a power of ten as a power of ten.
    """
    at = {number.start: number for number in numbers(text)}
    for start in sorted(values, reverse=True):
        number = at[start]
        if not same(number.text, values[start]):
            typed = _retyped(number.text, values[start])
            text = text[:start] + typed + text[number.end :]
    return text


def _retyped(old: str, computed: str) -> str:
    mantissa, exponent = _canonical(computed)
    if "−" in old:
        mantissa = mantissa.replace("-", "−")
    if power := re.search(_TIMES, old):
        return f"{mantissa}{power[0]}{{{exponent}}}"
    return f"{mantissa}e{exponent}" if exponent else mantissa


def of_template(
    text: str, quoted: Iterable[str] = (), printed: Callable[[str], str] | None = None
) -> list[Number]:
    """The numbers of a text of the data files: braces are computed, and `quoted` texts may be
    quoted without a mark, because they say what the paper prints."""
    known = {value for part in quoted for value in _values(without_marks(part))}
    plain, fields = "", []
    for literal, name, _, _ in string.Formatter().parse(text):
        plain += literal
        if name is not None:
            fields.append(Number(f"{{{name}}}", len(plain), COMPUTED, expression=name))
            plain += "⟦⟧"
    found = [
        replace(n, kind=QUOTED) if n.kind == UNACCOUNTED and _value(n.text) in known else n
        for n in numbers(plain, printed, runs=False)
    ]
    return [*fields, *found]


def tally(found: Sequence[Number]) -> dict[str, int]:
    """How many numbers each class has."""
    return {kind: sum(number.kind == kind for number in found) for kind in CLASSES}
