"""The numbers behind each figure of a chapter, as files beside the book, and the links to them."""

from __future__ import annotations

import csv
import io
import re
import zipfile
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path, PurePosixPath

import nbformat

from rcbook.book.execute import figure
from rcbook.ledger import show
from rcbook.ledger.marks import without_marks
from rcbook.pictures.sliders import MIME as SLIDERS

CSV = "text/csv"
FOLDER = "data"  # of the book
HEAVY = 1_000_000  # bytes, from which on a file is packed; names that repeat pack well
_TITLE = re.compile(r"\*\*(.+?)\*\*", re.DOTALL)


def name(cell: nbformat.NotebookNode, chapter: str) -> str:
    """The name of the figure that a cell draws: its author's, or one made of the cell's id."""
    return figure(cell).get("name") or f"fig-{chapter}-{cell.get('id', '')}"


def link(cells: Sequence[nbformat.NotebookNode], chapter: str) -> None:
    """Put links to the numbers of its figures beside what each cell shows, in place of these."""
    for cell, after in zip(cells, [*cells[1:], None], strict=True):
        titled = _TITLE.match(without_marks(after.source)) if after is not None else None
        title = titled[1] if titled else ""
        files = _files(cell, chapter)
        for output in cell.get("outputs", ()):
            output.get("data", {}).pop(CSV, None)
        for file in files:
            text = _link(f"../{FOLDER}/{chapter}/{file}", title)
            cell.outputs.append(nbformat.v4.new_output("display_data", {"text/html": text}))


def write(html_folder: Path, notebooks: Mapping[str, nbformat.NotebookNode]) -> None:
    """Write the numbers of the figures of executed notebooks into the book at `html_folder`."""
    for notebook_name, notebook in notebooks.items():
        chapter = PurePosixPath(notebook_name).stem
        folder = html_folder / FOLDER / chapter
        for cell in notebook.cells:
            for file, content in _files(cell, chapter).items():
                folder.mkdir(parents=True, exist_ok=True)
                (folder / file).write_bytes(content)


def _files(cell: nbformat.NotebookNode, chapter: str) -> dict[str, bytes]:
    """The numbers of each figure that a cell shows, by the name of their file."""
    shown = [output.get("data", {}) for output in cell.get("outputs", ())]
    found = [_moving(d[SLIDERS]) if SLIDERS in d else d.get(CSV) for d in shown]
    called = name(cell, chapter)
    texts = [text.encode() for text in found if text]
    names = [f"{called}{f'-{i}' * bool(i)}.csv" for i in range(len(texts))]
    return dict(map(_packed, names, texts))


def _packed(file: str, content: bytes) -> tuple[str, bytes]:
    """A file as it is, or in an archive of its own, which any system and pandas open."""
    if len(content) < HEAVY:
        return file, content
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo(file), content, zipfile.ZIP_DEFLATED)  # without a date
    return f"{file}.zip", packed.getvalue()


def _moving(data: Mapping) -> str:
    """The curves of a picture with sliders at all its settings, a column for each slider."""
    axes, sliders = data["axes"], data["sliders"]
    labels = (" ".join(axes[key].split()) for key in ("xlabel", "ylabel"))
    x_name, y_name = labels
    written = io.StringIO()
    sheet = csv.writer(written, lineterminator="\n")
    sheet.writerow([*(s["label"] for s in sliders), "series", "x_name", "y_name", "x", "y"])
    settings = product(*(slider["settings"] for slider in sliders))
    for setting, frame in zip(settings, data["frames"], strict=True):
        for curve, places in zip(data["curves"], frame, strict=True):
            head = (*setting, " ".join(curve["label"].split()), x_name, y_name)
            x, y = (data["vectors"][place] for place in places)
            sheet.writerows((*head, *point) for point in zip(x, y, strict=True))
    return written.getvalue()


def _link(address: str, title: str) -> str:
    """A link that says to all readers what it gives, and to those who do not see also of what."""
    of = f'<span class="visually-hidden"> of {show.math(title)}</span>' if title else ""
    packed = ", packed" * address.endswith(".zip")
    return f'<p class="rcbook-data"><a href="{address}" download>Data (CSV{packed}){of}</a></p>'
