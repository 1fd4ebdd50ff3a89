"""Rows of a ledger for the eye: as text and as HTML.  Rows stay data until they come here."""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from rcbook.ledger.claim import REPRODUCED, SCORED, VERDICTS

_LONG = 8  # a longer list is shown by its ends
# Mathematics as authors mark it, and symbols with an index as they come in words: k_r, y_m(k+1).
_MATH = re.compile(
    r"\$([^$]+)\$|\b([A-Za-z]{1,2})_([A-Za-z]{1,3}|\d+|[a-z]\d)\b((?:\([a-z][-+a-z0-9]*\))?)"
)


def line(row: Mapping) -> str:
    """A row as one line of text."""
    flip = row["verdict"] != row["expected_verdict"]
    expected = f"  (EXPECTED: {row['expected_verdict']})" if flip else ""
    ours = value(row["computed"])
    return f"{row['id']}: printed {row['printed'] or '-'}, ours {ours}: {row['verdict']}{expected}"


def printed(row: Mapping) -> str:
    """What the paper prints for a ledger row, each number of it with its unit."""
    if row["kind"] == "statement":
        return row["printed"]
    values, units = (re.split(r";\s*", row[name]) for name in ("printed", "unit"))
    if len(units) != len(values):
        values, units = ["; ".join(values)], ["; ".join(units)]
    pairs = zip(values, units, strict=True)
    return "; ".join(v if u in ("", "1") else f"{v} {u}" for v, u in pairs)


def value(computed: object) -> str:
    """A computed value of the ledger file, rounded for reading."""
    if computed is None:
        return "-"
    if isinstance(computed, bool):
        return "holds" if computed else "does not hold"
    if isinstance(computed, dict):
        if "holds" in computed:
            mended = "; corrected, it holds" if computed.get("holds_corrected") else ""
            return value(computed["holds"]) + mended
        return "see reason"
    if isinstance(computed, list) and len(computed) > _LONG:
        return f"{min(computed):.6g} to {max(computed):.6g} ({len(computed)} values)"
    if isinstance(computed, list):
        return "; ".join(value(part) for part in computed)
    return f"{computed:.6g}"


def math(text: str) -> str:
    """`text` escaped for HTML, its mathematics and its symbols with an index marked for MathJax."""

    def mark(found: re.Match) -> str:
        tex, letter, index, argument = found.groups()
        upright = index if tex or len(index) == 1 else rf"\mathrm{{{index}}}"
        tex = tex or f"{letter}_{{{upright}}}{argument}"
        return rf'<span class="math notranslate nohighlight">\({tex}\)</span>'

    return _MATH.sub(mark, html.escape(text, quote=False))


def verdict(row: Mapping) -> str:
    """The verdict of a row with its mark, and what was expected where it is another one."""
    found = html.escape(row["verdict"])
    shown = f'<span class="rcbook-verdict" data-verdict="{found}">{found}</span>'
    if row["verdict"] != row["expected_verdict"]:
        shown += f" <b>(expected: {html.escape(row['expected_verdict'])})</b>"
    return shown


def folded(rows: Sequence[Mapping], page: str = "") -> str:
    """The rows of one computation in HTML: a line that counts them and unfolds to their table.

    Ids lead to `page`, which has the whole ledger, and each row can be led to as `claim-ID`.
    """
    if not rows:
        return ""
    flipped = any(row["verdict"] != row["expected_verdict"] for row in rows)
    return details(_tally(rows), table(rows, reasons=False, page=page, anchors=True), flipped)


def details(line: str, body: str, unfolded: bool) -> str:
    """A line of HTML that unfolds to a body."""
    unfold = " open" * unfolded
    return f'<details class="rcbook-verdicts"{unfold}><summary>{line}</summary>{body}</details>'


def _tally(rows: Sequence[Mapping]) -> str:
    """`'7 claims: 6 reproduced, 1 not reproduced: eq25.gain'`, with marks."""
    parts = []
    for name in (name for name in VERDICTS if any(row["verdict"] == name for row in rows)):
        ids = [row["id"] for row in rows if row["verdict"] == name]
        named = ", ".join(f"<code>{html.escape(id)}</code>" for id in ids)
        mark = f'<span class="rcbook-verdict" data-verdict="{name}">{len(ids)} {name}</span>'
        parts.append(mark if name == REPRODUCED else f"{mark}: {named}")
    return f"{len(rows)} claim{'s' * (len(rows) != 1)}: {'; '.join(parts)}"


def table(
    rows: Sequence[Mapping], reasons: bool = True, page: str = "", anchors: bool = False
) -> str:
    """An HTML table of ledger rows: claim, printed, ours, verdict and, if wanted, the reason.

    Ids are links where `page` says which page has the whole ledger; with `anchors` each row can be
    led to.
    """
    heads = ("Claim", "Printed", "Ours", "Verdict", "Reason")[: 4 + reasons]
    return cards(heads, [_row(row, page, anchors) for row in rows], "rcbook-ledger", "Claims")


def cards(
    heads: Sequence[str], rows: Iterable[tuple[str, Sequence[str]]], kind: str, label: str
) -> str:
    """An HTML table of class `kind` whose rows, attributes and cells, are cards on a phone.

    Cells beyond the heads are left out.  What looks like no table any more keeps the roles of one.
    """
    head = "".join(f'<th role="columnheader" scope="col">{name}</th>' for name in heads)
    body = []
    for attributes, cells in rows:
        pairs = zip(heads, cells, strict=False)
        tds = "".join(f'<td role="cell" data-label="{name}">{cell}</td>' for name, cell in pairs)
        body.append(f'<tr role="row"{attributes}>{tds}</tr>')
    return (
        f'<table class="{kind} rcbook-cards" role="table" aria-label="{html.escape(label)}">'
        f'<thead role="rowgroup"><tr role="row">{head}</tr></thead>\n'
        f'<tbody role="rowgroup">\n{chr(10).join(body)}\n</tbody></table>'
    )


def _row(row: Mapping, page: str, anchors: bool) -> tuple[str, Sequence[str]]:
    e = html.escape
    id = f"<code>{e(row['id'])}</code>"
    if page:
        id = f'<a href="{page}#{e(row["id"])}">{id}</a>'
    claim = f"{math(row['says'])}<br><small>{math(row['where'])} · {id}</small>"
    ours = e(value(row["computed"]))
    anchor = f' id="{anchor_of(row["id"])}"' if anchors else ""
    data = f'{anchor} data-verdict="{e(row["verdict"])}" data-paper="{e(row["paper"])}"'
    return data, (claim, math(printed(row)), ours, verdict(row), math(row["reason"]))


def anchor_of(id: str) -> str:
    """Where in its chapter the claim `id` is judged."""
    return f"claim-{html.escape(id)}"


def counts(rows: Iterable[Mapping]) -> str:
    """`'5 claims, 4 of them results (1 headline): 3 reproduced, ...'` for ledger rows."""
    rows = list(rows)
    scored = [row for row in rows if row["role"] in SCORED]
    tally = Counter(row["verdict"] for row in scored)
    parts = ", ".join(f"{tally[verdict]} {verdict}" for verdict in VERDICTS)
    headlines = sum(row["role"] == "headline" for row in scored)
    first = f"{headlines} headline{'s' * (headlines != 1)}"
    return (
        f"{len(rows)} claims, {len(scored)} of them results ({first}): {parts}; "
        f"{len(rows) - len(scored)} inputs and identities outside the score"
    )
