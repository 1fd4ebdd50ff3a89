"""The pages of the book that are generated from the last run: scoreboard, ledger, errata, API."""

from __future__ import annotations

import html
import pkgutil
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePosixPath
from urllib.parse import urlencode

import rcbook
from rcbook import ledger

_MACHINERY = tuple(
    f"rcbook.{name}"
    for name in ("run", "render", "pages", "cli", "project", "falsify", "numbers", "prose")
)
_COLUMNS = ("Claim", "Printed", "Ours", "Tolerance", "Verdict", "Reason")
_MATH = re.compile(r"\$([^$]+)\$")


def pages(papers: Sequence[ledger.Paper], rows: Sequence[Mapping]) -> dict[str, str]:
    """The generated pages as MyST Markdown, by file name."""
    return {
        "scoreboard.md": scoreboard(papers, rows),
        "ledger.md": ledger_page(papers, rows),
        "errata.md": errata_page(papers, rows),
        "api.md": api_page(),
    }


def scoreboard(papers: Sequence[ledger.Paper], rows: Sequence[Mapping]) -> str:
    """Claims per verdict and paper, as a table whose counts lead to the filtered ledger."""
    head = "".join(f'<th scope="col">{v.capitalize()}</th>' for v in (*ledger.VERDICTS, "all"))
    body = ""
    for paper in papers:
        tally = Counter(row["verdict"] for row in rows if row["paper"] == paper.key)
        cells = "".join(_count(paper.key, v, tally[v]) for v in ledger.VERDICTS)
        name = f'<a href="{_chapter(paper)}">{_math(paper.title)}</a>'
        total = _count(paper.key, "", tally.total())
        body += f'<tr><th scope="row">{name}</th>{cells}{total}</tr>\n'
    return _raw(
        '<div class="rcbook-wide" tabindex="0" role="region" aria-label="Claims per verdict">\n'
        f'<table class="rcbook-score"><thead><tr><th scope="col">Paper</th>{head}</tr></thead>\n'
        f"<tbody>{body}</tbody></table></div>"
    )


def counts(rows: Iterable[Mapping]) -> str:
    """`'5 claims: 4 reproduced, 1 not computable'` for ledger rows, in the order of VERDICTS."""
    tally = Counter(row["verdict"] for row in rows)
    parts = ", ".join(f"{tally[verdict]} {verdict}" for verdict in ledger.VERDICTS)
    total = sum(tally.values())
    return f"{total} claim{'s' if total != 1 else ''}: {parts}"


def _count(paper: str, verdict: str, count: int) -> str:
    query = html.escape(urlencode({"paper": paper, "verdict": verdict}))
    shown = f'<a href="ledger.html?{query}">{count}</a>' if count else "0"
    return f"<td>{shown}</td>"


def ledger_page(papers: Sequence[ledger.Paper], rows: Sequence[Mapping]) -> str:
    """Every claim with its verdict; one anchor per claim id, and a filter where scripts run."""
    chapters = {paper.key: _chapter(paper) for paper in papers}
    head = "".join(f'<th role="columnheader" scope="col">{c}</th>' for c in _COLUMNS)
    body = "\n".join(_ledger_row(row, chapters[row["paper"]]) for row in rows)
    return (
        "---\nhtml_theme.sidebar_secondary.remove: true\n---\n\n(ledger)=\n# Ledger\n\n"
        f"All {len(rows)} claims of this edition: what is printed, what we compute, and the "
        "verdict that follows from the two. A number is *reproduced* when it is within the "
        "tolerance, $|\\text{ours} - \\text{printed}| \\le \\tau$, where $\\tau$ is half a unit of "
        "the last printed digit unless a reason for another is given. "
        "[Errata](errata.md) lists the corrections.\n\n"
        + _raw(
            f"{_filter(papers)}\n"
            '<table class="rcbook-ledger rcbook-full" role="table" aria-label="Claims">'
            f'<thead role="rowgroup"><tr role="row">{head}</tr></thead>'
            f'<tbody role="rowgroup">\n{body}\n</tbody></table>'
        )
    )


def _filter(papers: Sequence[ledger.Paper]) -> str:
    """The filter's form, hidden until our script shows it."""

    def select(name: str, values: Iterable[str]) -> str:
        options = "".join(f"<option>{html.escape(value)}</option>" for value in values)
        return (
            f'<label>{name.capitalize()} <select name="{name}">'
            f'<option value="">all</option>{options}</select></label>'
        )

    return (
        '<form class="rcbook-filter" role="search" aria-label="Filter the claims" hidden>'
        f"{select('paper', [paper.key for paper in papers])}{select('verdict', ledger.VERDICTS)}"
        '<label>Text <input type="search" name="text" autocomplete="off"></label>'
        '<button type="reset">Show all</button>'
        '<output role="status"></output></form>'
    )


def _ledger_row(row: Mapping, chapter: str) -> str:
    id = html.escape(row["id"])
    claim = (
        f"{_math(row['says'])}<br><small>{_math(row['where'])} · "
        f'<a href="{chapter}">{html.escape(row["notebook"])}</a> · '
        f'<a href="#{id}"><code>{id}</code></a></small>'
    )
    cells = (
        claim,
        _math(ledger.show_printed(row)),
        _math(ledger.show_value(row["computed"])),
        _tolerance(row),
        _verdict(row),
        _math(row["reason"]),
    )
    labelled = zip(_COLUMNS, cells, strict=True)
    tds = "".join(f'<td role="cell" data-label="{name}">{cell}</td>' for name, cell in labelled)
    return (
        f'<tr role="row" id="{id}" data-paper="{html.escape(row["paper"])}" '
        f'data-verdict="{html.escape(row["verdict"])}">{tds}</tr>'
    )


def _tolerance(row: Mapping) -> str:
    tolerance = row["tolerance"]
    if tolerance is None:
        return "–"
    values = tolerance if isinstance(tolerance, list) else [tolerance]
    shown = "; ".join(f"±{value:g}" for value in dict.fromkeys(values))
    reason = row.get("tolerance_reason")
    return f"{shown}<br><small>{_math(reason)}</small>" if reason else shown


def _verdict(row: Mapping) -> str:
    verdict = row["verdict"]
    shown = f'<span class="rcbook-verdict" data-verdict="{verdict}">{verdict}</span>'
    if row["erratum"]:
        anchor = _anchor(row["paper"], row["erratum"])
        shown += f'<br><small><a href="errata.html#{anchor}">erratum</a></small>'
    elif verdict == ledger.CORRECTED:
        anchor = _anchor(row["paper"], f"reading-{row['reading']}")
        shown += f'<br><small>reading <a href="errata.html#{anchor}">{row["reading"]}</a></small>'
    return shown


def errata_page(papers: Sequence[ledger.Paper], rows: Sequence[Mapping]) -> str:
    """Per paper: each erratum, why it is one, and the claims that decide it."""
    parts = [
        "(errata)=\n# Errata",
        "What the papers print and what has to stand there. An erratum is decided by computed "
        "claims: they fail as printed and hold as corrected. One without such a claim is a slip "
        "of the pen and is labelled *typographical*.",
    ]
    for paper in papers:
        parts += [f"## {paper.title}", f"{paper.citation.rstrip('.')} (`{paper.key}`)."]
        for key, erratum in paper.errata.items():
            decided = [r for r in rows if r["paper"] == paper.key and r["erratum"] == key]
            parts.append(_erratum(paper.key, key, erratum, decided))
        parts += ["### Readings", "Where the print leaves a choice, we read it so."]
        parts += [
            f"({_anchor(paper.key, f'reading-{key}')})=\n"
            f"#### {reading['title']}\n\n{reading['text']}"
            for key, reading in paper.conventions.items()
        ]
    return "\n\n".join(parts) + "\n"


def _erratum(paper: str, key: str, erratum: Mapping[str, str], decided: Sequence[Mapping]) -> str:
    lines = [
        f"({_anchor(paper, key)})=",
        f"### {erratum['where'][:1].upper()}{erratum['where'][1:]}",
        "",
        f"Printed\n: {erratum['printed']}\n",
        f"Corrected\n: {erratum['corrected']}\n",
        f"Why\n: {erratum['why']}\n",
    ]
    if not decided:
        return "\n".join([*lines, "Decided by\n: nothing computed; typographical"])
    return "\n".join([*lines, "Decided by", *(_deciding(row) for row in decided)])


def _deciding(row: Mapping) -> str:
    """One claim as a definition of the list, in HTML because its texts are no Markdown."""
    id = html.escape(row["id"])
    return (
        f': <a href="ledger.html#{id}"><code>{id}</code></a> '
        f'<span class="rcbook-verdict" data-verdict="{row["verdict"]}">{row["verdict"]}</span>. '
        f"<span>{_math(row['reason'])}</span>"
    )


def api_page() -> str:
    """One section per module of the package, from its docstrings."""
    found = pkgutil.walk_packages(rcbook.__path__, "rcbook.")
    names = [m.name for m in found if not m.ispkg and m.name not in _MACHINERY]
    sections = (
        f"## {name}\n\n```{{eval-rst}}\n.. automodule:: {name}\n"
        "   :members:\n   :member-order: bysource\n```\n"
        for name in names
    )
    return "(api)=\n# API reference\n\nGenerated from the docstrings.\n\n" + "\n".join(sections)


def _chapter(paper: ledger.Paper) -> str:
    return f"notebooks/{PurePosixPath(paper.notebook).stem}.html"


def _anchor(paper: str, erratum: str) -> str:
    return f"erratum-{paper}-{erratum}".replace("_", "-").lower()


def _math(text: str) -> str:
    """`text` escaped for HTML, its `$...$` marked for MathJax."""
    mark = r'<span class="math notranslate nohighlight">\\(\1\\)</span>'
    return _MATH.sub(mark, html.escape(text, quote=False))


def _raw(text: str) -> str:
    return f"```{{raw}} html\n{text}\n```\n"
