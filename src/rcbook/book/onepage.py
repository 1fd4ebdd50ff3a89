"""The rendered book as one page, for print: all pages in their order, every link inside of it."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urljoin, urlsplit

from bs4 import BeautifulSoup, Tag

# What a reader of paper has no use for: code that was folded, what moves, what filters, what saves.
_DROPPED = (
    ".headerlink, script, style, form, button, details.hide, .rcbook-sliders, .rcbook-data, "
    "a[download], .section-nav"
)
_ANSWER = "Check yourself"  # the summary of what solves an exercise
_POINTS_AT = ("aria-labelledby", "aria-describedby", "aria-controls")


@dataclass(frozen=True)
class Place:
    """A page of the book in its table of contents."""

    path: str  # of the page, from the folder of the book
    title: str
    part: str  # of the book; empty for what stands before the first

    @property
    def id(self) -> str:
        return slug(self.path)


def slug(path: str) -> str:
    """The id that a page of the book has in the one page."""
    return path.removesuffix(".html").replace("/", "-")


def contents(book: Path) -> list[Place]:
    """The pages of the rendered book in the folder `book`, in the order of its menu."""
    menu = _soup(book / "index.html").select_one("nav.bd-links")
    places, part = [], ""
    for item in menu.select("p.caption, a.reference.internal"):
        if item.name == "p":
            part = item.get_text(strip=True)
        else:
            path = "index.html" if item["href"] == "#" else item["href"]
            places.append(Place(path, item.get_text(strip=True), part))
    return places


def write(book: Path, pages: Mapping[str, int] | None = None) -> str:
    """The whole book as one page of HTML that can stand anywhere on this machine.

    `pages` says on which page of the print a chapter begins, by the id of its place.
    """
    places = contents(book)
    known = {place.path: place.id for place in places}
    chapters = "".join(_chapter(book, place, known) for place in places)
    front = _soup(book / "index.html")
    title = front.select_one("article h1").find(string=True).strip()
    return (
        f'<!DOCTYPE html><html lang="en" data-theme="light"><head><meta charset="utf-8">'
        f"<title>{html.escape(title)}</title>{_head(front, book)}</head>"
        f'<body class="rcbook-print">{_title_page(front, title, book)}'
        f"{_contents(places, pages or {})}"
        f'<div class="bd-content">{chapters}</div></body></html>'
    )


def _soup(page: Path) -> BeautifulSoup:
    return BeautifulSoup(page.read_text(encoding="utf-8"), "html.parser")


def _head(front: BeautifulSoup, book: Path) -> str:
    """The style sheets and MathJax of the book's first page; nothing else that it runs."""
    kept = []
    for tag in front.head.find_all(["link", "script"]):
        sheet = tag.name == "link" and "stylesheet" in (tag.get("rel") or [])
        typesets = "tex-svg-full.js" in tag.get("src", "") or "window.MathJax" in (tag.string or "")
        for name in ("href", "src"):
            if tag.get(name):
                tag[name] = (book / tag[name].partition("?")[0]).as_uri()
        if sheet or typesets:
            kept.append(str(tag))
    return "".join(kept)


def _title_page(front: BeautifulSoup, title: str, book: Path) -> str:
    author = front.select_one("meta[name=author]")
    footer = front.select_one(".component-author")
    by = author["content"] if author else (footer.get_text(strip=True) if footer else "")
    image = front.select_one("article img")
    shown = ""
    if image is not None:
        source = (book / image["src"]).as_uri()
        shown = f'<img src="{source}" alt="{html.escape(image.get("alt", ""))}">'
    return (
        f'<div class="rcbook-title"><p class="rcbook-name">{html.escape(title)}</p>{shown}'
        f"<p>{html.escape(by.removeprefix('By '))}</p></div>"
    )


def _contents(places: Iterable[Place], pages: Mapping[str, int]) -> str:
    """The table of contents; titles are no headings, of which the outline is made."""
    items, part = [], ""
    for place in places:
        if place.part != part:
            part = place.part
            items.append(f'<p class="rcbook-part">{html.escape(part)}</p>')
        title = _PREFACE if place.path == "index.html" else place.title
        line = f"<span>{html.escape(title)}</span><span>{pages.get(place.id, '')}</span>"
        items.append(f'<p><a href="#{place.id}">{line}</a></p>')
    return f'<nav class="rcbook-contents"><p class="rcbook-name">Contents</p>{"".join(items)}</nav>'


_PREFACE = "Preface"  # as the first page of the book is called, whose title the whole book has


def _chapter(book: Path, place: Place, known: Mapping[str, str]) -> str:
    """The article of a page, with ids of its own and links that stay in the one page."""
    soup = _soup(book / place.path)
    article = soup.find("article")
    for tag in article.select(_DROPPED):
        tag.decompose()
    for cell in article.select(".cell"):
        if not cell.get_text(strip=True) and not cell.find(["img", "svg"]):
            cell.decompose()
    if place.path == "index.html":
        article.find("h1").string = _PREFACE
    _fold(soup, article)
    for tag in article.find_all(True):
        _address(tag, book, place, known)
    article["id"] = place.id
    return str(article)


def _fold(soup: BeautifulSoup, article: Tag) -> None:
    """Leave of a table of verdicts its one line, put answers at the end, and unfold the rest.

    Links that lead to a row of such a table lead to its line.
    """
    answers = []
    for details in article.find_all("details"):
        summary = details.find("summary").extract()
        head = soup.new_tag("p", attrs={"class": "rcbook-summary"})
        if "rcbook-verdicts" in (details.get("class") or []):
            targets = [tag["id"] for tag in details.find_all(id=True)]
            head.extend(summary.contents[:])
            head.extend(soup.new_tag("span", id=target) for target in targets)
            details.replace_with(head)
            continue
        details.name = "div"
        details["class"] = "rcbook-unfolded"
        if summary.get_text(strip=True) == _ANSWER and details.find_previous(["h3", "h2"]):
            head.string = _heading(details.find_previous(["h3", "h2"]))
            answers.append(details.extract())
        else:
            head.string = summary.get_text(strip=True)
        details.insert(0, head)
    if answers:
        article.append(_answers(soup, answers))


def _heading(tag: Tag) -> str:
    return tag.get_text(strip=True)


def _answers(soup: BeautifulSoup, answers: Iterable[Tag]) -> Tag:
    section = soup.new_tag("section", attrs={"class": "rcbook-answers"})
    title = soup.new_tag("h2")
    title.string = "Answers to the exercises"
    section.extend([title, *answers])
    return section


def _address(tag: Tag, book: Path, place: Place, known: Mapping[str, str]) -> None:
    """Make id, link and source of a tag those of the one page."""
    for name in _POINTS_AT:
        tag.attrs.pop(name, None)
    if tag.get("id"):
        tag["id"] = f"{place.id}--{tag['id']}"
    if tag.name == "img":
        tag["src"] = (book / urljoin(place.path, unquote(tag["src"]))).as_uri()
    if tag.name == "a" and tag.get("href"):
        target = urlsplit(tag["href"])
        path = urljoin(place.path, target.path) if target.path else place.path
        if target.scheme or target.netloc:
            return
        if path in known and target.fragment:
            tag["href"] = f"#{known[path]}--{unquote(target.fragment)}"
        elif path in known:
            tag["href"] = f"#{known[path]}"
        else:  # a file beside the book
            tag.unwrap()
