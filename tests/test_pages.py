"""The rendered book in a browser, from `file://` and with no network."""

import math
import re
from importlib import resources
from pathlib import Path

import nbformat
import pytest
from bs4 import BeautifulSoup

from rcbook import ledger

SPHINX_ALONE = {"search.html"}  # made without a source of ours


def pages(built: Path) -> list[str]:
    html = built / "book" / "_build" / "html"
    found = [path.relative_to(html) for path in html.rglob("*.html")]
    return sorted(path.as_posix() for path in found if path.parts[0] != "_static")


def test_every_page_loads_and_typesets(visit, built):
    found = pages(built)
    assert {"index.html", "ledger.html", "errata.html", "api.html", "bibliography.html"} <= {*found}
    for page in found:
        tab = visit(page)
        assert tab.title(), page
        if page not in SPHINX_ALONE:
            assert tab.locator("article h1").count() == 1, page
        shown = tab.locator("main").first.inner_text()
        assert r"\(" not in shown, page
        assert r"\[" not in shown, page
        assert tab.locator("mjx-merror").count() == 0, page


def test_the_cover_leads_to_the_chapter_that_draws_it(built):
    html = built / "book" / "_build" / "html"
    page = BeautifulSoup((html / "index.html").read_text(encoding="utf-8"), "html.parser")
    (chapter,) = (
        path.stem
        for path in (built / "notebooks").glob("*.ipynb")
        for cell in nbformat.read(path, as_version=4).cells
        if "cover" in cell.metadata.get("tags", ())
    )
    first = page.select_one("article a[href^='notebooks/']")
    assert first["href"] == f"notebooks/{chapter}.html"


@pytest.mark.parametrize("page", ["index.html", "ledger.html", "errata.html"])
def test_mathematics_is_drawn(visit, page):
    assert visit(page).locator("mjx-container svg").count() > 0


def test_no_page_names_a_script_style_or_picture_of_another_host(built):
    html = built / "book" / "_build" / "html"
    loads = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*(?:src|href)=\"(?:https?:)?//")
    imports = re.compile(r"url\([\"']?(?:https?:)?//|@import\s+[\"'](?:https?:)?//")
    for path in html.rglob("*.html"):
        assert not loads.search(path.read_text(encoding="utf-8")), path
    for path in html.rglob("*.css"):
        assert not imports.search(path.read_text(encoding="utf-8")), path


OFF_SCREEN = """() => [...document.querySelectorAll("article :is(td, tbody th)")].filter((cell) => {
    const box = cell.getBoundingClientRect();
    return box.width && (box.left < 0 || box.right > 391);
}).map((cell) => cell.textContent)"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_page_scrolls_sideways_on_a_phone(visit, built, scheme):
    """Neither does a table: its rows are cards, and no cell is off the screen."""
    for page in pages(built):
        tab = visit(page, width=390, scheme=scheme)
        assert tab.evaluate("document.documentElement.scrollWidth") <= 390, page
        for folded in tab.locator("article details").all():
            folded.evaluate("e => e.open = true")
        assert tab.evaluate(OFF_SCREEN) == [], page


def chapters(built: Path) -> dict[str, BeautifulSoup]:
    """The chapters' pages, parsed."""
    found = (built / "book" / "_build" / "html" / "notebooks").glob("*.html")
    return {p.name: BeautifulSoup(p.read_text(encoding="utf-8"), "html.parser") for p in found}


def test_a_chapter_shows_nothing_raw(built):
    """No table or value as Python prints it, no markup, and no bar with nothing below it."""
    for name, page in chapters(built).items():
        article = page.find("article")
        assert not article.select("table.dataframe, .output.text_plain, .output.stream"), name
        for bar in article.select("div.cell.tag_hide-input"):
            assert bar.select(".cell_output"), f"{name}: {bar.text[:80]}"
        for code in article(["pre", "script", "code"]):
            code.decompose()
        for formula in article.select(".math"):
            formula.decompose()
        raw = re.search(r"\{\w+\}`|\$[^$]*\$|:::|\*\*|\]\(|<!--", article.text)
        assert not raw, f"{name}: {article.text[raw.start() - 60 : raw.end() + 60]!r}"


def test_every_figure_and_displayed_equation_of_a_chapter_has_its_number(built):
    for name, page in chapters(built).items():
        number = {int(page.select_one("h1 .section-number").text.strip(" ."))}
        captions = page.select("figure figcaption")
        assert len(captions) == len(page.select("article figure img")), name
        shown = [c.select_one(".caption-number").text.split()[-1] for c in captions]
        assert shown == [f"{min(number)}.{i + 1}" for i in range(len(shown))], name
        equations = [e.text.strip("()¶# \n") for e in page.select("article .eqno")]
        assert equations == [f"{min(number)}.{i + 1}" for i in range(len(equations))], name
        assert len(equations) == len(page.select("article div.math")), name


def test_a_chapter_leads_to_functions_and_words_and_hands_out_its_notebook(built):
    """The notebook that is handed out is the committed one, without marks of ours in the way."""
    html = built / "book" / "_build" / "html" / "notebooks"
    for name, page in chapters(built).items():
        assert page.select("article .cell_input a[href*='api.html#rcbook.']"), name
        assert page.select("article a[href*='glossary.html#term-']"), name
        (given,) = page.select("article a.download[href$='.ipynb']")
        notebook = (html / given["href"]).read_bytes()
        assert notebook == (built / "notebooks" / name.replace(".html", ".ipynb")).read_bytes()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out(visit, scheme, built):
    """Contrast of at least 7 between text and page, in either theme."""
    tab = visit("ledger.html", scheme=scheme)
    assert tab.evaluate("document.documentElement.dataset.theme") == scheme
    colours = "e => [getComputedStyle(e).color, getComputedStyle(document.body).backgroundColor]"
    ink, paper = tab.locator("table.rcbook-full td").first.evaluate(colours)
    assert contrast(ink, paper) >= 7


def contrast(ink: str, paper: str) -> float:
    """Contrast ratio of two CSS colours, as WCAG 2 defines it."""

    def luminance(colour: str) -> float:
        parts = [int(part) / 255 for part in re.findall(r"\d+", colour)[:3]]
        linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
        return sum(w * p for w, p in zip((0.2126, 0.7152, 0.0722), linear, strict=True))

    low, high = sorted((luminance(ink), luminance(paper)))
    return (high + 0.05) / (low + 0.05)


def test_the_ledger_can_be_filtered(visit, rows):
    tab = visit("ledger.html")
    shown = tab.locator("table.rcbook-full tbody tr:visible")
    count = tab.locator(".rcbook-filter output")
    assert shown.count() == len(rows)
    tab.get_by_label("Verdict").select_option("not reproduced")
    expected = sum(row["verdict"] == "not reproduced" for row in rows)
    assert shown.count() == expected
    assert count.inner_text() == f"{expected} of {len(rows)} claims"
    tab.get_by_role("button", name="Show all").click()
    tab.wait_for_function("document.querySelectorAll('.rcbook-full tr[hidden]').length === 0")
    tab.get_by_label("Text").fill(rows[0]["id"])
    assert shown.first.get_attribute("id") == rows[0]["id"]
    assert shown.count() < len(rows)


def test_the_scoreboard_leads_to_the_filtered_ledger(visit, rows):
    tab = visit("index.html")
    first = tab.locator("table.rcbook-score tbody td a").first
    count = int(first.inner_text())
    first.click()
    tab.wait_for_selector(".rcbook-filter:not([hidden])")
    assert tab.locator("table.rcbook-full tbody tr:visible").count() == count


def test_the_filter_works_from_the_keyboard(visit, rows):
    tab = visit("ledger.html")
    tab.get_by_label("Paper").focus()
    tab.keyboard.press("Tab")
    tab.keyboard.press("Tab")
    tab.keyboard.press("Tab")
    tab.keyboard.type("no such words anywhere")
    assert tab.locator("table.rcbook-full tbody tr:visible").count() == 0
    tab.keyboard.press("Tab")
    tab.keyboard.press("Enter")
    tab.wait_for_function("document.querySelectorAll('.rcbook-full tr[hidden]').length === 0")


def test_without_scripts_the_ledger_shows_every_claim(browser, built, rows):
    context = browser.new_context(java_script_enabled=False)
    tab = context.new_page()
    tab.goto((built / "book" / "_build" / "html" / "ledger.html").as_uri())
    assert tab.locator("table.rcbook-full tbody tr:visible").count() == len(rows)
    assert not tab.locator(".rcbook-filter").is_visible()
    context.close()


def test_every_link_inside_the_book_leads_somewhere(visit, built):
    """Our raw HTML links are not seen by the renderer, so they are followed here."""
    html = built / "book" / "_build" / "html"
    links = "links => links.map(link => link.href)"
    targets = set()
    for page in {*pages(built)} - SPHINX_ALONE:
        targets |= set(visit(page).locator("article a[href]").evaluate_all(links))
    for target in targets:
        if target.startswith(html.as_uri()):
            name, _, anchor = target.removeprefix(html.as_uri() + "/").partition("#")
            path = html / name.partition("?")[0]
            assert path.is_file(), target
            if anchor:
                assert f'id="{anchor}"' in path.read_text(encoding="utf-8"), target


def test_a_claim_leads_to_its_cell_and_back(visit, rows, built):
    """Every row of the ledger has its place in a chapter; one is walked, there and back."""
    html = built / "book" / "_build" / "html"
    for row in rows:
        chapter = html / "notebooks" / f"{row['notebook'].removesuffix('.ipynb')}.html"
        assert f'id="claim-{row["id"]}"' in chapter.read_text(encoding="utf-8"), row["id"]
    tab, row = visit("ledger.html"), rows[len(rows) // 2]
    tab.locator(f"[id='{row['id']}'] a[href*='#claim-']").click()
    found = tab.locator(f"[id='claim-{row['id']}']")
    found.wait_for(state="visible")
    assert found.evaluate("e => e.closest('details').open")
    found.locator("a[href*='ledger.html#']").click()
    tab.wait_for_selector(f"table.rcbook-full [id='{row['id']}']")


def test_on_a_phone_a_claim_is_a_card_in_a_chapter(visit, rows):
    tab = visit(f"notebooks/{rows[0]['notebook'].removesuffix('.ipynb')}.html", width=390)
    folded = tab.locator("details.rcbook-verdicts").first
    folded.locator("summary").click()
    for cell in folded.locator("td").all():
        box = cell.bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 390


# It does not give way before it is done, and would keep the other tab waiting.
AXE_LATER = """() => { window.found = new Promise((done) => setTimeout(
    () => axe.run({preload: false, resultTypes: ["violations"]}).then(done))) }"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_keeps_a_reader_out(visit, built, scheme):
    """axe-core finds nothing serious or critical on any page, wide or narrow, side by side."""
    axe = resources.files("axe_playwright_python").joinpath("axe.min.js").read_text("utf-8")
    for page in pages(built):
        tabs = {width: visit(page, width=width, scheme=scheme) for width in (1400, 390)}
        for tab in tabs.values():
            tab.evaluate(axe)
            tab.evaluate(AXE_LATER)
        for width, tab in tabs.items():
            found = tab.evaluate("window.found")["violations"]
            bad = [v for v in found if v["impact"] in ("serious", "critical")]
            told = [(v["id"], v["nodes"][0]["html"][:200]) for v in bad]
            assert not told, (page, width)
            tab.close()


def test_no_page_is_heavier_than_three_megabytes(visit, built):
    """With all pictures, and without what all pages share."""
    html = built / "book" / "_build" / "html"
    for page in pages(built):
        sources = "images => images.map(image => image.src)"
        images = {*visit(page).locator("img").evaluate_all(sources)}
        names = [i.removeprefix(html.as_uri() + "/") for i in images if i.startswith("file:")]
        weight = sum((html / name).stat().st_size for name in [page, *names])
        assert weight <= 3_000_000, f"{page}: {weight / 1e6:.1f} MB"


def test_every_picture_has_words(visit, built):
    for page in {*pages(built)} - SPHINX_ALONE:
        alts = "images => images.map(image => image.getAttribute('alt') || '')"
        for alt in visit(page).locator("article img").evaluate_all(alts):
            assert len(alt) > 10, page
            assert not alt.startswith("_images"), page


# ---- pictures with sliders ----


def with_sliders(built: Path) -> list[str]:
    html = built / "book" / "_build" / "html"
    return [p for p in pages(built) if "rcbook-sliders" in (html / p).read_text(encoding="utf-8")]


def started(tab):
    """The first picture with sliders of a page, when it is there to be moved."""
    tab.locator(".cell_output:has(.rcbook-sliders)").first.scroll_into_view_if_needed()
    tab.wait_for_selector(".rcbook-sliders[data-ready]")
    return tab.locator(".rcbook-sliders").first


def drawn(tab) -> list:
    """The values of the curves of the first picture."""
    numbered = "chart.get_model_by_name(`curve-${i}`)"
    return tab.evaluate(
        f"""() => {{ const chart = Bokeh.documents[0], curves = [];
        for (let i = 0; {numbered}; i++) curves.push(Array.from({numbered}.data.y, Number));
        return curves; }}"""
    )


def test_every_chapter_has_a_picture_with_sliders(built):
    chapters = [chapter for key in ledger.papers() for chapter in ledger.load(key).chapters]
    notebooks = {"one_idea.ipynb", *(chapter.notebook for chapter in chapters)}
    assert {f"notebooks/{name.removesuffix('.ipynb')}.html" for name in notebooks} <= {
        *with_sliders(built)
    }


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_picture_is_moved_from_the_keyboard(visit, built, scheme):
    for page in with_sliders(built):
        tab = visit(page, width=390, scheme=scheme)
        picture = started(tab)
        tab.evaluate("document.querySelector('.cell_output:has(.rcbook-sliders)').tabIndex = -1")
        tab.evaluate("document.querySelector('.cell_output:has(.rcbook-sliders)').focus()")
        tab.keyboard.press("Tab")
        slider = picture.locator("input").first
        assert slider.evaluate("e => e === document.activeElement"), page
        assert slider.get_attribute("aria-label"), page
        before, note = drawn(tab), picture.locator(".rcbook-note").inner_text()
        said = slider.get_attribute("aria-valuetext")
        tab.keyboard.press("ArrowRight")
        assert slider.get_attribute("aria-valuetext") != said, page
        assert picture.locator("output").first.inner_text() != said, page
        assert picture.locator(".rcbook-note").inner_text() != note, page
        assert drawn(tab) != before, page
        tab.keyboard.press("ArrowLeft")
        assert str(drawn(tab)) == str(before), page
        assert tab.evaluate("document.documentElement.scrollWidth") <= 390, page


def test_a_moved_picture_shows_what_a_closed_form_gives(visit):
    """Passes of q have the gain of a power of the cosine of half the angle."""
    tab = visit("notebooks/one_idea.html")
    passes = started(tab).get_by_role("slider", name="passes of q")
    passes.focus()
    tab.keyboard.press("Home")
    for count in range(4):
        x = tab.evaluate("Array.from(Bokeh.documents[0].get_model_by_name('curve-2').data.x)")
        closed = [math.cos(math.pi * place / 20) ** (2 * count) for place in x]  # 20 a turn
        assert drawn(tab)[2] == pytest.approx(closed, abs=1e-3)
        tab.keyboard.press("ArrowRight")


def test_a_picture_with_sliders_stands_still_in_print_and_without_scripts(visit, browser, built):
    page = "notebooks/one_idea.html"
    tab = visit(page)
    picture, still = started(tab), tab.locator("figure:has(.rcbook-sliders) img").first
    assert picture.is_visible()
    assert not still.is_visible()
    tab.emulate_media(media="print")
    assert still.is_visible()
    assert not picture.is_visible()
    context = browser.new_context(java_script_enabled=False)
    tab = context.new_page()
    tab.goto((built / "book" / "_build" / "html").as_uri() + "/" + page)
    before = "xpath=preceding::figure[1]//img"  # without scripts it stands in the cell before
    assert tab.locator(".rcbook-sliders").first.locator(before).is_visible()
    assert not tab.locator(".rcbook-sliders").first.is_visible()
    context.close()
