"""Rows of a ledger for the eye: as text and as HTML.  Rows stay data until they come here."""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from rcbook.ledger.claim import SCORED, VERDICTS

_LONG = 8  # a longer list is shown by its ends
_MATH = re.compile(r"\$([^$]+)\$")


def line(row: Mapping) -> str:
    """A row as one line of text."""
    flip = row["verdict"] != row["expected_verdict"]
    expected = f"  (EXPECTED: {row['expected_verdict']})" if flip else ""
    ours = value(row["computed"])
    return f"{row['id']}: printed {row['printed'] or '-'}, ours {ours}: {row['verdict']}{expected}"


def printed(row: Mapping) -> str:
    """What the paper prints for a ledger row, with its unit where it is a number."""
    bare = row["kind"] == "statement" or row["unit"] in ("", "1")
    return row["printed"] if bare else f"{row['printed']} {row['unit']}"


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
    """`text` escaped for HTML, its `$...$` marked for MathJax."""
    mark = r'<span class="math notranslate nohighlight">\\(\1\\)</span>'
    return _MATH.sub(mark, html.escape(text, quote=False))


def table(rows: Sequence[Mapping], reasons: bool = True, page: str = "") -> str:
    """An HTML table of ledger rows: claim, printed, ours, verdict and, if wanted, the reason.

    Ids are links where `page` says which page has the whole ledger.
    """
    heads = ["Claim", "Printed", "Ours", "Verdict"] + ["Reason"] * reasons
    head = "".join(f"<th>{h}</th>" for h in heads)
    body = "".join(_row(row, reasons, page) for row in rows)
    return (
        f'<table class="rcbook-ledger"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
    )


def _row(row: Mapping, reasons: bool, page: str) -> str:
    e = html.escape
    verdict = e(row["verdict"])
    if row["verdict"] != row["expected_verdict"]:
        verdict += f" <b>(expected: {e(row['expected_verdict'])})</b>"
    id = f"<code>{e(row['id'])}</code>"
    if page:
        id = f'<a href="{page}#{e(row["id"])}">{id}</a>'
    where = f"{e(row['where'])} · {id}"
    return (
        f'<tr data-verdict="{e(row["verdict"])}" data-paper="{e(row["paper"])}">'
        f"<td>{e(row['says'])}<br><small>{where}</small></td>"
        f"<td>{e(printed(row))}</td><td>{e(value(row['computed']))}</td>"
        f"<td>{verdict}</td>" + (f"<td>{e(row['reason'])}</td>" * reasons) + "</tr>"
    )


def counts(rows: Iterable[Mapping]) -> str:
    """`'5 claims, 4 of them results (1 headlines): 3 reproduced, ...'` for ledger rows."""
    rows = list(rows)
    scored = [row for row in rows if row["role"] in SCORED]
    tally = Counter(row["verdict"] for row in scored)
    parts = ", ".join(f"{tally[verdict]} {verdict}" for verdict in VERDICTS)
    headlines = sum(row["role"] == "headline" for row in scored)
    return (
        f"{len(rows)} claims, {len(scored)} of them results ({headlines} headlines): {parts}; "
        f"{len(rows) - len(scored)} inputs and identities outside the score"
    )
