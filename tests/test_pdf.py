"""The book as one page for print, and the PDF that a browser makes of it."""

import os
import re
import shutil

import pytest
from bs4 import BeautifulSoup
from conftest import COVER, LEDGER
from playwright.sync_api import Error

from rcbook import cli
from rcbook.book import onepage, pdf
from rcbook.book import project as projects
from rcbook.book.project import Project
from rcbook.book.render import RenderError

MENU = """<nav class="bd-links"><a class="reference internal" href="#">Front</a>
<p class="caption">Cases</p>
<a class="reference internal" href="notebooks/one.html">1. One &amp; all</a></nav>"""
FRONT = """<html><head><link rel="stylesheet" href="_static/a.css?v=1"><script>gone</script></head>
<body>%s<article><h1>A book<a class="headerlink" href="#a">#</a></h1><img src="a.png" alt="a face">
<a href="notebooks/one.html#claim-x">claim</a> <a href="notebooks/one.html">one</a>
<a href="downloads/one.ipynb">file</a> <a href="https://example.org/x">away</a></article></body>"""
ONE = """<article><h1>One</h1><section id="sec"><h2>Try it</h2>
<div class="cell"><details class="hide"><summary>Show code</summary>x = 1</details></div>
<div class="cell"><img src="../_images/b.svg" alt="b"></div>
<details class="rcbook-verdicts"><summary>1 claim: reproduced</summary>
<table><tr id="claim-x"><td>long</td></tr></table></details>
<details><summary>A hint</summary>Look twice.</details>
<details><summary>Check yourself</summary>It is seven.</details>
<a href="#sec">back</a> <a href="../index.html">home</a></section></article>"""

# What is seen over the right margin.
OVER = """() => [...document.querySelectorAll("body *")]
  .filter(e => e.checkVisibility() && e.getClientRects().length)
  .filter(e => !e.closest("mjx-assistive-mml") && (!e.closest("svg") || e.matches("svg")))
  .filter(e => e.getBoundingClientRect().right > document.body.clientWidth + 1)
  .map(e => `${e.tagName}.${e.className}: ${e.textContent.slice(0, 60)}`)"""


@pytest.fixture
def rendered(tmp_path):
    """A book of two pages, as if rendered."""
    project = Project(tmp_path, ())
    (project.html / "notebooks").mkdir(parents=True)
    (project.html / "index.html").write_text(FRONT % MENU, encoding="utf-8")
    (project.html / "notebooks" / "one.html").write_text(ONE, encoding="utf-8")
    return project


def one_page(book):
    return BeautifulSoup(onepage.write(book), "html.parser")


def lost(page):
    """Links into the page that lead to nothing."""
    ids = {tag["id"] for tag in page.find_all(id=True)}
    return [a["href"] for a in page.select('a[href^="#"]') if a["href"][1:] not in ids]


def test_links_of_the_book_become_links_of_the_page(rendered):
    page = one_page(rendered.html)
    goes = {a.get_text(): a["href"] for a in page.select("article a")}
    assert goes == {
        "claim": "#notebooks-one--claim-x",
        "one": "#notebooks-one",
        "away": "https://example.org/x",
        "back": "#notebooks-one--sec",
        "home": "#index",
    }
    assert not lost(page)
    assert "file" in page.get_text()
    assert page.select_one("article .cell img")["src"].startswith("file:")


def test_what_paper_cannot_do_is_left_out_and_what_was_folded_is_open(rendered):
    page = one_page(rendered.html)
    assert not page.select("details, summary, script, .headerlink")
    said = page.get_text()
    assert "1 claim: reproduced" in said and "Look twice." in said
    assert not re.search("long|Show code|x = 1|gone", said)
    assert len(page.select(".cell")) == 1  # a cell of which nothing is left leaves no frame


def test_answers_stand_at_the_end_under_the_name_of_their_exercise(rendered):
    answers = one_page(rendered.html).select_one(".rcbook-answers")
    assert "It is seven." in answers.get_text()
    assert answers.select_one(".rcbook-summary").get_text() == "Try it"
    assert answers.find_next_sibling() is None


def test_the_contents_name_parts_chapters_and_pages(rendered):
    page = BeautifulSoup(onepage.write(rendered.html, {"notebooks-one": 7}), "html.parser")
    lines = [p.get_text(" ") for p in page.select(".rcbook-contents p")]
    assert [line.strip() for line in lines] == ["Contents", "Preface", "Cases", "1. One & all 7"]


def test_pages_are_counted_in_the_tree_of_the_pdf():
    tree = b"""
1 0 obj
<</Type /Catalog
/Pages 2 0 R>>
2 0 obj
<</Type /Pages
/Count 3
/Kids [3 0 R 9 0 R]>>
3 0 obj
<</Type /Pages
/Count 2
/Kids [5 0 R 4 0 R]>>
7 0 obj
<</one [9 0 R /XYZ 0 0 0]
/a.b [4 0 R /XYZ 0 0 0]>>
"""
    assert pdf.chapter_pages(tree, ["one", "a.b", "a"]) == {"one": 3, "a.b": 2}


def test_without_a_browser_nothing_is_built(rendered, monkeypatch, capsys):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(projects, "find", lambda start: rendered)
    monkeypatch.setattr(cli, "_build", lambda arguments: pytest.fail("built"))
    assert cli.main(["pdf"]) == 1
    assert "install one of chromium" in capsys.readouterr().err


def test_an_old_pdf_stays_when_printing_fails(rendered, monkeypatch):
    def fails(*_):
        raise Error("no paper")

    target = rendered.build / "rcbook.pdf"
    target.write_text("old")
    monkeypatch.setattr(pdf, "_printed", fails)
    with pytest.raises(RenderError, match="no paper"):
        pdf.make(rendered, "a browser")
    assert target.read_text() == "old"
    assert sorted(path.name for path in rendered.build.iterdir()) == ["html", "rcbook.pdf"]


def test_a_book_is_old_when_a_source_is_newer_or_the_last_run_failed(make):
    made = make(one=[COVER, LEDGER])
    assert pdf.is_old(made)  # there is none
    made.html.mkdir(parents=True)
    page = made.html / "index.html"
    page.touch()
    assert not pdf.is_old(made)
    notebook = made.notebooks / "one.ipynb"
    later = page.stat().st_mtime + 1
    os.utime(notebook, (later, later))
    assert pdf.is_old(made)
    os.utime(page, (later, later))
    assert not pdf.is_old(made)
    made.stale_mark.touch()
    assert pdf.is_old(made)


@pytest.mark.parametrize("old", [True, False])
def test_the_book_is_built_before_it_is_printed_only_when_it_is_old(
    rendered, monkeypatch, capsys, old
):
    done = []
    monkeypatch.setattr(projects, "find", lambda start: rendered)
    monkeypatch.setattr(pdf, "browser", lambda: "a browser")
    monkeypatch.setattr(pdf, "is_old", lambda project: old)
    monkeypatch.setattr(cli, "_build", lambda arguments: done.append("built") or 0)
    monkeypatch.setattr(pdf, "make", lambda project, browser: done.append("printed"))
    assert cli.main(["pdf"]) == 0
    assert done == ["built", "printed"] if old else ["printed"]


def test_every_link_of_the_book_leads_somewhere(built):
    html = built / "book" / "_build" / "html"
    page = one_page(html)
    assert len(page.select("article")) == len(onepage.contents(html))
    assert not lost(page)
    ids = [tag["id"] for tag in page.find_all(id=True)]
    assert len(ids) == len(set(ids))


@pytest.fixture(scope="module")
def printed(built, tmp_path_factory):
    """The PDF of the built book."""
    try:
        browser = pdf.browser()
    except RenderError as error:
        pytest.skip(str(error))
    project = Project(tmp_path_factory.mktemp("printed"), ())
    project.build.mkdir(parents=True)
    shutil.copytree(built / "book" / "_build" / "html", project.html)
    return pdf.make(project, browser).read_bytes()


def test_the_pdf_is_a_book_of_a4_with_outline_and_page_numbers(printed, built):
    sizes = set(re.findall(rb"/MediaBox \[0 0 (\d+)[.\d]* (\d+)[.\d]*\]", printed))
    assert sizes == {(b"595", b"842")}
    outline = re.findall(rb"<</Title \((.*?)\)\n/Dest \[(\d+) 0 R", printed)
    titles = [title for title, _ in outline]
    assert len(titles) > 100
    assert titles.count(b"Answers to the exercises") <= len(list((built / "notebooks").iterdir()))
    places = [place.id for place in onepage.contents(built / "book" / "_build" / "html")]
    begins = pdf.chapter_pages(printed, places)
    assert list(begins) == places
    assert sorted(set(begins.values())) == list(begins.values())  # each on a page of its own


def test_links_of_the_pdf_lead_to_its_pages(printed):
    wanted = {name.decode() for name in re.findall(rb"/Dest /(\S+)", printed)}
    assert len(wanted) > 500
    assert pdf.chapter_pages(printed, wanted).keys() == wanted
    assert not re.search(rb"/URI \(file:", printed)


@pytest.fixture(scope="module")
def sheet():
    """A tab as wide as a sheet of paper; after `printed`, since one browser runs at a time."""
    try:
        browser = pdf.browser()
    except RenderError as error:
        pytest.skip(str(error))
    with pdf.sheet(browser) as page:
        yield page


@pytest.fixture
def paper(built, sheet, tmp_path):
    """The one page of the built book in that tab."""
    source = tmp_path / "book.html"
    source.write_text(onepage.write(built / "book" / "_build" / "html"), encoding="utf-8")
    pdf.show(sheet, source)
    return sheet


def test_nothing_of_the_book_is_cut_and_its_pictures_and_formulas_are_there(paper):
    assert paper.evaluate(OVER) == []
    assert paper.evaluate("[...document.images].every(image => image.naturalWidth > 0)")
    assert paper.evaluate("document.querySelectorAll('mjx-container svg').length") > 1000
    assert paper.evaluate("document.querySelectorAll('mjx-merror').length") == 0


CHROME = "header, .bd-sidebar, .bd-footer, form, details.hide, .rcbook-sliders, .copybtn"
FOLDED = "details:not(.hide) > :not(summary)"


@pytest.mark.parametrize("name", ["index", "ledger", "api", "notebooks/peripheral_milling"])
def test_a_page_that_a_reader_prints_is_its_text(built, sheet, name):
    """No menus and bars, folded code closed, all else open, and nothing over the margin."""
    pdf.show(sheet, built / "book" / "_build" / "html" / f"{name}.html")
    seen = "(e => e.checkVisibility())"
    assert sheet.evaluate(f"[...document.querySelectorAll('{CHROME}')].filter{seen}.length") == 0
    assert sheet.evaluate(f"[...document.querySelectorAll('{FOLDED}')].every{seen}")
    assert sheet.evaluate(OVER) == []
