"""Render the executed notebooks and the pages about their ledger to HTML."""

from __future__ import annotations

import base64
import io
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

import nbformat
from PIL import Image

from rcbook import ledger
from rcbook.book import cost, house, icons, pages, sliders
from rcbook.book.execute import alternative, plain
from rcbook.book.project import Project, read_text
from rcbook.book.run import Run
from rcbook.ledger import show
from rcbook.ledger.marks import without_marks
from rcbook.pictures.sliders import MIME as SLIDERS

LEDGER = "../ledger.html"  # as a chapter sees it
_CORNER = re.compile(r"<th[^>]*>(?:&nbsp;)?</th>")
_WORDS_A_MINUTE = 200  # of a text with formulas
HEAVIER = 2.5  # so many times the weight of its pixels a figure may have as lines
TAIL = 60  # lines of Sphinx's output shown when it fails
_JUPYTER_BOOK = "from jupyter_book.cli.main import main; main()"  # it has no __main__
_OPTIONS = ("-W", "-n", "--keep-going", "-q")


class RenderError(Exception):
    """The book was judged and could not be rendered."""


def render(project: Project, run: Run) -> Path:
    """Render the book of `run` into `project.html` and return its first page.

    Raises RenderError with the tail of the renderer's output; the previous book then stays.
    """
    project.build.mkdir(parents=True, exist_ok=True)
    stage = Path(tempfile.mkdtemp(prefix="stage-", dir=project.build))
    try:
        fill(stage, project, run)
        _sphinx(stage)
        icons.replace(stage / "_build" / "html")
        swap(stage / "_build" / "html", project.html, stage / "previous")
    finally:
        shutil.rmtree(stage, ignore_errors=True)
    return project.html / "index.html"


def fill(stage: Path, project: Project, run: Run) -> None:
    """Put everything the renderer reads into `stage`, an existing folder."""
    ignore = shutil.ignore_patterns("_build")
    shutil.copytree(project.book, stage, ignore=ignore, dirs_exist_ok=True)
    name, cell, png = cover(run.notebooks)
    (stage / "cover.png").write_bytes(png)
    shutil.copy(mathjax(), stage / "assets")
    shutil.copy(bokeh(), stage / "assets")
    (stage / "notebooks").mkdir()
    for name, notebook in run.notebooks.items():
        text = nbformat.writes(shown(notebook))
        (stage / "notebooks" / name).write_text(text, encoding="utf-8")
    written = {page.name: read_text(page) for page in project.book.glob("*.md")}
    made = pages.pages(project.papers, run.rows)
    made["cover.md"] = pages.cover(name, run.notebooks[name].cells[0].source, alternative(cell))
    measured = cost.read(project.book)
    for name, picture in (house.pictures() | cost.pictures(measured)).items():
        (stage / name).write_bytes(picture)
    for name, text in (written | made | house.pages() | cost.pages(measured)).items():
        (stage / name).write_text(without_marks(text), encoding="utf-8")


def cover(
    notebooks: Mapping[str, nbformat.NotebookNode],
) -> tuple[str, nbformat.NotebookNode, bytes]:
    """The PNG that the code cell tagged `cover` shows, after its notebook's name and the cell.

    Raises RenderError when there is none.
    """
    for name, notebook in notebooks.items():
        for cell in notebook.cells:
            if "cover" in cell.metadata.get("tags", ()):
                for output in cell.get("outputs", ()):
                    if png := output.get("data", {}).get("image/png"):
                        return name, cell, base64.b64decode(png)
    raise RenderError("the book has no cover: tag a code cell that shows one PNG with `cover`")


def shown(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """A copy of `notebook` for the renderer: no marks of numbers, how long it takes to read, and
    ids in its ledgers link to the ledger page."""
    notebook = nbformat.from_dict(notebook)
    notebook.cells[0].source += f"\n\n{reading_time(notebook)}\n"
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cell.source = without_marks(cell.source)
        elif alternative(cell):
            cell.metadata["mystnb"]["image"]["alt"] = without_marks(alternative(cell))
        for output in cell.get("outputs", ()):
            _link(output.get("data", {}))
            _lighten(output.get("data", {}))
        if cell.cell_type == "code":
            cell.outputs += _moving(cell)
    return notebook


def reading_time(notebook: nbformat.NotebookNode) -> str:
    """How long the text of a notebook takes to read, and how many pictures it has, in words."""
    texts = (without_marks(c.source) for c in notebook.cells if c.cell_type == "markdown")
    minutes = sum(len(text.split()) for text in texts) / _WORDS_A_MINUTE
    pictures = sum(bool(alternative(cell)) for cell in notebook.cells)
    return f"*{max(1, round(minutes))} minutes of reading, {pictures} pictures.*"


def _link(data: dict) -> None:
    """Show the ledger rows of an output anew, with links to the ledger page, and drop the rows,
    of which the renderer would warn."""
    if rows := data.pop(ledger.MIME, None):
        data["text/html"] = ledger.summary(rows, page=LEDGER)
    if rows := data.pop(ledger.SHOWN, None):
        data["text/html"] = show.folded(rows, page=LEDGER)
    if "text/html" in data:  # the empty corner of a table of pandas heads no column
        data["text/html"] = _CORNER.sub("<td></td>", data["text/html"])


def _lighten(data: dict) -> None:
    """Leave a figure as lines, which are sharp on any screen, or where these are too heavy (maps,
    clouds of points, long runs) as pixels of a palette."""
    if "image/png" not in data:
        return
    packed = palette(base64.b64decode(data.pop("image/png")))
    if not 0 < len(data.get("image/svg+xml", "")) <= HEAVIER * len(packed):
        data.pop("image/svg+xml", None)
        data["image/png"] = base64.b64encode(packed).decode()


def palette(png: bytes) -> bytes:
    """A PNG in the 256 colours that fit it best, with less than half of the weight."""
    picture = Image.open(io.BytesIO(png)).convert("RGBA")
    ground = Image.new("RGBA", picture.size, "white")
    ground.alpha_composite(picture)
    few = ground.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    packed = io.BytesIO()
    few.save(packed, "png", optimize=True)
    return packed.getvalue()


def _moving(cell: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """What moves the pictures with sliders of a cell, each to stand behind its still picture."""
    found = (output.get("data", {}).pop(SLIDERS, None) for output in cell.outputs)
    elements = [sliders.element(data, alternative(cell)) for data in found if data]
    show_html = nbformat.v4.new_output
    return [show_html("display_data", {"text/html": element}) for element in elements]


def mathjax() -> Path:
    """The one self-contained MathJax file of the package that vendors it."""
    return _vendored("sphinx-mathjax-offline", "tex-svg-full.js")


def bokeh() -> Path:
    """The one script of Bokeh that draws; the page has sliders of its own."""
    return _vendored("bokeh", "bokeh.min.js")


def _vendored(package: str, name: str) -> Path:
    for file in metadata.files(package) or ():
        if file.name == name:
            return Path(file.locate())
    raise RenderError(f"{package} holds no {name}; install environment.txt")


def _sphinx(stage: Path) -> None:
    command = [sys.executable, "-c", _JUPYTER_BOOK, "build", str(stage), *_OPTIONS]
    done = subprocess.run(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        errors="replace",
    )
    if done.returncode or not (stage / "_build" / "html" / "index.html").is_file():
        tail = "\n".join(plain(done.stdout).splitlines()[-TAIL:])
        raise RenderError(f"{tail}\nthe book could not be rendered; its output is above")


def swap(new: Path, target: Path, aside: Path) -> None:
    """Put the folder `new` in the place of `target`, which goes to `aside`; all or nothing."""
    try:
        if target.exists():
            target.rename(aside)
        new.rename(target)
    except BaseException:  # also Ctrl-C between the two
        if aside.exists() and not target.exists():
            aside.rename(target)
        raise
