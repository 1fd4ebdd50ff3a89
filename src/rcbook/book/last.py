"""The ledger of the last run: read from its file, and printed as a table."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence

from rcbook.book.project import Project, read_text
from rcbook.ledger import show

WIDTH = 160  # characters, where the table goes to a file and not to a terminal


def read(project: Project) -> list[dict]:
    """The rows of the ledger file.  Raises ValueError when it is not there or damaged."""
    file = project.ledger_file
    if not file.is_file():
        raise ValueError(f"there is no {file} yet; run `rcbook check` first")
    try:
        rows = json.loads(read_text(file))
    except json.JSONDecodeError as error:
        raise ValueError(f"{file} is damaged ({error}); run `rcbook check` anew") from None
    if not isinstance(rows, list):
        raise ValueError(f"{file} holds no list of rows; run `rcbook check` anew")
    return rows


def print_table(rows: Sequence[Mapping]) -> None:
    """Print ledger rows as a table, and their counts under it."""
    # Only here, so that programs get the rows where rich is not installed.
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False)
    table.add_column("claim", min_width=max((len(row["id"]) for row in rows), default=5))
    for name in ("printed", "ours", "verdict", "reason"):
        table.add_column(name, overflow="fold")
    for row in rows:
        flip = "" if row["verdict"] == row["expected_verdict"] else " (NOT EXPECTED)"
        shown = (
            show.printed(row),
            show.value(row["computed"]),
            row["verdict"] + flip,
            row["reason"],
        )
        table.add_row(*(Text(cell) for cell in (row["id"], *shown)))  # brackets are no markup
    Console(width=None if sys.stdout.isatty() else WIDTH).print(table)
    print(f"\n{show.counts(rows)}")
