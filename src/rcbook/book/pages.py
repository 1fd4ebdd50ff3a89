"""The pages of the book that are generated from the last run: scoreboard, ledger, errata, API."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePosixPath
from urllib.parse import urlencode

from rcbook import ledger
from rcbook.book import links
from rcbook.ledger import show

_COLUMNS = ("Claim", "Printed", "Ours", "Tolerance", "Verdict", "Reason")


def pages(papers: Sequence[ledger.Paper], rows: Sequence[Mapping]) -> dict[str, str]:
    """The generated pages as MyST Markdown, by file name."""
    return {
        "scoreboard.md": scoreboard(papers, rows),
        "idea.md": idea_table(papers),
        "ledger.md": ledger_page(papers, rows),
        "errata.md": errata_page(papers, rows),
        "api.md": api_page(),
    }


def scoreboard(papers: Sequence[ledger.Paper], rows: Sequence[Mapping]) -> str:
    """Claims per verdict and paper: headlines, all results, and what stands outside the score.

    Every count leads to the filtered ledger.
    """
    headlines = _score(papers, rows, "headline", "Headlines", outside=False)
    results = _score(papers, rows, "scored", "All results, headlines included", outside=True)
    return _raw(headlines + "\n" + results)


def _score(papers, rows, group: str, title: str, outside: bool) -> str:
    heads = (*ledger.VERDICTS, "all") + ("inputs and identities",) * outside
    head = "".join(f'<th scope="col">{h.capitalize()}</th>' for h in heads)
    body = ""
    for paper in papers:
        own = [row for row in rows if row["paper"] == paper.key]
        tally = Counter(row["verdict"] for row in own if group in roles(row))
        name = "<br>".join(_link(paper, chapter.notebook) for chapter in paper.chapters)
        cells = "".join(_count(paper.key, v, group, tally[v]) for v in ledger.VERDICTS)
        cells += _count(paper.key, "", group, tally.total())
        if outside:
            beyond = sum("outside" in roles(row) for row in own)
            cells += _count(paper.key, "", "outside", beyond)
        body += f'<tr><th scope="row">{name}</th>{cells}</tr>\n'
    return (
        f'<div class="rcbook-wide" tabindex="0" role="region" aria-label="{title}">\n'
        f'<table class="rcbook-score"><caption>{title}</caption>'
        f'<thead><tr><th scope="col">Chapter</th>{head}</tr></thead>\n'
        f"<tbody>{body}</tbody></table></div>"
    )


def roles(row: Mapping) -> tuple[str, str]:
    """The role of a row and whether it is `scored` or `outside` the score."""
    return row["role"], "scored" if row["role"] in ledger.SCORED else "outside"


def _count(paper: str, verdict: str, role: str, count: int) -> str:
    query = html.escape(urlencode({"paper": paper, "verdict": verdict, "role": role}))
    shown = f'<a href="ledger.html?{query}">{count}</a>' if count else "0"
    return f"<td>{shown}</td>"


def idea_table(papers: Sequence[ledger.Paper]) -> str:
    """The papers as rows of one table: what loop, over what index, with what period."""
    head = "| chapter | loop | index | period $N$ |\n|---|---|---|---|\n"
    return head + "".join(_idea(chapter) for paper in papers for chapter in paper.chapters)


def _idea(chapter: ledger.Chapter) -> str:
    idea = chapter.idea
    name = f"[{_short(chapter.title)}](notebooks/{chapter.notebook})"
    loop = f"{idea['loop']} {{cite}}`{idea['cite']}`"
    return f"| {name} | {loop} | {idea['index']} | {idea['period']} |\n"


def cover(notebook: str, heading: str, alt: str) -> str:
    """The cover of the book with the words of its cell and a link to its chapter."""
    title = heading.partition("\n")[0].removeprefix("# ")
    return (
        f"```{{image}} cover.png\n:alt: {' '.join(alt.split())}\n:width: 100%\n:align: center\n"
        f"```\n\n*From the chapter [{title}](notebooks/{notebook}).*\n"
    )


def chapters(papers: Sequence[ledger.Paper]) -> str:
    """The chapters as a list for the README: title with a link to the notebook, and citation."""
    lines = []
    for paper in papers:
        for chapter in paper.chapters:
            own = chapter.notebook == paper.notebook
            source = f"{paper.citation.rstrip('.')}." if own else "the same paper."
            lines.append(f"- [{chapter.title}](notebooks/{chapter.notebook}): {source}\n")
    return "".join(lines)


def ledger_page(papers: Sequence[ledger.Paper], rows: Sequence[Mapping]) -> str:
    """Every claim with its verdict; one anchor per claim id, and a filter where scripts run."""
    by_key = {paper.key: paper for paper in papers}
    claims = [_ledger_row(row, by_key[row["paper"]]) for row in rows]
    return (
        "---\nhtml_theme.sidebar_secondary.remove: true\n---\n\n(ledger)=\n# Ledger\n\n"
        f"All {len(rows)} claims of this edition: what is printed, what we compute, and the "
        "verdict that follows from the two. A number is *reproduced* when it is within the "
        "tolerance, $|\\text{ours} - \\text{printed}| \\le \\tau$, where $\\tau$ is half a unit of "
        "the last printed digit unless a [word](unsharp-words) such as *about* or a reason says "
        "otherwise. [Errata](errata.md) lists the corrections.\n\n"
        "A *headline* is what abstract or conclusions rest on; headlines and *results* are "
        "scored. An *input* is what the paper lists as given and an *identity* is true whatever "
        "the data; both are checked and stand outside the score. A scored verdict that nothing "
        "can turn would say nothing: beside each stands a change of the model under which it "
        "flips, and how large the change may be before it does.\n\n"
        + _raw(
            f"{_filter(papers)}\n"
            + show.cards(_COLUMNS, claims, "rcbook-ledger rcbook-full", "Claims")
        )
        + "\n"
        + words_table()
    )


def words_table() -> str:
    """What unsharp words mean, as a section of the ledger page."""
    rows = "".join(
        f'<tr id="word-{key}"><th scope="row">{html.escape(", ".join(row.words))}</th>'
        f"<td>{show.math(row.means)}</td></tr>\n"
        for key, row in ledger.WORDS.items()
    )
    return (
        "(unsharp-words)=\n## What the papers' words mean\n\n"
        "Where a paper prints a word instead of a number, the word means the same in every "
        "paper. The table was fixed before the verdicts of this edition were computed.\n\n"
        + _raw(
            '<div class="rcbook-wide" tabindex="0" role="region" aria-label="Words">'
            '<table class="rcbook-words"><thead><tr><th scope="col">Words</th>'
            f'<th scope="col">Meaning</th></tr></thead><tbody>{rows}</tbody></table></div>'
        )
    )


def _filter(papers: Sequence[ledger.Paper]) -> str:
    """The filter's form, hidden until our script shows it."""

    def select(name: str, values: Iterable[str], also: str = "") -> str:
        options = also + "".join(f"<option>{html.escape(value)}</option>" for value in values)
        return (
            f'<label>{name.capitalize()} <select name="{name}">'
            f'<option value="">all</option>{options}</select></label>'
        )

    groups = '<option value="scored">headline or result</option>'
    groups += '<option value="outside">input or identity</option>'
    return (
        '<form class="rcbook-filter" role="search" aria-label="Filter the claims" hidden>'
        f"{select('paper', [paper.key for paper in papers])}{select('verdict', ledger.VERDICTS)}"
        f"{select('role', ledger.ROLES, groups)}"
        '<label>Text <input type="search" name="text" autocomplete="off"></label>'
        '<button type="reset">Show all</button>'
        '<output role="status"></output></form>'
    )


def _ledger_row(row: Mapping, paper: ledger.Paper) -> tuple[str, Sequence[str]]:
    id = html.escape(row["id"])
    claim = (
        f"{show.math(row['says'])}<br><small>{show.math(row['where'])} · "
        f"{_link(paper, row['notebook'], show.anchor_of(row['id']))} · "
        f'<a href="#{id}"><code>{id}</code></a></small>'
    )
    cells = (
        claim,
        show.math(show.printed(row)),
        show.math(show.value(row["computed"])),
        _tolerance(row) + _flips(row),
        _verdict(row, paper),
        show.math(row["reason"]),
    )
    data = (
        f' id="{id}" data-paper="{html.escape(row["paper"])}" data-role="{" ".join(roles(row))}" '
        f'data-verdict="{html.escape(row["verdict"])}"'
    )
    return data, cells


def _tolerance(row: Mapping) -> str:
    tolerance, reason = row["tolerance"], show.math(row["tolerance_reason"])
    if row["word"]:
        key = next(key for key, known in ledger.WORDS.items() if row["word"] in known.words)
        reason = f'<a href="#word-{key}">{html.escape(row["word"])}</a>'
    if tolerance is None:
        return reason or "–"
    values = tolerance if isinstance(tolerance, list) else [tolerance]
    shown = "; ".join(f"±{value:g}" for value in dict.fromkeys(values))
    return f"{shown}<br><small>{reason}</small>" if reason else shown


def _flips(row: Mapping) -> str:
    """The change that turns the verdict, and how large it may be, for the tolerance column."""
    margin = row["margin"]
    if margin:
        keeps, flips = (_size(margin[name], margin["unit"]) for name in ("keeps", "flips"))
        how = f"holds at {keeps}, not at {flips}" if margin["keeps"] else f"not at {flips}"
        if margin["about"]:
            how = f"beyond {_size(margin['about'], margin['unit'])}"
        return f"<br><small>flips with {show.math(margin['what'])}: {how}</small>"
    return f"<br><small>flips with {show.math(row['flips_under'])}</small>" * bool(
        row["flips_under"]
    )


def _size(size: float, unit: str) -> str:
    return f"{100 * size:.3g} %" if unit == "relative" else f"{size:.3g} {html.escape(unit)}"


def _verdict(row: Mapping, paper: ledger.Paper) -> str:
    shown = f"{show.verdict(row)}<br><small>{row['role']}</small>"
    if row["erratum"]:
        anchor = _anchor(row["paper"], row["erratum"])
        shown += f'<br><small><a href="errata.html#{anchor}">erratum</a></small>'
    elif row["verdict"] == ledger.CORRECTED:
        anchor = _anchor(row["paper"], f"reading-{row['reading']}")
        title = show.math(paper.conventions[row["reading"]]["title"])
        shown += f'<br><small>reading: <a href="errata.html#{anchor}">{title}</a></small>'
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
        also = (f"[{c.title}](notebooks/{c.notebook})" for c in paper.further)
        parts += [f"The same paper: {', '.join(also)}."] * bool(paper.further)
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
        f"{show.verdict(row)}. "
        f"<span>{show.math(row['reason'])}</span>"
    )


def api_page() -> str:
    """One section per module of the package, from its docstrings."""
    sections = (
        f"## {name}\n\n```{{eval-rst}}\n.. automodule:: {name}\n"
        "   :members:\n   :member-order: bysource\n```\n"
        for name in links.modules()
    )
    return "(api)=\n# API reference\n\nGenerated from the docstrings.\n\n" + "\n".join(sections)


def _link(paper: ledger.Paper, notebook: str, anchor: str = "") -> str:
    """The short title of the chapter that a notebook of `paper` is, as a link to it, in HTML."""
    title = next(c.title for c in paper.chapters if c.notebook == notebook)
    place = f"notebooks/{PurePosixPath(notebook).stem}.html" + f"#{anchor}" * bool(anchor)
    return f'<a href="{place}">{show.math(_short(title))}</a>'


def _short(title: str) -> str:
    """A title up to its colon."""
    return title.partition(":")[0]


def _anchor(paper: str, erratum: str) -> str:
    return f"erratum-{paper}-{erratum}".replace("_", "-").lower()


def _raw(text: str) -> str:
    return f"```{{raw}} html\n{text}\n```\n"
