"""An executed notebook as the renderer wants it: a chapter of the book."""

from __future__ import annotations

import base64
import copy
import io
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath

import nbformat
from bs4 import BeautifulSoup, Tag
from PIL import Image

from rcbook import ledger
from rcbook.book import data, links, sliders
from rcbook.book.execute import alternative
from rcbook.ledger import show
from rcbook.ledger.marks import without_marks
from rcbook.pictures.sliders import MIME as SLIDERS

LEDGER = "../ledger.html"  # as a chapter sees it
HEAVIER = 2.5  # so many times the weight of its pixels a figure may have as lines
FOLDED = "hide-input"
_WORDS_A_MINUTE = 200  # of a text with formulas


def shown(
    notebook: nbformat.NotebookNode,
    name: str = "",
    terms: Sequence[str] = (),
    functions: Mapping[str, str] | None = None,
) -> nbformat.NotebookNode:
    """A copy of `notebook`, the file `name`, for the renderer.

    Figures are numbered with their captions and the text has its links; it says how long it takes
    to read, has no marks of numbers, and ids in its ledgers lead to the ledger page.
    """
    notebook = nbformat.from_dict(notebook)
    data.link(notebook.cells, PurePosixPath(name).stem)
    notebook.cells[0].source += f"\n\n{reading_time(notebook)}\n"
    texts = [cell for cell in notebook.cells if cell.cell_type == "markdown"]
    written = links.first_uses([without_marks(cell.source) for cell in texts], terms)
    for cell, text in zip(texts, written, strict=True):
        cell.source = links.called(links.numbered(text), functions or {})
    for cell in notebook.cells:
        if alternative(cell):
            cell.metadata["mystnb"]["image"]["alt"] = without_marks(alternative(cell))
        for output in cell.get("outputs", ()):
            _link(output.get("data", {}))
            _lighten(output.get("data", {}))
        if cell.cell_type == "code":
            cell.outputs += _moving(cell)
    notebook.cells = figures(bars(notebook.cells), PurePosixPath(name).stem)
    return notebook


def reading_time(notebook: nbformat.NotebookNode) -> str:
    """How long the text of a notebook takes to read, and how many pictures it has, in words."""
    texts = (without_marks(c.source) for c in notebook.cells if c.cell_type == "markdown")
    minutes = sum(len(text.split()) for text in texts) / _WORDS_A_MINUTE
    pictures = sum(bool(alternative(cell)) for cell in notebook.cells)
    return f"*{max(1, round(minutes))} minutes of reading, {pictures} pictures.*"


def bars(cells: Sequence[nbformat.NotebookNode]) -> list[nbformat.NotebookNode]:
    """The cells with folded code that shows nothing joined to the folded code after it, or before.

    Else a bar that unfolds stands in the page with nothing below it.  What has no such neighbour is
    left to the notebook.
    """
    joined: list[nbformat.NotebookNode] = []
    for cell in cells:
        last = joined[-1] if joined else None
        if last is not None and _folded(last) and _folded(cell):
            if not last.outputs:
                cell.source = f"{last.source}\n\n\n{cell.source}"
                joined.pop()
            elif not cell.outputs:
                last.source += f"\n\n\n{cell.source}"
                continue
        joined.append(cell)
    return [cell for cell in joined if not _folded(cell) or cell.outputs]


def _folded(cell: nbformat.NotebookNode) -> bool:
    return cell.cell_type == "code" and FOLDED in cell.metadata.get("tags", ())


def figures(cells: Sequence[nbformat.NotebookNode], chapter: str) -> list[nbformat.NotebookNode]:
    """The cells with each picture as a figure, whose caption is the paragraph that follows it.

    A caption begins in bold.  A figure that its author has not named is named after its cell.
    """
    kept = []
    for before, cell in zip([None, *cells], cells, strict=False):
        if before is not None and _is_picture(before) and cell.source.startswith("**"):
            caption, _, rest = cell.source.partition("\n\n")
            figure = before.metadata["mystnb"].setdefault("figure", {})
            figure["name"] = data.name(before, chapter)
            figure["caption"] = caption
            cell.source = rest
        if cell.source.strip():
            kept.append(cell)
        if _is_picture(cell):
            kept += _beside(cell)
    return kept


def _beside(cell: nbformat.NotebookNode) -> list[nbformat.NotebookNode]:
    """What a cell shows beside its picture, taken from it into a cell of its own; the renderer
    would make a figure of each."""
    others = [o for o in cell.outputs if not _IMAGES & o.get("data", {}).keys()]
    if not others:
        return []
    cell.outputs = [o for o in cell.outputs if o not in others]
    kept = {"metadata": {"tags": ["remove-input"]}, "outputs": others}
    return [nbformat.v4.new_code_cell("# an empty cell would be skipped, outputs and all", **kept)]


def _is_picture(cell: nbformat.NotebookNode) -> bool:
    shows = (output.get("data", {}) for output in cell.get("outputs", ()))
    return bool(alternative(cell)) and any(_IMAGES & data.keys() for data in shows)


_IMAGES = {"image/png", "image/svg+xml"}


def _link(data: dict) -> None:
    """Show the ledger rows of an output anew, with links to the ledger page, and drop the rows,
    of which the renderer would warn."""
    if rows := data.pop(ledger.MIME, None):
        data["text/html"] = ledger.summary(rows, page=LEDGER)
    if rows := data.pop(ledger.SHOWN, None):
        data["text/html"] = show.folded(rows, page=LEDGER)
    if "text/html" in data:
        data["text/html"] = table(data["text/html"])


def table(html: str) -> str:
    """The HTML of an output, its tables of pandas in the book's own style.

    They get one head, with the names of the index in its corner, a name in every row where pandas
    lets one stand for several, and no attributes, some of which pandas draws by chance.
    """
    if 'id="T_' not in html and 'class="dataframe"' not in html:
        return html
    soup = BeautifulSoup(html, "html.parser")
    for style in soup("style"):
        style.decompose()
    for drawn in soup("table"):
        heads = drawn.thead("tr") if drawn.thead else []
        pairs = [*zip(*(head("th") for head in heads), strict=False)] if len(heads) == 2 else []
        if pairs and not any(above.text.strip() and below.text.strip() for above, below in pairs):
            for above, below in pairs:
                above.string = above.text.strip() or below.text.strip()
            heads[1].decompose()
        for spanning in drawn.select("tbody th[rowspan]"):
            for row in spanning.parent.find_next_siblings("tr", limit=int(spanning["rowspan"]) - 1):
                row.insert(0, copy.copy(spanning))
        for cell in drawn(True):
            cell.attrs = {}
        drawn.attrs = {}
        for head in drawn("th"):
            _set_head(head)
    return str(soup)


def _set_head(head: Tag) -> None:
    """An empty corner heads nothing; a formula in a head is marked for MathJax."""
    text = head.get_text(strip=True)
    if not text:
        head.name = "td"
    elif "$" in text:
        head.clear()
        head.append(BeautifulSoup(show.math(text), "html.parser"))


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
