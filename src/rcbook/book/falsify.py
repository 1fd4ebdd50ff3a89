"""Change the model a little and see which verdicts turn.

A verdict that nothing turns says nothing.  Every scored claim names a change of `papers/KEY.toml`
under which its verdict flips; here its notebooks are run under that change, without pictures,
and the verdicts are compared.  Run at several sizes, a change also tells how far its parameter may
move before a verdict flips.
"""

from __future__ import annotations

import ast
import json
import os
import platform
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import date
from importlib import metadata
from pathlib import Path

import rcbook
from rcbook import ledger
from rcbook.ledger import Ledger, Paper

LIMIT = 900.0  # s per run; notebooks without their pictures take less than with them
SHORT = 30  # tolerances; over a longer way a number is not taken to move on a line
SKIP = "no-claims"  # tag of cells that draw or sweep and feed no claim


@dataclass(frozen=True)
class Trial:
    """What one run of a paper's notebooks under one change came to."""

    change: str
    size: float | None  # None for a change that has no size
    verdicts: Mapping[str, str]  # by claim id; a claim that was not reached is not there
    computed: Mapping[str, object]
    troubles: Sequence[str]  # statements of the notebook that failed under the change


def sizes(change: Mapping) -> list[float | None]:
    """The sizes at which a change is tried, ascending; `[None]` where it has none."""
    return sorted(change["sizes"]) if "sizes" in change else [None]


def falsify(
    papers: Iterable[Paper], notebooks: Path, change: str = "", measure: bool = False
) -> bool:
    """Run notebooks under the changes of `papers`, print what turned, and say whether all is well.

    All is well when every scored claim is shown to be falsifiable.  One `change` alone shows what
    it turns and nothing more.  `measure` runs all sizes and stores the margins.
    Raises ValueError for a change that no paper has, and for one that does not run.
    """
    papers = list(papers)
    if change:
        having = [paper for paper in papers if change in paper.changes]
        if not having:
            keys = ", ".join(paper.key for paper in papers)
            raise ValueError(f"no change {change!r} in the data of {keys}; see [changes] there")
        papers = having
    problems = shown = 0
    for paper in papers:
        tried = trials(paper, notebooks, wanted(paper, change, measure))
        for trial in tried:
            print(_outcome(paper, trial))
        if change:
            continue
        print(listing(paper, tried))
        lacking = unflipped(paper, tried)
        print("".join(f"UNFLIPPED {problem}\n" for problem in lacking), end="")
        problems += len(lacking)
        shown += sum(claim.scored for claim in paper.claims.values())
        if measure and not lacking:
            store(paper, margins(paper, tried))
    print(f"{shown} scored claims, {problems} not shown to be falsifiable")
    return not problems


def wanted(paper: Paper, change: str = "", every: bool = False) -> list[tuple[str, float | None]]:
    """What to run: all changes and none, or one; at the largest size, or at `every` size."""
    names = [change] if change else list(paper.changes)
    tries = [] if change else [("", None)]
    for name in names:
        tries += [(name, size) for size in sizes(paper.changes[name])[0 if every else -1 :]]
    return tries


def trials(paper: Paper, notebooks: Path, tries: Iterable[tuple[str, float | None]]) -> list[Trial]:
    """Run the notebooks of `paper` under each (change, size) of `tries`, side by side.

    The change `""` leaves the model as it is.
    Raises ValueError for a change that the paper does not have, and for one that does not run.
    """
    tries = list(tries)
    if unknown := sorted({name for name, _ in tries} - paper.changes.keys() - {""}):
        raise ValueError(f"{paper.key}.toml has no change {', '.join(unknown)}; see [changes]")
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        return list(pool.map(lambda each: _trial(paper, notebooks, *each), tries))


def _trial(paper: Paper, notebooks: Path, name: str, size: float | None) -> Trial:
    from rcbook.book.execute import kernel_environment

    code = paper.changes[name]["apply"] if name else ""
    who = f"{paper.key}.toml: change {name!r}" if name else f"{paper.key} without a change"
    with tempfile.TemporaryDirectory(prefix="rcbook-", ignore_cleanup_errors=True) as scratch:
        answer = Path(scratch) / "answer.json"  # a change may print what it likes
        job = json.dumps(
            {
                "notebooks": [str(notebooks / chapter.notebook) for chapter in paper.chapters],
                "apply": code,
                "size": size,
                "answer": str(answer),
            }
        )
        settings = {
            "cwd": notebooks,
            "env": kernel_environment(Path(scratch)) | {"MPLBACKEND": "agg"},
            "encoding": "utf-8",
            "timeout": LIMIT,
        }
        command = [sys.executable, "-m", "rcbook.book.falsify"]
        try:
            done = subprocess.run(command, input=job, capture_output=True, **settings)
        except subprocess.TimeoutExpired:
            raise ValueError(f"{who} still runs after {LIMIT:g} s; make it smaller") from None
        if done.returncode or not answer.is_file():
            why = done.stderr.strip().splitlines()[-1:] or ["it ended without an answer"]
            raise ValueError(f"{who} does not run: {why[0]}")
        return Trial(name, size, **json.loads(answer.read_text(encoding="utf-8")))


def run_cells(notebooks: Sequence[Path], apply: str, size: float | None) -> dict:
    """Run the code cells of notebooks in this process, one by one, after the change `apply`."""
    exec(apply, {"size": size})
    warnings.simplefilter("ignore")  # a changed loop may well overflow
    rows, troubles = [], []
    for notebook in notebooks:
        space = _space(notebook, troubles)
        rows += [r for item in space.values() if isinstance(item, Ledger) for r in item.rows()]
    return {
        "verdicts": {row["id"]: row["verdict"] for row in rows},
        "computed": {row["id"]: row["computed"] for row in rows},
        "troubles": troubles,
    }


def _space(notebook: Path, troubles: list[str]) -> dict:
    """The names that the code cells of one notebook bind; what failed is added to `troubles`.

    Statements run one by one, so that one that fails under the change takes no other with it.
    """
    import matplotlib.pyplot as plt
    import nbformat

    space = {"__name__": "__main__", "display": lambda *_: None}
    for cell in nbformat.read(notebook, as_version=4).cells:
        if cell.cell_type != "code" or SKIP in cell.metadata.get("tags", ()):
            continue
        for statement in ast.parse(cell.source).body:
            try:
                exec(compile(ast.Module([statement], []), cell.id, "exec"), space)
            except (Exception, SystemExit) as error:
                troubles.append(f"{notebook.name}, {cell.id}: {type(error).__name__}: {error}")
                _forget(statement, space)
        plt.close("all")
    return space


def _forget(statement: ast.stmt, space: dict) -> None:
    """Take away what a statement that failed would have bound: an old value is no result."""
    for node in ast.walk(statement):
        bound = isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        if bound and not isinstance(space.get(node.id), Ledger):
            space.pop(node.id, None)


def by_size(tried: Iterable[Trial]) -> dict[str, list[Trial]]:
    """Trials by the name of their change, each list from the smallest size to the largest."""
    found: dict[str, list[Trial]] = {}
    for trial in sorted(tried, key=lambda trial: trial.size or 0.0):
        found.setdefault(trial.change, []).append(trial)
    return found


def _outcome(paper: Paper, trial: Trial) -> str:
    """Which verdicts one trial turned, and what failed in it."""
    turned = [id for id, v in trial.verdicts.items() if v != paper.claims[id].expected]
    head = f"{trial.change or 'no change'} {trial.size or ''}".strip()
    line = f"{paper.key}, {head}: {len(turned)} verdicts turned: {', '.join(turned)}"
    return "\n".join([line, *(f"    failed: {trouble}" for trouble in trial.troubles)])


def listing(paper: Paper, tried: Sequence[Trial]) -> str:
    """A line for every scored claim that can be computed: its verdict, and what it turns to under
    which change."""
    largest = {name: series[-1] for name, series in by_size(tried).items()}
    lines = []
    for claim in paper.claims.values():
        trial = largest.get(claim.flips_under)
        if claim.flips_under and trial:
            turned = trial.verdicts.get(claim.id, "not reached")
            what = paper.changes[claim.flips_under]["what"]
            size = f" ({trial.size:g})" if trial.size else ""
            lines.append(f"{claim.id}: {claim.expected} -> {turned} with {what}{size}")
    return "\n".join(lines)


def unflipped(paper: Paper, tried: Sequence[Trial]) -> list[str]:
    """Why the scored claims of `paper` are not all shown to be falsifiable; empty when they are.

    A claim is, when the change it names turns its verdict at the largest size tried.  Without a
    change, where that was tried, every verdict is the expected one.
    """
    largest = {name: series[-1] for name, series in by_size(tried).items()}
    problems = []
    if plain := largest.get(""):
        problems += [f"{trouble} (without a change)" for trouble in plain.troubles]
        for id, verdict in plain.verdicts.items():
            if verdict != paper.claims[id].expected:
                problems.append(f"{id}: {verdict} without a change; expected otherwise")
    for claim in paper.claims.values():
        if not claim.scored or claim.expected == ledger.NOT_COMPUTABLE:
            continue
        trial = largest.get(claim.flips_under)
        if not claim.flips_under:
            problems.append(f"{claim.id}: names no change that flips it; is it an identity?")
        elif trial is None:
            problems.append(f"{claim.id}: its change {claim.flips_under!r} was not tried")
        elif claim.id not in trial.verdicts:
            problems.append(f"{claim.id}: not reached under {claim.flips_under!r}")
        elif trial.verdicts[claim.id] == claim.expected:
            problems.append(f"{claim.id}: still {claim.expected} under {claim.flips_under!r}")
    return problems


def margins(paper: Paper, tried: Sequence[Trial]) -> dict[str, dict]:
    """How far the most telling parameter may move before each scored verdict flips.

    For every claim the change that flips it at the smallest size: the largest size before it, the
    one at which it flipped, and for a number the size between at which it leaves its tolerance.
    """
    found: dict[str, dict] = {}
    series_of = by_size(tried)
    plain = series_of.get("", [None])[0]
    for name, change in paper.changes.items():
        series = [trial for trial in series_of.get(name, ()) if trial.size]
        for claim in paper.claims.values():
            if not claim.scored or claim.expected == ledger.NOT_COMPUTABLE:
                continue
            reached = [t for t in series if claim.id in t.verdicts]
            flips = next((t for t in reached if t.verdicts[claim.id] != claim.expected), None)
            if flips is None or flips.size >= found.get(claim.id, {}).get("flips", float("inf")):
                continue
            kept = [t for t in reached if t.size < flips.size]
            last = kept[-1] if kept else plain
            found[claim.id] = {
                "change": name,
                "what": change["what"],
                "unit": change.get("unit", "relative"),
                "keeps": kept[-1].size if kept else 0.0,
                "flips": flips.size,
                "about": _crossing(claim, last, flips),
            }
    return found


def _crossing(claim: ledger.Claim, kept: Trial | None, flips: Trial) -> float | None:
    """The size at which a computed number crosses its tolerance, on the line between two trials.

    None for what is no number, where no number crosses, and where one has moved so far beyond its
    tolerance that a line says nothing.
    """
    claim = claim.corrected if claim.expected == ledger.CORRECTED else claim
    tolerances = ledger.tolerances(claim)
    if kept is None or tolerances is None or claim.kind == "bound":
        return None
    start, end = kept.size or 0.0, flips.size
    values = (tolerances, kept.computed[claim.id], flips.computed[claim.id])
    tolerances, before, after = (x if isinstance(x, list) else [x] for x in values)
    crossings = []
    for p, tolerance, a, b in zip(claim.parsed.numbers, tolerances, before, after, strict=True):
        numbers = isinstance(a, int | float) and isinstance(b, int | float) and a != b
        if numbers and max(abs(a - float(p)), abs(b - float(p))) <= SHORT * tolerance:
            shares = ((float(p) + sign * tolerance - a) / (b - a) for sign in (-1, 1))
            crossings += [start + share * (end - start) for share in shares if 0 <= share <= 1]
    return min(crossings, default=None)


def store(paper: Paper, found: Mapping[str, Mapping]) -> Path:
    """Write `found` beside the paper's data, with the date and versions that it was measured at."""
    from rcbook.book.project import write

    versions = {name: metadata.version(name) for name in ("numpy", "scipy")}
    head = {"date": date.today().isoformat(), "python": platform.python_version(), **versions}
    path = Path(rcbook.__file__).parent / "papers" / f"{paper.key}.margins.json"
    write(path, json.dumps({**head, "claims": found}, indent=1) + "\n")
    return path


if __name__ == "__main__":
    job = json.load(sys.stdin)
    said = run_cells(list(map(Path, job["notebooks"])), job["apply"], job["size"])
    Path(job["answer"]).write_text(json.dumps(said), encoding="utf-8")
