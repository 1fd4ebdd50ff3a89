"""One run: execute every notebook, judge every claim, say what came out, keep the ledger."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import nbformat

from rcbook import ledger
from rcbook.book import preflight
from rcbook.book.execute import LIMIT, Failure, Typed, execute, plain
from rcbook.book.project import Project, write
from rcbook.ledger import show


@dataclass(frozen=True)
class Run:
    """One execution of all notebooks and what it says about every claim."""

    notebooks: Mapping[str, nbformat.NotebookNode]  # executed, by file name
    failures: Sequence[Failure]
    typed: Mapping[str, Sequence[Typed]]  # numbers of the text, by file name
    rows: Sequence[Mapping] = ()  # of the ledger, papers in order, claims in the paper's order
    missing: Sequence[str] = ()  # ids never computed

    @property
    def complete(self) -> bool:
        """Whether every notebook ended well and every claim was computed."""
        return not self.failures and not self.missing

    @property
    def flips(self) -> list[Mapping]:
        """The rows whose verdict is not the expected one."""
        return [row for row in self.rows if row["verdict"] != row["expected_verdict"]]

    @property
    def ok(self) -> bool:
        """Whether the run is complete and every verdict the expected one."""
        return self.complete and not self.flips


def check(project: Project, limit: float = LIMIT) -> Run:
    """Execute (at most `limit` seconds per notebook), judge, say what came out, keep the ledger.

    The ledger is kept only when every claim was computed.
    Raises ValueError when the checkout has no notebook, or something is wrong with it that can be
    seen before anything is executed.
    """
    paths = sorted(project.notebooks.glob("*.ipynb"))
    if not paths:
        raise ValueError(f"no notebook in {project.notebooks}; put one there")
    if found := preflight.problems(project):
        _mark_stale(project)
        raise ValueError("nothing was executed, because\n  " + "\n  ".join(found))
    run = judge(project.papers, *execute(paths, limit))
    if run.complete:
        write(project.ledger_file, ledger.dumps(run.rows))
        project.stale_mark.unlink(missing_ok=True)
    else:
        _mark_stale(project)
    report(run)
    return run


def _mark_stale(project: Project) -> None:
    """Say beside the ledger, if there is one, that a later run failed."""
    if project.ledger_file.exists():
        write(project.stale_mark, "A later run failed.\n")


def check_paper(project: Project, paper: ledger.Paper, limit: float = LIMIT) -> Run:
    """Execute the notebooks of one paper and say what came out; the ledger file stays as it is.

    Raises ValueError when one of them is not there.
    """
    paths = [project.notebooks / chapter.notebook for chapter in paper.chapters]
    for path in paths:
        if not path.is_file():
            raise ValueError(f"{paper.key}.toml: its notebook {path} is not there; put it there")
    run = judge([paper], *execute(paths, limit))
    for row in run.rows:
        print(show.line(row))
    report(run)
    return run


def judge(
    papers: Iterable[ledger.Paper],
    notebooks: Mapping[str, nbformat.NotebookNode],
    failures: Sequence[Failure],
    typed: Mapping[str, Sequence[Typed]],
) -> Run:
    """Put the rows that executed notebooks show beside the claims of `papers`.

    A later display overrides an earlier one of the same notebook.  Two notebooks that disagree
    about a claim, and a claim that no paper has, are failures.
    """
    ids = [id for paper in papers for id in paper.claims]
    shown: dict[str, tuple[str, Mapping]] = {}
    failures = list(failures)
    for name, notebook in notebooks.items():
        for row in _rows(notebook):
            id = row["id"]
            if id not in ids:
                failures.append(Failure(name, f"it judges {id}, which is no claim of any paper"))
            elif id in shown and shown[id][0] != name and not _same(shown[id][1], row):
                failures.append(Failure(name, f"it contradicts {shown[id][0]} about {id}"))
            shown[id] = (name, row)
    rows = [shown[id][1] for id in ids if id in shown]
    return Run(notebooks, failures, typed, rows, [id for id in ids if id not in shown])


def _rows(notebook: nbformat.NotebookNode) -> Iterable[Mapping]:
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            yield from output.get("data", {}).get(ledger.MIME, ())


def _same(one: Mapping, other: Mapping) -> bool:
    return one["verdict"] == other["verdict"]


def report(run: Run) -> None:
    """Print what a run came to: failures, claims never computed, flips, counts."""
    for failure in run.failures:
        head = ", ".join(part for part in (failure.notebook, failure.cell) if part)
        print(f"\nFAILED {head}: {plain(failure.what)}")
        if failure.source:
            print("\n".join(f"    {line}" for line in failure.source.splitlines()))
        if failure.detail:
            print(plain(failure.detail).rstrip())
    for id in run.missing:
        print(f"NEVER COMPUTED {id}")
    for row in run.flips:
        print(
            f"FLIPPED {row['id']}: printed {row['printed'] or '-'}, "
            f"ours {show.value(row['computed'])}, verdict {row['verdict']}, "
            f"expected {row['expected_verdict']}{': ' if row['reason'] else ''}{row['reason']}"
        )
    typed = [number for numbers in run.typed.values() for number in numbers]
    wrong = sum(not number.right for number in typed)
    print(f"\n{len(typed)} numbers of the text computed, {wrong} of them wrong")
    print(f"{show.counts(run.rows)}; {len(run.missing)} never computed, {len(run.flips)} flipped")
