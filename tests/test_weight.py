"""Pages are light: figures weigh little, icons are those that are used, and the sum is bounded."""

import base64
import io
import re

import nbformat
import numpy as np
import pytest
from PIL import Image

from rcbook.book import chapter, icons, render

BOUND = 3_000_000  # bytes
MATHJAX = "tex-svg-full.js"


def png(pixels) -> bytes:
    packed = io.BytesIO()
    Image.fromarray(pixels).save(packed, "png")
    return packed.getvalue()


def shown(lines: str, pixels: bytes) -> dict:
    """What the renderer is left of a figure in both forms."""
    data = {"image/svg+xml": lines, "image/png": base64.b64encode(pixels).decode()}
    output = nbformat.v4.new_output("display_data", data)
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(outputs=[output])])
    return chapter.shown(notebook).cells[0].outputs[0]["data"]


NOISE = png(np.random.default_rng(1).integers(0, 255, (60, 80, 3), dtype=np.uint8))


def test_a_figure_is_shown_as_lines_unless_they_are_too_heavy():
    bound = int(chapter.HEAVIER * len(chapter.palette(NOISE)))
    assert set(shown("x" * bound, NOISE)) == {"image/svg+xml"}
    assert set(shown("x" * (bound + 1), NOISE)) == {"image/png"}


def test_a_palette_is_lighter_and_moves_no_pixel_far():
    tone = np.linspace(0, 255, 200).astype(np.uint8)
    before = np.stack(
        [np.tile(tone, (100, 1)), np.full((100, 200), 40), np.tile(tone[::-1], (100, 1))]
    )
    before = np.moveaxis(before, 0, -1).astype(np.uint8)
    packed = chapter.palette(png(before))
    after = np.asarray(Image.open(io.BytesIO(packed)).convert("RGB"))
    assert np.abs(after.astype(int) - before).max() <= 4
    assert len(chapter.palette(NOISE)) < 0.5 * len(NOISE)


def test_what_is_transparent_lies_on_white():
    clear = chapter.palette(png(np.zeros((4, 4, 4), np.uint8)))
    assert Image.open(io.BytesIO(clear)).convert("RGB").getpixel((1, 1)) == (255, 255, 255)


SCRIPT = 'x={bars:[448,512,["navicon"],"f0c9","M0 96z"],"arrow-up":[384,512,[8593],"f062","M1 2z"]}'


def test_icons_get_the_outline_and_the_width_that_the_script_has():
    sheet = icons.style_sheet(SCRIPT, ["bars", "arrow-up"])
    assert ".fa-arrow-up { --wide: 0.75;" in sheet
    assert "viewBox='0 0 448 512'%3E%3Cpath d='M0 96z'/" in sheet
    with pytest.raises(ValueError, match="icons have no sun; take another"):
        icons.style_sheet(SCRIPT, ["sun"])


# ---- the book ----


def parts(page) -> dict[str, int]:
    """What a page loads as it opens, in bytes by file; MathJax, which all share, is left out."""
    text = page.read_text(encoding="utf-8")
    tags = re.findall(r"<(?:script|link|img)\b[^>]*>", text)
    names = (
        re.search(r'(?:src|href)="([^"?#:]+)["?#]', tag) for tag in tags if "canonical" not in tag
    )
    files = {(page.parent / name[1]).resolve() for name in names if name}
    files = {file for file in files if file.suffix in {".js", ".css", ".png", ".svg"}}
    sizes = {file.name: file.stat().st_size for file in files if file.name != MATHJAX}
    return {page.name: len(text.encode()), **sizes}


def test_no_page_weighs_more_than_three_megabytes(built):
    """As it opens, with the theme; and with Bokeh but without what all pages share."""
    html = built / "book" / "_build" / "html"
    pages = [page for page in html.rglob("*.html") if page.relative_to(html).parts[0] != "_static"]
    theme = set(parts(html / "search.html"))
    assert len(pages) > 10
    for page in pages:
        sizes = parts(page)
        assert len(sizes) > 5, page
        assert sum(sizes.values()) <= BOUND, (page, sizes)
        own = sum(size for name, size in sizes.items() if name not in theme)
        moves = "rcbook-sliders" in page.read_text(encoding="utf-8")
        assert own + moves * render.bokeh().stat().st_size <= BOUND, (page, sizes)


def test_every_icon_of_a_page_has_its_rule(built):
    html = built / "book" / "_build" / "html"
    sheet = (html / "_static" / "icons.css").read_text(encoding="utf-8")
    text = (html / "index.html").read_text(encoding="utf-8")
    used = set(re.findall(r"\bfa-([a-z-]+)", text)) - {"solid", "lg"}
    assert {"bars", "magnifying-glass", "moon"} <= used
    assert all(f".fa-{name} {{" in sheet for name in used)
    assert "fontawesome.js" not in text
