"""Execute every notebook once, judge every claim, keep the ledger of the run."""

from __future__ import annotations

import asyncio
import os
import re
import sys
import tempfile
import time
from ast import literal_eval
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import matplotlib.font_manager  # noqa: F401  fills the font cache, once; kernels would warn
import nbformat
from jupyter_client import AsyncKernelManager
from jupyter_client.kernelspec import KernelSpecManager
from jupyter_core.utils import ensure_async
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, DeadKernelError
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from rcbook import ledger, prose
from rcbook.pages import counts
from rcbook.project import Project

LIMIT = 900.0  # s per notebook; the slowest honest one needs about a sixth on two processors

_ANSI = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")
# What a user's own set-up could leak into a kernel, and so into the verdicts.
_LEAKS = ("MPLBACKEND", "MPLSTYLE", "PYTHONSTARTUP", "PYTHONWARNINGS", "PYTHONPATH")


@dataclass(frozen=True)
class Failure:
    """Why a notebook did not come to its end, and in which of its code cells."""

    notebook: str
    what: str
    cell: str = ""  # such as "code cell 3 of 12"
    source: str = ""
    detail: str = ""  # the traceback, or what was written to stderr


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


@dataclass(frozen=True)
class Typed:
    """A number of a notebook's text beside what the run computes for it."""

    cell: str  # its id
    alt: bool  # whether it stands in the alternative text of the cell and not in its source
    start: int  # where it begins in that text
    text: str
    expression: str
    computed: str  # formatted; empty where the expression failed
    trouble: str = ""

    @property
    def right(self) -> bool:
        return prose.same(self.text, self.computed)


@dataclass
class _Track:
    """How far one notebook has come."""

    name: str
    cells: int
    log: BinaryIO  # the kernel's own stderr, last words included
    at: int = 0
    source: str = ""
    typed: list[Typed] = field(default_factory=list)  # the numbers of the text, evaluated
    began: float = field(default_factory=time.monotonic)

    def last_words(self) -> str:
        self.log.seek(0)
        return self.log.read().decode(errors="replace")[-4000:]

    def failure(self, what: str, detail: str = "") -> Failure:
        where = f"code cell {self.at} of {self.cells}" if self.at else ""
        return Failure(self.name, what, where, self.source, detail)


class _Stopped(Exception):
    """A cell ended without an error and is a failure all the same."""


def check(project: Project, limit: float = LIMIT) -> Run:
    """Execute (at most `limit` seconds per notebook), judge, say what came out, keep the ledger.

    The ledger is kept only when every claim was computed.
    Raises ValueError when the checkout has no notebook.
    """
    paths = sorted(project.notebooks.glob("*.ipynb"))
    if not paths:
        raise ValueError(f"no notebook in {project.notebooks}; put one there")
    run = judge(project.papers, *execute(paths, limit))
    if run.complete:
        write(project.ledger_file, ledger.dumps(run.rows))
    report(run)
    return run


def write(path: Path, text: str) -> None:
    """Put `text` into `path` whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}-{os.getpid()}")
    try:
        beside.write_text(text, encoding="utf-8", newline="\n")
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def execute(paths: Sequence[Path], limit: float = LIMIT):
    """Execute notebooks side by side, at most `limit` seconds each.

    Returns the executed notebooks by file name, the failures, and the numbers of their texts by
    file name.  A number that is not what the run computes is a failure.
    Raises ValueError for a file that is no notebook.
    """
    notebooks = {path: read(path) for path in paths}
    with tempfile.TemporaryDirectory(prefix="rcbook-", ignore_cleanup_errors=True) as scratch:
        environment = kernel_environment(Path(scratch))
        done = asyncio.run(_execute_all(notebooks, limit, environment))
    executed = {path.name: notebook for path, notebook in notebooks.items()}
    typed = {path.name: numbers for path, (_, numbers) in zip(notebooks, done, strict=True)}
    failures = [failure for failure, _ in done if failure]
    failures += [_mistyped(name, n) for name, found in typed.items() for n in found if not n.right]
    return executed, failures, typed


def _mistyped(name: str, number: Typed) -> Failure:
    where = f"cell {number.cell}{', alternative text' if number.alt else ''}"
    if number.trouble:
        return Failure(name, f"{{{number.expression}}} failed: {number.trouble}", where)
    what = f"the text says {number.text}, and {{{number.expression}}} is {number.computed}"
    return Failure(name, f"{what}; mend it by `rcbook numbers --rewrite`", where)


def read(path: Path) -> nbformat.NotebookNode:
    """The notebook in `path`.  Raises ValueError when it is none."""
    try:
        return nbformat.read(path, as_version=4)
    except (nbformat.reader.NotJSONError, nbformat.ValidationError, AttributeError) as error:
        raise ValueError(f"{path} is not a notebook: {str(error).splitlines()[0]}") from None


def kernel_environment(scratch: Path) -> dict[str, str]:
    """The environment of a kernel: this one without the user's own settings, on one thread.

    `scratch` is an empty folder that outlives the kernels.
    """
    environment = {name: value for name, value in os.environ.items() if name not in _LEAKS}
    style = scratch / "matplotlibrc"  # empty, and found before the user's
    style.touch()
    # Notebooks run side by side already; and sums on one thread have one order.
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
    environment |= threads | {
        "IPYTHONDIR": str(scratch / "ipython"),
        "MATPLOTLIBRC": str(style),
        "PYTHONHASHSEED": "0",
        "PYDEVD_DISABLE_FILE_VALIDATION": "1",
    }
    return environment


async def _execute_all(notebooks: Mapping, limit: float, environment: Mapping) -> list:
    # More than there are processors, so that a long notebook at the end does not run by itself.
    slots = asyncio.Semaphore(2 * (os.cpu_count() or 1))
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[cell]}"))
    with Progress(*columns, TimeElapsedColumn(), disable=not sys.stdout.isatty()) as progress:

        async def one(path: Path, notebook: nbformat.NotebookNode):
            async with slots:
                return await _execute_one(path, notebook, limit, environment, progress)

        return await asyncio.gather(*(one(*item) for item in notebooks.items()))


async def _execute_one(
    path: Path,
    notebook: nbformat.NotebookNode,
    limit: float,
    environment: Mapping,
    progress: Progress,
) -> tuple[Failure | None, list[Typed]]:
    """Execute `notebook` in place; why it failed, or None, and the numbers of its text.

    No kernel is left behind.
    """
    cells = sum(_runs(cell) for cell in notebook.cells)
    line = progress.add_task(path.name, total=cells, cell="starting")
    _say(progress, f"{path.name}: executing {cells} code cells")

    def advance() -> None:
        progress.update(line, completed=track.at - 1, cell=f"cell {track.at} of {cells}")

    with tempfile.TemporaryFile() as log:
        track = _Track(path.name, cells, log)
        task = asyncio.create_task(_run_cells(notebook, path.parent, environment, track, advance))
        try:
            await asyncio.wait({task}, timeout=limit)
            failure = _failure(task, track, limit)
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)  # its kernel is gone after this
    seconds = time.monotonic() - track.began
    progress.update(line, completed=track.at, cell="FAILED" if failure else "done")
    _say(progress, f"{path.name}: {'FAILED' if failure else 'done'} after {seconds:.1f} s")
    return failure, track.typed


def _failure(task: asyncio.Task, track: _Track, limit: float) -> Failure | None:
    if not task.done():
        return track.failure(f"still running after {limit:g} s")
    error = task.exception()
    if error is None:
        return None
    if isinstance(error, CellExecutionError):
        return track.failure(f"{error.ename}: {error.evalue}", error.traceback)
    if isinstance(error, DeadKernelError):
        return track.failure("its kernel died", track.last_words())
    if isinstance(error, _Stopped):
        return track.failure("it wrote to stderr, and warnings are errors here", str(error))
    return track.failure(f"{type(error).__name__}: {error}")


async def _run_cells(notebook, folder: Path, environment: Mapping, track: _Track, advance):
    # No kernel folder is searched: what remains is the kernel of this very interpreter.
    specs = KernelSpecManager(kernel_dirs=[])
    manager = AsyncKernelManager(kernel_name="python3", kernel_spec_manager=specs)
    # async_execute would put signal handlers of its own on the loop and, with notebooks side by
    # side, take them off too early; cells one by one leave Ctrl-C to asyncio.run.
    client = NotebookClient(notebook, km=manager, timeout=None, coalesce_streams=True)
    try:
        settings = {"cwd": str(folder), "env": dict(environment), "stderr": track.log}
        await client.async_start_new_kernel(**settings)
        await client.async_start_new_kernel_client()
        reply = await client.kc.kernel_info(reply=True, timeout=60)
        notebook.metadata["language_info"] = reply["content"]["language_info"]
        waiting = []
        for index, cell in enumerate(notebook.cells):
            if _runs(cell):
                track.at, track.source = track.at + 1, cell.source
                advance()
                await client.async_execute_cell(cell, index, execution_count=track.at)
                if written := _stderr(cell):
                    raise _Stopped(written)
            waiting += await _type(client.kc, to_check(cell), track, last=False)
        await _type(client.kc, waiting, track, last=True)
    finally:
        if client.kc is not None:
            client.kc.stop_channels()
        if manager.has_kernel:
            await manager.shutdown_kernel(now=True)
        await ensure_async(manager.cleanup_resources())


def to_check(cell: nbformat.NotebookNode) -> list[tuple[str, bool, prose.Number]]:
    """The computed numbers of a cell's text or alternative text: cell id, which, number."""
    texts = [(True, alternative(cell))]
    if cell.cell_type == "markdown":
        texts.append((False, cell.source))
    found = ((alt, number) for alt, text in texts for number in prose.numbers(text))
    return [(cell.id, alt, n) for alt, n in found if n.kind == prose.COMPUTED]


def alternative(cell: nbformat.NotebookNode) -> str:
    """The alternative text of a cell that draws, or nothing."""
    return cell.metadata.get("mystnb", {}).get("image", {}).get("alt", "")


async def _type(kernel, wanted: Sequence, track: _Track, last: bool) -> list:
    """Evaluate numbers of the text in `kernel` and keep them in `track`.

    Returns those that have to wait for the end of the run, because a name does not exist yet.
    """
    if not wanted:
        return []
    asked = {str(i): f"format({n.expression}, {n.spec!r})" for i, (*_, n) in enumerate(wanted)}
    settings = {"silent": True, "store_history": False, "user_expressions": asked}
    reply = await ensure_async(kernel.execute("", reply=True, timeout=60, **settings))
    waiting = []
    for i, (cell, alt, number) in enumerate(wanted):
        result = reply["content"]["user_expressions"][str(i)]
        if result["status"] != "ok" and result["ename"] == "NameError" and not last:
            waiting.append((cell, alt, number))
            continue
        value = literal_eval(result["data"]["text/plain"]) if result["status"] == "ok" else ""
        trouble = "" if value else f"{result.get('ename')}: {result.get('evalue')}"
        given = (number.start, number.text, number.expression, value, trouble)
        track.typed.append(Typed(cell, alt, *given))
    return waiting


def _runs(cell: nbformat.NotebookNode) -> bool:
    return cell.cell_type == "code" and bool(cell.source.strip())


def _stderr(cell: nbformat.NotebookNode) -> str:
    return "".join(output.text for output in cell.outputs if output.get("name") == "stderr")


def _say(progress: Progress, line: str) -> None:
    if progress.disable:  # not a terminal: no bars, so plain lines
        print(line, flush=True)


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
            f"ours {ledger.show_value(row['computed'])}, verdict {row['verdict']}, "
            f"expected {row['expected_verdict']}{': ' if row['reason'] else ''}{row['reason']}"
        )
    typed = [number for numbers in run.typed.values() for number in numbers]
    wrong = sum(not number.right for number in typed)
    print(f"\n{len(typed)} numbers of the text computed, {wrong} of them wrong")
    print(f"{counts(run.rows)}; {len(run.missing)} never computed, {len(run.flips)} flipped")


def plain(text: str) -> str:
    """`text`, without colours unless it goes to a terminal."""
    return text if sys.stdout.isatty() else _ANSI.sub("", text)
