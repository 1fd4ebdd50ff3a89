"""Execute every notebook once, judge every claim, keep the ledger of the run."""

from __future__ import annotations

import asyncio
import os
import re
import sys
import tempfile
import time
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

from rcbook import ledger
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


@dataclass
class _Track:
    """How far one notebook has come."""

    name: str
    cells: int
    log: BinaryIO  # the kernel's own stderr, last words included
    at: int = 0
    source: str = ""
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

    Returns the executed notebooks by file name, and the failures.
    Raises ValueError for a file that is no notebook.
    """
    notebooks = {path: read(path) for path in paths}
    with tempfile.TemporaryDirectory(prefix="rcbook-", ignore_cleanup_errors=True) as scratch:
        environment = kernel_environment(Path(scratch))
        failures = asyncio.run(_execute_all(notebooks, limit, environment))
    executed = {path.name: notebook for path, notebook in notebooks.items()}
    return executed, [failure for failure in failures if failure]


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

        async def one(path: Path, notebook: nbformat.NotebookNode) -> Failure | None:
            async with slots:
                return await _execute_one(path, notebook, limit, environment, progress)

        return await asyncio.gather(*(one(*item) for item in notebooks.items()))


async def _execute_one(
    path: Path,
    notebook: nbformat.NotebookNode,
    limit: float,
    environment: Mapping,
    progress: Progress,
) -> Failure | None:
    """Execute `notebook` in place; why it failed, or None.  No kernel is left behind."""
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
    return failure


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
        for index, cell in enumerate(notebook.cells):
            if not _runs(cell):
                continue
            track.at, track.source = track.at + 1, cell.source
            advance()
            await client.async_execute_cell(cell, index, execution_count=track.at)
            if written := _stderr(cell):
                raise _Stopped(written)
    finally:
        if client.kc is not None:
            client.kc.stop_channels()
        if manager.has_kernel:
            await manager.shutdown_kernel(now=True)
        await ensure_async(manager.cleanup_resources())


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
    return Run(notebooks, failures, rows, [id for id in ids if id not in shown])


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
    print(f"\n{counts(run.rows)}; {len(run.missing)} never computed, {len(run.flips)} flipped")


def plain(text: str) -> str:
    """`text`, without colours unless it goes to a terminal."""
    return text if sys.stdout.isatty() else _ANSI.sub("", text)
