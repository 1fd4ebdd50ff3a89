"""What stands under the headings of `book/cost.md`, from the stored run of the benchmarks."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rcbook.ledger import show

RUN = "cost.json"  # in the folder of the book, written by `make bench`
_MEND = "measure anew with `make bench`"
_MARKERS = "os^Dv<>"
_UNITS = {
    "x": "{:.3g} times faster",
    " floors": "{:.3g} times as long",
    " exponent": "$N^{{{:.3g}}}$",
}


def read(book: Path) -> dict:
    """The stored run.  Raises ValueError where there is none, or it holds no rows."""
    try:
        run = json.loads((book / RUN).read_text(encoding="utf-8"))
        run["rows"] = [bench["extra_info"] for bench in run["benchmarks"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"book/{RUN} cannot be read ({error}); {_MEND}") from None
    if not run["rows"]:
        raise ValueError(f"book/{RUN} holds no rows; {_MEND}")
    return run


def pages(run: Mapping) -> dict[str, str]:
    """Where and when it was measured, the table and, where there are rows of growth, a picture."""
    made = {"cost_stamp.md": stamp(run), "cost_rows.md": table(run["rows"])}
    image = f"```{{image}} growth.png\n:alt: {growth_in_words(run['rows'])}\n:width: 480px\n```\n"
    return made | {"cost_growth.md": image}


def pictures(run: Mapping) -> dict[str, bytes]:
    """The picture of the growth as PNG on white."""
    with matplotlib.style.context("rcbook.pictures.rcbook"):
        figure, file = Figure((6.6, 4.2)), io.BytesIO()
        draw_growth(figure.add_subplot(), run["rows"])
        figure.savefig(file, format="png")
    return {"growth.png": file.getvalue()}


def stamp(run: Mapping) -> str:
    """Date, commit, versions and machine of the run, and how many goals it met."""
    rows, machine = run["rows"], run["machine_info"]
    versions = ", ".join(f"{name} {number}" for name, number in run["versions"].items())
    commit = f"commit `{run['commit_info']['id'][:7]}`"
    if run["commit_info"]["dirty"]:
        commit += " with changes that were not committed"
    missed = sum(not row["met"] for row in rows)
    return (
        f"Measured on {run['datetime'][:10]} at {commit}, with Python {machine['python']}, "
        f"{versions}; {machine['cores']} cores of {machine['cpu']}, "
        "one of them used unless a row says more. "
        f"{len(rows)} questions; {len(rows) - missed} goals are met and {missed} missed.\n"
    )


def table(rows: list[Mapping]) -> str:
    """The rows as tables, one for each area; on a phone a row is a card."""
    parts = []
    for area, group in groupby(rows, key=lambda row: row["area"]):
        shown = show.cards(_COLUMNS, [("", _cells(row)) for row in group], "rcbook-cost", area)
        parts.append(f"### {area}\n\n```{{raw}} html\n{shown}\n```\n")
    return "\n".join(parts)


_COLUMNS = ("Question", "Compared with", "Result", "Goal", "One call", "Memory at most")


def _cells(row: Mapping) -> Sequence[str]:
    found, goal = (
        show.math(_UNITS.get(row["unit"], "{:.3g}" + row["unit"]).format(row[key]))
        for key in ("median", "goal")
    )
    spread = f"<small>{row['low']:.3g} to {row['high']:.3g}</small>"
    met = "met" if row["met"] else "<b>missed</b>"
    took = duration(row["took"]) if "took" in row else ""
    held = " / ".join(megabytes(row[key]) for key in ("peak", "peak_against") if key in row)
    return (
        show.math(row["question"]),
        show.math(row["against"]),
        f"{found}<br>{spread}",
        f"{row['sense']} {goal}<br>{met}",
        took,
        held,
    )


def duration(seconds: float) -> str:
    """A time in s, ms or us, to two digits."""
    scales = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"))
    size, unit = next((scale for scale in scales if seconds >= scale[0]), scales[-1])
    return f"{float(f'{seconds / size:.2g}'):g} {unit}"


def megabytes(size: int) -> str:
    """A size in MB, to two digits."""
    return f"{float(f'{size / 1e6:.2g}'):g} MB"


def draw_growth(ax: Axes, rows: list[Mapping]) -> Axes:
    """Time of one call over the size of the question, for all rows of growth, on two log axes."""
    growing = [row for row in rows if "points" in row]
    for marker, row in zip(_MARKERS, growing, strict=False):
        points = np.array(row["points"])
        sizes = np.unique(points[:, 0])
        middle = [np.median(points[points[:, 0] == size, 1]) for size in sizes]
        ax.loglog(sizes, middle, marker=marker, label=row["question"])
    if growing:
        low, high = (f([p[0] for row in growing for p in row["points"]]) for f in (min, max))
        least = min(p[1] for row in growing for p in row["points"])
        ax.loglog([low, high], [least / 2, least / 2 * high / low], "--", label="in proportion")
        ax.legend()
    ax.set_xlabel("N (samples per period)")
    ax.set_ylabel("time of one call (s)")
    return ax


def growth_in_words(rows: list[Mapping]) -> str:
    """The picture of the growth for those who do not see it."""
    said = [
        f"{row['question']}: as N to the power {row['median']:.2f}, {row['low']:.2f} to "
        f"{row['high']:.2f} with 95 percent confidence"
        for row in rows
        if "points" in row
    ]
    return f"Time of one call over the period N on logarithmic axes. {'; '.join(said)}."
