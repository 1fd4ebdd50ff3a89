"""A notebook as a chapter: figures with captions, folded code, tables, and its links."""

import nbformat
import pandas as pd
import pytest
from bs4 import BeautifulSoup
from nbformat.v4 import new_code_cell, new_markdown_cell, new_output

from rcbook.book import chapter, links, rerun
from rcbook.book.rerun import Repository

PIXEL = "AAAA"  # nobody looks at it here


def picture(name: str = "", *also: dict) -> nbformat.NotebookNode:
    """A cell that shows a picture, and what else it shows."""
    metadata = {"mystnb": {"image": {"alt": "A curve that rises."}}}
    if name:
        metadata["mystnb"]["figure"] = {"name": name}
    outputs = [new_output("display_data", data) for data in ({"image/png": PIXEL}, *also)]
    return new_code_cell("draw()", id="drawn", metadata=metadata, outputs=outputs)


def folded(source: str, shows: str = "") -> nbformat.NotebookNode:
    outputs = [new_output("stream", text=shows)] if shows else []
    return new_code_cell(source, metadata={"tags": ["hide-input"]}, outputs=outputs)


# ---- figures ----


def test_the_paragraph_below_a_picture_is_its_caption():
    below = new_markdown_cell("**It rises**, as it must.\n\nThe text goes on.")
    cells = chapter.figures([picture("fig-mill-rise"), below], "mill")
    figure = cells[0].metadata["mystnb"]["figure"]
    assert figure == {"name": "fig-mill-rise", "caption": "**It rises**, as it must."}
    assert [cell.source for cell in cells] == ["draw()", "The text goes on."]


def test_a_figure_without_a_name_is_named_after_its_cell_and_an_empty_cell_goes():
    cells = chapter.figures([picture(), new_markdown_cell("**It rises.**")], "mill")
    assert len(cells) == 1
    assert cells[0].metadata["mystnb"]["figure"]["name"] == "fig-mill-drawn"


def test_text_that_is_no_caption_stays():
    cells = chapter.figures([picture(), new_markdown_cell("It rises.")], "mill")
    assert "figure" not in cells[0].metadata["mystnb"]
    assert cells[1].source == "It rises."


def test_what_a_cell_shows_beside_its_picture_stands_behind_it():
    table = {"text/html": "<p>judged</p>"}
    cells = chapter.figures([picture("", table), new_markdown_cell("**It rises.**")], "mill")
    assert [len(cell.outputs) for cell in cells] == [1, 1]
    assert cells[1].outputs[0]["data"] == table
    assert cells[1].metadata["tags"] == ["remove-input"]


# ---- folded code ----


def test_folded_code_that_shows_nothing_joins_its_neighbour():
    cells = chapter.bars(
        [folded("a = 1"), folded("b = 2"), folded("print(a)", "1"), folded("c = 3")]
    )
    assert [cell.source for cell in cells] == ["a = 1\n\n\nb = 2\n\n\nprint(a)\n\n\nc = 3"]
    assert cells[0].outputs


def test_folded_code_without_a_neighbour_is_left_to_the_notebook():
    read, text = new_code_cell("a = 1"), new_markdown_cell("text")
    assert chapter.bars([read, text, folded("b = 2"), text]) == [read, text, text]


# ---- tables ----


def rows_of(html: str) -> list[list[str]]:
    rows = BeautifulSoup(html, "html.parser")("tr")
    return [[cell.get_text(strip=True) for cell in row(["th", "td"])] for row in rows]


def test_a_table_of_pandas_has_one_head_and_nothing_drawn_by_chance():
    index = pd.MultiIndex.from_product([["a", "b"], ["0.1", "0.2"]], names=["design", "size"])
    frame = pd.DataFrame({"gain": [1.0, 2.0, 3.0, float("nan")]}, index)
    html, again = (
        chapter.table(frame.style.format("{:.1f}", na_rep="–").to_html()) for _ in range(2)
    )
    assert html == again
    assert "style" not in html
    assert rows_of(html) == [
        ["design", "size", "gain"],
        ["a", "0.1", "1.0"],
        ["a", "0.2", "2.0"],
        ["b", "0.1", "3.0"],
        ["b", "0.2", "–"],
    ]


def test_an_empty_corner_heads_no_column_and_formulas_are_typeset():
    html = chapter.table(pd.DataFrame({"$b_0$ (N)": [1.0]}, ["row"]).style.to_html())
    soup = BeautifulSoup(html, "html.parser")
    assert [head.name for head in soup.thead.tr(["th", "td"])] == ["td", "th"]
    assert r"\(b_0\)" in soup.thead.text


def test_other_html_is_left_alone():
    for html in ("<p id='x'>text</p>", '<table class="rcbook-ledger"><tr><td>1</td></tr></table>'):
        assert chapter.table(html) == html


# ---- links ----


def test_a_term_is_linked_where_it_first_stands():
    texts = ["Its multipliers, `multiplier`, $multiplier$ and multipliers.", "A multiplier."]
    assert links.first_uses(texts, ["multiplier"]) == [
        "Its {term}`multipliers <multiplier>`, `multiplier`, $multiplier$ and multipliers.",
        "A multiplier.",
    ]


@pytest.mark.parametrize(
    "closed",
    [
        "# multiplier",
        "[multiplier](x)",
        "{cite}`multiplier`",
        "<a id='multiplier'>",
        "(multiplier)=",
    ],
)
def test_a_term_is_not_linked_inside_of_what_is_no_text(closed):
    text = f"{closed}\n\nNo submultiplier, but a multiplier."
    linked = f"{closed}\n\nNo submultiplier, but a {{term}}`multiplier <multiplier>`."
    assert links.first_uses([text], ["multiplier"]) == [linked]


def test_the_longest_term_is_taken_also_across_a_line():
    assert links.first_uses(["a Frozen\nfactor"], ["factor", "frozen factor"]) == [
        "a {term}`Frozen factor <frozen factor>`"
    ]


def test_terms_are_those_of_the_glossary_but_everyday_words():
    page = "# Words\n\n:::{glossary}\nlead\n  A filter.\n\nmultiplier\n  A factor.\n:::\n\nlast\n"
    assert links.terms(page) == ["multiplier"]


def test_figures_and_equations_are_referred_to_by_their_numbers():
    text = "[Figure](#fig-mill-rise) and [equation](#eq-mill-plant), not [this](#there)"
    assert links.numbered(text) == (
        "{numref}`Figure %s <fig-mill-rise>` and equation {eq}`eq-mill-plant`, not [this](#there)"
    )


def test_functions_lead_to_the_module_that_they_are_in():
    found = links.functions()
    assert found["repetitive.simulate"] == "rcbook.loops.repetitive.response.simulate"
    assert "run.check" not in found  # the machinery has no place on the page
    text = "Call `repetitive.simulate`, `numpy.sin` or ``repetitive.simulate``."
    place = "{py:obj}`repetitive.simulate <rcbook.loops.repetitive.response.simulate>`"
    expected = f"Call {place}, `numpy.sin` or ``repetitive.simulate``."
    assert links.called(text, found) == expected


# ---- the end of a chapter ----


def test_without_a_repository_a_chapter_names_no_other_host():
    text = rerun.section("mill.ipynb", Repository())
    assert "http" not in text
    assert 'pip install jupyterlab "."' in text
    assert "<../downloads/mill.ipynb>" in text


def test_with_a_repository_a_chapter_runs_elsewhere_and_takes_reports():
    text = rerun.section("mill.ipynb", Repository("https://github.com/some/book", "main"))
    assert "https://mybinder.org/v2/gh/some/book/main?labpath=notebooks%2Fmill.ipynb" in text
    assert "colab.research.google.com/github/some/book/blob/main/notebooks/mill.ipynb" in text
    assert '"git+https://github.com/some/book@main"' in text
    assert "https://github.com/some/book/issues" in text


def test_a_repository_that_others_cannot_read_is_offered_to_none():
    text = rerun.section("mill.ipynb", Repository("https://git.example.org/some/book"))
    assert "Binder" not in text
    assert "Colab" not in text


@pytest.mark.parametrize("said", ["", "repository:", 'repository: {url: ""}', "repository: {}"])
def test_no_repository_is_said_in_many_ways(tmp_path, said):
    (tmp_path / "_config.yml").write_text(said, encoding="utf-8")
    assert rerun.repository(tmp_path) == Repository()


@pytest.mark.parametrize("url", ["github.com/some/book", "javascript:alert(1)", 'https://a/"<b>'])
def test_an_address_that_is_none_is_refused(tmp_path, url):
    (tmp_path / "_config.yml").write_text(f"repository: {{url: '{url}'}}\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"repository\.url is .*; give an address"):
        rerun.repository(tmp_path)
