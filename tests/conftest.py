"""Tiny projects to break, and the real book, built once for all tests that look at it."""

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import nbformat
import pytest
from playwright.sync_api import sync_playwright

from rcbook.book import pdf
from rcbook.book.project import Project
from rcbook.book.render import RenderError
from rcbook.ledger import show

ROOT = Path(__file__).parents[1]

# No sandbox: continuous integration runs as root.  The others keep the browser itself quiet.
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]

FAKE_PAPER = """
from rcbook.ledger import Claim, Ledger, Paper

CLAIMS = (
    Claim("fake.x", "fake", "eq. 1", "number", "The gain $k$ < 3.", "2.0", "N", "reproduced"),
    Claim("fake.y", "fake", "eq. 2", "number", "A pole.", "0.5", "1", "reproduced with correction",
          erratum="eq2", reason="plain reading gives {value}"),
    Claim("fake.z", "fake", "fig. 3", "measurement", "A force.", "", "N", "not computable",
          reason="measured"),
)
ERRATA = {
    "eq2": {"where": "eq. 2", "printed": "$p$", "corrected": "$-p$", "why": "a sign"},
    "pen": {"where": "p. 3", "printed": "runnout", "corrected": "runout", "why": "spelling"},
}
PAPER = Paper("fake", "The case one", "Nobody, Nowhere, 1989.", "one.ipynb", 1,
              {"cite": "francis1976", "loop": "a loop", "index": "time", "period": "a turn"},
              {"primary": {"title": "The plain reading", "text": "as printed"}}, ERRATA, {},
              {claim.id: claim for claim in CLAIMS})
ledger = Ledger(PAPER)
"""
LEDGER = """from fake_paper import ledger
ledger.check("fake.x", 2.01)
ledger.check("fake.y", -0.5, 0.5)
ledger.check("fake.z")
ledger"""
COVER = "import matplotlib.pyplot as plt\nplt.plot([1, 4, 9])\nplt.show()"


def write_notebook(path: Path, cells: list[str]) -> None:
    """A notebook of a title and code cells; the cell that plots is the cover."""
    code = [nbformat.v4.new_code_cell(source) for source in cells]
    for cell in code:
        if "plt.show" in cell.source:
            cell.metadata.update(tags=["cover"], mystnb={"image": {"alt": "a curve"}})
    title = nbformat.v4.new_markdown_cell(f"# The case {path.stem}\n\nWith $x^2$.")
    nbformat.write(nbformat.v4.new_notebook(cells=[title, *code]), path)


@pytest.fixture
def make(tmp_path):
    """Makes a project of the given notebooks, each a list of code cells, with one fake paper."""

    def make(**notebooks: list[str]) -> Project:
        folder = tmp_path / "notebooks"
        folder.mkdir()
        source = folder / "fake_paper.py"
        source.write_text(FAKE_PAPER, encoding="utf-8")
        spec = importlib.util.spec_from_file_location("fake_paper", source)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        for name, cells in notebooks.items():
            write_notebook(folder / f"{name}.ipynb", cells)
        ignore = shutil.ignore_patterns("_build")
        shutil.copytree(ROOT / "book", tmp_path / "book", ignore=ignore)
        contents = tmp_path / "book" / "_toc.yml"
        files = r"    chapters:\n(?:      - file: notebooks/.*\n)+"
        parts = rf"(  - caption: .*\n(?:    numbered: .*\n)?{files})+"
        one = "  - caption: Chapters\n    chapters:\n      - glob: notebooks/*\n"
        contents.write_text(re.sub(parts, one, contents.read_text("utf-8")), encoding="utf-8")
        landing = tmp_path / "book" / "index.md"  # without links to chapters that are not here
        unlinked = re.sub(r"\[([^]]+)\]\(notebooks/[^)]+\)", r"\1", landing.read_text("utf-8"))
        landing.write_text(unlinked, encoding="utf-8")
        return Project(tmp_path, (module.PAPER,))

    return make


def alive(pid: int, patience: float = 5.0) -> bool:
    """Whether process `pid` is still there after at most `patience` seconds."""
    for _ in range(round(patience / 0.1)):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return False
        time.sleep(0.1)
    return True


@pytest.fixture(scope="session")
def built(tmp_path_factory) -> Path:
    """A copy of the project in which `rcbook build` has run: every notebook, every claim."""
    root = tmp_path_factory.mktemp("project")
    for folder in ("notebooks", "book"):
        ignore = shutil.ignore_patterns("_build", ".ipynb_checkpoints")
        shutil.copytree(ROOT / folder, root / folder, ignore=ignore)
    command = [sys.executable, "-m", "rcbook.cli", "build"]
    done = subprocess.run(command, cwd=root, text=True, capture_output=True, encoding="utf-8")
    assert done.returncode == 0, done.stdout + done.stderr
    return root


@pytest.fixture(scope="session")
def rows(built, request) -> list[dict]:
    """The ledger of the built book."""
    rows = json.loads((built / "book" / "_build" / "ledger.json").read_text(encoding="utf-8"))
    request.config.stash[_COUNTS] = show.counts(rows)
    return rows


@pytest.fixture(scope="module")
def browser():
    """A browser that is installed already; none is ever downloaded."""
    try:
        found = pdf.browser()
    except RenderError as error:
        pytest.skip(str(error))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture
def visit(browser, built):
    """Opens a page of the book; requests to other hosts and errors are collected and refused."""
    contexts, trouble = [], []

    def visit(page: str, width: int = 1400, scheme: str = "light"):
        context = browser.new_context(
            viewport={"width": width, "height": 900},
            color_scheme=scheme,
            reduced_motion="reduce",  # colours halfway between two states are no colours of ours
        )
        contexts.append(context)
        context.route(re.compile("^(https?|wss?):"), lambda route: refuse(route))
        tab = context.new_page()
        tab.on("console", lambda m: m.type == "error" and trouble.append(f"{page}: {m.text}"))
        tab.on("pageerror", lambda error: trouble.append(f"{page}: {error}"))
        tab.goto((built / "book" / "_build" / "html").as_uri() + "/" + page)
        tab.wait_for_function("window.MathJax?.startup ? true : !window.MathJax")
        tab.evaluate("window.MathJax?.startup?.promise")
        return tab

    def refuse(route):
        trouble.append(f"asks {route.request.url}")
        route.abort()

    yield visit
    for context in contexts:
        context.close()
    assert not trouble


_COUNTS = pytest.StashKey[str]()


def pytest_terminal_summary(terminalreporter, config):
    """Print how many claims were judged."""
    if counts := config.stash.get(_COUNTS, ""):
        terminalreporter.write_line(f"ledger of this run: {counts}")
