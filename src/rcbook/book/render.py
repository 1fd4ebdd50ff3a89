"""Render the executed notebooks and the pages about their ledger to HTML."""

from __future__ import annotations

import base64
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

import nbformat

from rcbook.book import chapter, cost, data, house, icons, links, pages, rerun, search
from rcbook.book.execute import alternative, plain
from rcbook.book.project import Project, read_text
from rcbook.book.run import Run
from rcbook.ledger.marks import without_marks

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
        data.write(stage / "_build" / "html", run.notebooks)
        search.summarise(stage / "_build" / "html")
        swap(stage / "_build" / "html", project.html, stage / "previous")
    finally:
        shutil.rmtree(stage, ignore_errors=True)
    return project.html / "index.html"


def fill(stage: Path, project: Project, run: Run) -> None:
    """Put everything the renderer reads into `stage`, an existing folder."""
    ignore = shutil.ignore_patterns("_build")
    shutil.copytree(project.book, stage, ignore=ignore, dirs_exist_ok=True)
    source, cell, png = cover(run.notebooks)
    (stage / "cover.png").write_bytes(png)
    shutil.copy(mathjax(), stage / "assets")
    shutil.copy(bokeh(), stage / "assets")
    for folder in ("notebooks", "downloads"):
        (stage / folder).mkdir()
    repository = rerun.repository(project.book)
    terms = links.terms(read_text(project.book / "glossary.md"))
    functions = links.functions()
    for name, notebook in run.notebooks.items():
        shown = chapter.shown(notebook, name, terms, functions)
        shown.cells.append(nbformat.v4.new_markdown_cell(rerun.section(name, repository)))
        (stage / "notebooks" / name).write_text(nbformat.writes(shown), encoding="utf-8")
        shutil.copy(project.notebooks / name, stage / "downloads")
    written = {page.name: read_text(page) for page in project.book.glob("*.md")}
    made = pages.pages(project.papers, run.rows)
    title = run.notebooks[source].cells[0].source
    made["cover.md"] = pages.cover(source, title, alternative(cell))
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
