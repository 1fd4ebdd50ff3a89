"""The whole book as one PDF, printed by an installed browser from the rendered book."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Error, Page, sync_playwright

from rcbook.book import onepage
from rcbook.book.project import Project
from rcbook.book.render import RenderError

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
PATIENCE = 300_000  # ms, for the formulas of the whole book
# Of A4 with these margins (mm) a page shows 174 mm, which are so many pixels of the browser.
_MARGINS = {"top": "18mm", "bottom": "20mm", "left": "18mm", "right": "18mm"}
WIDTH = round(174 / 25.4 * 96)
_FOOT = (
    '<div style="width: 100%; font: 8pt sans-serif; text-align: center">'
    '<span class="pageNumber"></span></div>'
)
# A formula or table that is wider than the page is made smaller until it fits.
_FIT = """() => {
  for (const box of document.querySelectorAll("mjx-container[display], div.math, table")) {
    const inner = box.querySelector("svg") ?? box;
    const room = box.parentElement.clientWidth, taken = Math.max(inner.scrollWidth,
      inner.getBoundingClientRect().width);
    if (taken > room + 1) box.style.fontSize = `${Math.floor(97 * room / taken)}%`;
  }
}"""


def is_old(project: Project) -> bool:
    """Whether there is no rendered book, or something that it is made of is newer."""
    page = project.html / "index.html"
    if not page.is_file() or project.stale_mark.exists():
        return True
    made = page.stat().st_mtime
    return any(path.stat().st_mtime > made for path in _sources(project))


def _sources(project: Project) -> Iterable[Path]:
    for folder in (project.notebooks, project.book, Path(__file__).parents[1]):
        for path in folder.rglob("*"):
            built = project.build in path.parents or "__pycache__" in path.parts
            if path.is_file() and not built:
                yield path


def browser() -> str:
    """The path of an installed browser.  Raises RenderError when there is none."""
    for name in BROWSERS:
        if path := shutil.which(name):
            return path
    raise RenderError(f"no browser to print with; install one of {', '.join(BROWSERS)}")


def make(project: Project, browser: str) -> Path:
    """Print the rendered book of `project` to its build folder, whole or not at all.

    Raises RenderError when the browser fails; an earlier PDF then stays.
    """
    target = project.build / "rcbook.pdf"
    with tempfile.TemporaryDirectory(prefix="pdf-", dir=project.build) as folder:
        try:
            os.replace(_printed(browser, Path(folder), project.html), target)
        except Error as error:
            raise RenderError(f"{error}\nthe book could not be printed by {browser}") from None
    return target


def _printed(browser: str, folder: Path, book: Path) -> Path:
    """The PDF in `folder`: printed once to see where chapters begin, and again with their pages."""
    source, printed = folder / "book.html", folder / "book.pdf"
    names = [place.id for place in onepage.contents(book)]
    begins: dict[str, int] = {}
    with sheet(browser) as page:
        for _ in range(2):
            source.write_text(onepage.write(book, begins), encoding="utf-8")
            show(page, source)
            _print(page, printed)
            begins = chapter_pages(printed.read_bytes(), names)
    return printed


@contextmanager
def sheet(browser: str) -> Iterator[Page]:
    """A tab of `browser` that is as wide as the print and asks no other host for anything."""
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=browser)
        page = chromium.new_page(viewport={"width": WIDTH, "height": 1000}, color_scheme="light")
        page.route(re.compile("^(https?|wss?):"), lambda route: route.abort())
        page.emulate_media(media="print")
        page.set_default_timeout(PATIENCE)
        yield page
        chromium.close()


def show(page: Page, source: Path) -> None:
    """Open `source`, typeset and with all its pictures, nothing of it wider than the page."""
    page.goto(source.as_uri(), timeout=PATIENCE)
    page.evaluate("window.MathJax?.startup?.promise")
    page.evaluate("Promise.all([...document.images].map(image => image.decode()))")
    page.evaluate(_FIT)


def _print(page: Page, target: Path) -> None:
    page.pdf(
        path=target,
        format="A4",
        margin=_MARGINS,
        print_background=True,
        display_header_footer=True,
        header_template="<span></span>",
        footer_template=_FOOT,
        outline=True,
        tagged=True,
    )


def chapter_pages(pdf: bytes, names: Iterable[str]) -> dict[str, int]:
    """On which page of a PDF as Chromium writes it each of the links `names` leads.

    Its objects that say so are plain text.
    """
    inner = dict(_INNER.findall(pdf))
    root = next(iter(_ROOT.findall(pdf)), b"")
    order = {number: i for i, number in enumerate(_leaves(root, inner), 1)}
    found = {}
    for name in names:
        place = re.search(rb"/%s \[(\d+) 0 R /XYZ" % re.escape(name.encode()), pdf)
        if place and place[1] in order:
            found[name] = order[place[1]]
    return found


_INNER = re.compile(rb"\n(\d+) 0 obj\n<</Type /Pages\n[^>]*?/Kids \[([^\]]*)\]")
_ROOT = re.compile(rb"/Type /Catalog\n/Pages (\d+) 0 R")


def _leaves(node: bytes, inner: Mapping[bytes, bytes]) -> Iterable[bytes]:
    """The pages below a node of the tree of pages, in order."""
    if node not in inner:
        return [node]
    children = re.findall(rb"(\d+) 0 R", inner[node])
    return [leaf for child in children for leaf in _leaves(child, inner)]
