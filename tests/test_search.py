"""The search from a folder: every hit has a summary, of which nothing is fetched."""

import json

import pytest
from test_pages import pages

from rcbook.book import search

PAGE = """<html><body><nav>menu</nav><article class="bd-article"><section id="runout">
<h1>Runout<a class="headerlink" href="#runout">#</a></h1><p>A cutter, out of <em>true</em>, with
<span class="math">\\(k_r\\)</span> and <span class="math">\\(\\frac{a}{b}\\)</span>.</p>
<section id="more-of-it"><h2>More</h2><p>of it &lt;here&gt;</p></section>
<div class="rcbook-sliders"><p>note</p></div><script>code()</script></section></article></body>
</html>"""


def test_a_text_has_the_words_of_a_page_by_its_sections_and_nothing_else():
    said = search.text(PAGE)
    assert said.startswith('<main role="main"><section id="runout"> Runout A cutter, out of true')
    assert "with k_r and … ." in said
    assert '<section id="more-of-it">More of it &lt;here&gt;' in said
    assert not any(word in said for word in ("menu", "#<", "note", "code()", "frac"))


@pytest.fixture
def rendered(tmp_path):
    """A folder as Sphinx leaves it, of one page and the search page."""
    (tmp_path / "_static").mkdir()
    (tmp_path / "part").mkdir()
    (tmp_path / "part" / "one.html").write_text(PAGE, encoding="utf-8")
    script = '<script src="_static/searchtools.js?v=1"></script>'
    (tmp_path / "search.html").write_text(f"<head>{script}</head>", encoding="utf-8")
    return tmp_path


def test_the_search_page_loads_the_texts_before_sphinx_asks_for_them(rendered):
    search.summarise(rendered)
    page = (rendered / "search.html").read_text(encoding="utf-8")
    names = ("search-texts.js", "search.js", "searchtools.js?v=1")
    places = [page.index(f'src="_static/{name}"') for name in names]
    assert places == sorted(places)
    script = (rendered / "_static" / search.TEXTS).read_text(encoding="utf-8")
    texts = json.loads(script.removeprefix("window.rcbookTexts = ").removesuffix(";\n"))
    assert texts == {"./part/one.html": search.text(PAGE)}


def test_another_search_page_is_an_error_and_not_a_search_without_summaries(rendered):
    (rendered / "search.html").write_text("<head></head>", encoding="utf-8")
    with pytest.raises(ValueError, match=r"search\.html loads no searchtools\.js"):
        search.summarise(rendered)


# ---- the book ----


@pytest.mark.parametrize("words", ["runout", "zero inverse", "spindle"])
def test_a_hit_has_a_summary_with_the_words(visit, words):
    """`visit` refuses the network and fails on any error of the console."""
    tab = visit(f"search.html?q={words}")
    tab.wait_for_selector("#search-results li a", timeout=15_000)
    tab.wait_for_selector("#search-results li p.context")
    tab.wait_for_function("!document.querySelector('#search-results h2 span')?.innerText")
    shown = tab.locator("#search-results li p.context").all_inner_texts()
    said = [any(word in text.lower() for word in words.split()) for text in shown]
    assert sum(said) >= max(3, 0.8 * len(shown))
    assert all("\\(" not in text for text in shown)


def test_every_page_is_among_the_texts_and_the_search_page_stays_light(built):
    html = built / "book" / "_build" / "html"
    script = (html / "_static" / search.TEXTS).read_text(encoding="utf-8")
    texts = json.loads(script.removeprefix("window.rcbookTexts = ").removesuffix(";\n"))
    assert {*texts} == {f"./{page}" for page in pages(built) if page != "search.html"}
    assert all(len(text) > 500 for text in texts.values())
    assert len(script.encode()) < 1_500_000
