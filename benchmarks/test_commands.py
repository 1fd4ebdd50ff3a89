"""Commands that a user waits for."""

from __future__ import annotations

import json
import subprocess
import sys

from conftest import seconds

from rcbook import ledger

GOAL = 0.3  # s, what still feels immediate


def run(*arguments: str, cwd=None) -> None:
    subprocess.run([sys.executable, *arguments], cwd=cwd, check=True, stdout=subprocess.DEVNULL)


def numpy_alone() -> str:
    """How long as much as NumPy takes to start here, which tells a slow machine."""
    return f"import numpy takes {seconds(lambda: run('-c', 'import numpy')):.2f} s here"


def test_help(row):
    row.seconds(
        lambda: run("-m", "rcbook.cli", "--help"),
        GOAL,
        rounds=7,
        question="rcbook --help",
        against=numpy_alone(),
    )


def test_ledger_of_the_last_run(row, tmp_path):
    """In a checkout whose last run judged all claims of all papers as expected."""
    claims = [claim for key in ledger.papers() for claim in ledger.load(key).claims.values()]
    copied = ("id", "paper", "kind", "unit", "printed", "role", "reason")
    rows = [
        {name: getattr(claim, name) for name in copied}
        | {"computed": 1.0, "verdict": claim.expected, "expected_verdict": claim.expected}
        for claim in claims
    ]
    (tmp_path / "notebooks").mkdir()
    (tmp_path / "book" / "_build").mkdir(parents=True)
    (tmp_path / "book" / "_config.yml").write_text("")
    (tmp_path / "book" / "_build" / "ledger.json").write_text(json.dumps(rows))
    row.seconds(
        lambda: run("-m", "rcbook.cli", "ledger", cwd=tmp_path),
        GOAL,
        rounds=7,
        question=f"rcbook ledger, {len(rows)} claims",
        against=numpy_alone(),
    )
