"""Search with summaries from a folder: the text of every page in one script of the search page.

Sphinx fetches a page for the summary of a hit, which browsers refuse in a folder.
"""

from __future__ import annotations

import html
import json
import re
from pathlib import Path

from bs4 import BeautifulSoup, Tag

TEXTS = "search-texts.js"
_SILENT = {"script", "style", "form", "svg"}
_NOT_TEXT = {"headerlink", "rcbook-sliders", "rcbook-data", "admonition-title"}
_PLACES = {"section", "dt"}  # what a hit may lead to
_INSIDE = {"a", "b", "code", "em", "i", "small", "span", "strong", "sub", "sup"}  # of a line
_TOOLS = re.compile(r'<script src="(_static/)searchtools\.js[^"]*"></script>')
_PLAIN = re.compile(r"[^\\]*")  # a formula that can be read as it is typed


def summarise(book: Path) -> None:
    """Give the search page of the rendered book in the folder `book` the text of all pages.

    Raises ValueError when the search page is not as Sphinx makes it.
    """
    texts = {}
    for page in sorted(book.rglob("*.html")):
        place = page.relative_to(book)
        if place.parts[0] != "_static" and place.name != "search.html":
            texts[f"./{place.as_posix()}"] = text(page.read_text(encoding="utf-8"))
    packed = json.dumps(texts, ensure_ascii=False, separators=(",", ":"))
    script = f"window.rcbookTexts = {packed};\n"
    (book / "_static" / TEXTS).write_text(script, encoding="utf-8", newline="\n")
    search = book / "search.html"
    ours = "".join(rf'<script src="\1{name}"></script>\n' for name in (TEXTS, "search.js"))
    page, count = _TOOLS.subn(lambda tag: tag.expand(ours) + tag[0], search.read_text("utf-8"))
    if not count:
        raise ValueError("search.html loads no searchtools.js; mend rcbook.book.search")
    search.write_text(page, encoding="utf-8", newline="\n")


def text(page: str) -> str:
    """What a page says, its sections marked as Sphinx's summaries look for them."""
    article = BeautifulSoup(page, "html.parser").find("article")
    said = "" if article is None else re.sub(r"\s+", " ", _said(article)).strip()
    return f'<main role="main">{said}</main>'


def _said(tag: Tag) -> str:
    classes = tag.get("class") or []
    if tag.name in _SILENT or _NOT_TEXT & {*classes}:
        return ""
    if "math" in classes:
        return _formula(tag)
    parts = (_said(part) if isinstance(part, Tag) else html.escape(part) for part in tag.children)
    inner = "".join(parts)
    if tag.name in _PLACES and tag.get("id"):
        return f'<{tag.name} id="{html.escape(tag["id"])}">{inner} </{tag.name}>'
    return inner if tag.name in _INSIDE else f"{inner} "


def _formula(tag: Tag) -> str:
    """A formula without its marks; one that needs typesetting is left out."""
    typed = tag.get_text().strip().removeprefix(r"\(").removesuffix(r"\)")
    return html.escape(re.sub(r"[{}]", "", typed)) if _PLAIN.fullmatch(typed) else "… "
