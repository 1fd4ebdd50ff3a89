"""Execute notebooks, each once and side by side, and evaluate the numbers of their texts."""

from __future__ import annotations

import asyncio
import os
import re
import sys
import tempfile
import time
import warnings
from ast import literal_eval
from collections.abc import Mapping, Sequence
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

from rcbook.ledger import marks

LIMIT = 900.0  # s per notebook; the slowest honest one needs about a sixth on two processors

_ANSI = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")

# Figures as lines and as pixels: the renderer takes what suits each, and writes their numbers,
# which the extension adds.  A date would make two builds of one commit differ.
_FIGURES = """
c.InteractiveShellApp.extensions = ["rcbook.book.kernel"]
c.InlineBackend.figure_formats = {"svg", "png"}
c.InlineBackend.print_figure_kwargs = {"bbox_inches": "tight", "metadata": {"Date": None}}
"""

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
        return marks.same(self.text, self.computed)


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


class _Unanswered(Exception):
    """The kernel did not say what the numbers of a text are."""


class _Stopped(Exception):
    """A cell ended without an error and is a failure all the same."""


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
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # such as cells without ids
            notebook = nbformat.read(path, as_version=4)
            nbformat.validate(notebook)
    except (
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        Warning,
        nbformat.ValidationError,
    ) as e:
        first = (str(e) or type(e).__name__).splitlines()[0]
        raise ValueError(f"{path} is not a notebook: {first}; mend it in Jupyter") from None
    if not notebook.cells:
        raise ValueError(f"{path} is not a notebook: it has no cells")
    if not all("id" in cell for cell in notebook.cells):
        raise ValueError(f"{path} is not a notebook of format 4.5: its cells have no ids")
    return notebook


def kernel_environment(scratch: Path) -> dict[str, str]:
    """The environment of a kernel: this one without the user's own settings, on one thread.

    `scratch` is an empty folder that outlives the kernels.
    """
    environment = {name: value for name, value in os.environ.items() if name not in _LEAKS}
    style = scratch / "matplotlibrc"  # empty, and found before the user's
    style.touch()
    profile = scratch / "ipython" / "profile_default"
    profile.mkdir(parents=True)
    (profile / "ipython_kernel_config.py").write_text(_FIGURES, encoding="utf-8")
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
    asyncio.get_running_loop().set_exception_handler(_quiet_at_the_end)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[cell]}"))
    with Progress(*columns, TimeElapsedColumn(), disable=not sys.stdout.isatty()) as progress:

        async def one(path: Path, notebook: nbformat.NotebookNode):
            async with slots:
                return await _execute_one(path, notebook, limit, environment, progress)

        return await asyncio.gather(*(one(*item) for item in notebooks.items()))


def _quiet_at_the_end(loop: asyncio.AbstractEventLoop, context: dict) -> None:
    """After Ctrl-C a kernel may die before its task is told; that is no news."""
    if "shutdown" not in context["message"]:
        loop.default_exception_handler(context)


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


def to_check(cell: nbformat.NotebookNode) -> list[tuple[str, bool, marks.Number]]:
    """The computed numbers of a cell's text or alternative text: cell id, which, number."""
    texts = [(True, alternative(cell))]
    if cell.cell_type == "markdown":
        texts.append((False, cell.source))
    found = ((alt, number) for alt, text in texts for number in marks.numbers(text))
    return [(cell.id, alt, n) for alt, n in found if n.kind == marks.COMPUTED]


def alternative(cell: nbformat.NotebookNode) -> str:
    """The alternative text of a cell that draws, or nothing."""
    image = figure(cell, "image")
    return image["alt"] if isinstance(image.get("alt"), str) else ""


def figure(cell: nbformat.NotebookNode, part: str = "figure") -> Mapping:
    """What the metadata of a cell say of its picture, as the renderer reads them."""
    settings = cell.metadata.get("mystnb", {})
    found = settings.get(part, {}) if isinstance(settings, Mapping) else {}
    return found if isinstance(found, Mapping) else {}


async def _type(kernel, wanted: Sequence, track: _Track, last: bool) -> list:
    """Evaluate numbers of the text in `kernel` and keep them in `track`.

    Returns those that have to wait for the end of the run, because a name does not exist yet.
    """
    if not wanted:
        return []
    form = "__import__('builtins').format"  # whatever the notebook calls `format`
    asked = {str(i): f"{form}({n.expression}, {n.spec!r})" for i, (*_, n) in enumerate(wanted)}
    settings = {"silent": True, "store_history": False, "user_expressions": asked}
    try:
        reply = await ensure_async(kernel.execute("", reply=True, timeout=60, **settings))
    except (TimeoutError, RuntimeError) as error:
        named = ", ".join(f"{cell}: {{{n.expression}}}" for cell, _, n in wanted)
        raise _Unanswered(f"the numbers of the text are not answered ({named}): {error}") from None
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


def plain(text: str) -> str:
    """`text`, without colours unless it goes to a terminal."""
    return text if sys.stdout.isatty() else _ANSI.sub("", text)
