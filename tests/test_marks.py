"""A number in the text is checked, and a wrong one is caught."""

import nbformat
import pytest
from conftest import COVER, LEDGER, ROOT

from rcbook.book import numbers
from rcbook.book.execute import execute
from rcbook.book.project import find
from rcbook.ledger import marks


def kinds(text, **settings):
    return [(n.text, n.kind) for n in marks.numbers(text, **settings)]


# ---- what counts as a number, and what accounts for it by itself ----


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("a gain of 0.8", ["0.8"]),
        ("from −3.5 to -2", ["−3.5", "-2"]),
        ("3-5 samples", ["3", "5"]),
        ("40,000 points, (1, 0)", ["40,000", "1", "0"]),
        ("1e-9 and 2.5E+3", ["1e-9", "2.5E+3"]),
        (r"$4\times10^{8}$ and $3 \times 10^5$", [r"4\times10^{8}", r"3 \times 10^5"]),
        ("forty-five, a hundred, two, a dozen", ["forty-five", "hundred", "dozen"]),
        ("x2, k_r, `5 lines`, [a](page7.html), <a name='8'>, C9", []),
        ("17% of 30Hz", ["17", "30"]),
    ],
)
def test_numbers_are_found(text, found):
    assert [n.text for n in marks.numbers(text)] == found


@pytest.mark.parametrize(
    "text",
    [
        "eq. 12",
        "eqs 8, 10 and 12",
        "figs 13 to 15",
        "Table 1 and case 3",
        "Tomizuka (1987)",
        "$z^{-40}$",
        "$b_{12} + a_3^7$",
        "$1 - z^{-N}$",
        "## 3. Heading",
        "1. a list",
    ],
)
def test_structure_needs_no_mark(text):
    found = marks.numbers(text)
    assert all(n.kind == marks.STRUCTURAL for n in found), found


@pytest.mark.parametrize(
    "text",
    ["a gain of 2", "$k = 0.5$", "$N = 3$", "N = 2000", "eq. 3 gives 7", "teeth: 24", "2000 rpm"],
)
def test_what_is_no_structure_has_to_be_accounted_for(text):
    assert marks.numbers(text)[-1].kind == marks.UNACCOUNTED


def test_braces_check_as_many_numbers_before_them():
    found = marks.numbers("In 9 runs $z^{-3}$ went from 1.5 to 2.5<!-- {a:.1f} {b[0]:.1f} -->.")
    checked = [(n.text, n.expression, n.spec) for n in found if n.kind == marks.COMPUTED]
    assert checked == [("1.5", "a", ".1f"), ("2.5", "b[0]", ".1f")]
    assert found[0].kind == marks.UNACCOUNTED


def test_an_exponent_of_a_formula_is_not_what_a_mark_means():
    found = marks.numbers(r"$0.25\,z^{-3}$<!-- {b:.2f} -->")
    assert [n.kind for n in found] == [marks.COMPUTED, marks.STRUCTURAL]


def test_a_quotation_goes_back_to_the_mark_before_and_not_beyond_its_paragraph():
    text = "7 in.\n\nA 3 and 4<!-- paper: ch. II -->, then 5<!-- chosen: an exercise --> and 6"
    assert [kind for _, kind in kinds(text)] == [
        marks.UNACCOUNTED,
        marks.QUOTED,
        marks.QUOTED,
        marks.CHOSEN,
        marks.UNACCOUNTED,
    ]


def test_a_quoted_claim_has_to_print_the_number():
    printed = {"paper.a": "-2.5;47"}.__getitem__
    text = "{} lb<!-- claim: paper.a -->"
    for value, kind in (("47", marks.QUOTED), ("2.5", marks.QUOTED), ("46", marks.UNACCOUNTED)):
        assert kinds(text.format(value), printed=printed)[0][1] == kind


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("one<!-- {a:.1f} -->", "checks 1 numbers"),
        ("4\n\n5<!-- {a:.1f} {b:.1f} -->", "checks 2 numbers"),
        ("5<!-- {a} -->", "format"),
        ("5<!-- {a:.1f -->", "cannot be read"),
        ("5<!-- paper: -->", "where or why"),
    ],
)
def test_a_mark_that_says_nothing_is_refused(text, message):
    with pytest.raises(ValueError, match=message):
        marks.numbers(text)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        (r"$F\approx88.4$", "88.4"),  # glued to a command of TeX
        (r"$|GH|\le99.5$", "99.5"),
        (r"$4\cdot10^{8}$", r"4\cdot10^{8}"),
        ("For $k<N$ it is 66.6 lb, and $k>N$.", "66.6"),  # no tag
        ("f<a, 99.4 lb>", "99.4"),
        ("```{note}\nThe peak is 99 lb.\n```", "99"),
        ("{math}`F = 99.5`", "99.5"),
        ('![a](x.png "peak 99 lb")', "99"),
        ("a force of 2012 lb", "2012"),  # no year
        ("equals 1995", "1995"),
        ("## 99 lb is the peak", "99"),
        ("a gain of .05", ".05"),
        ("it passes 99 Hz", "99"),
        ("case 2, 30 lb", "30"),
        ("no 40 percent", "40"),
        ("by a step 88 wide", "88"),
    ],
)
def test_a_number_does_not_hide(text, number):
    assert (number, marks.UNACCOUNTED) in kinds(text)


def test_a_mark_in_a_table_means_its_row_only():
    text = "| a | b |\n|---|---|\n| 5 | 6 |\n| 7 | 8<!-- paper: table 1 --> |"
    assert [kind for _, kind in kinds(text)] == [marks.UNACCOUNTED] * 2 + [marks.QUOTED] * 2


def test_a_quotation_has_the_digits_of_the_print():
    printed = {"paper.a": "0.219"}.__getitem__
    assert kinds("0.21900<!-- claim: paper.a -->", printed=printed)[0][1] == marks.UNACCOUNTED


@pytest.mark.parametrize(
    "mark",
    [
        "{77.7:.1f}",  # checks itself
        "{'88.4':s}",
        '{ledger.check("paper.a", 1).computed:.1f}',  # changes the run
        "{(x := 2):.0f}",
        "{x.__class__:.0f}",
        "{x +:.0f}",
    ],
)
def test_a_mark_reads_a_number_of_the_run_and_does_nothing_else(mark):
    with pytest.raises(ValueError):
        marks.numbers(f"88.4<!-- {mark} -->")


def test_where_nothing_runs_no_mark_is_computed():
    with pytest.raises(ValueError, match="nothing runs this text"):
        marks.numbers("88.4<!-- {x:.1f} -->", runs=False)


@pytest.mark.parametrize(
    ("typed", "computed", "same"),
    [
        ("0.50", "0.50", True),
        ("0.5", "0.50", False),  # the digits are part of what is said
        ("−3.1", "-3.1", True),
        ("3.1", "-3.1", False),
        ("0.0", "-0.0", True),
        (r"4\times10^{8}", "4e+08", True),
        (r"4\times 10^8", "4e+09", False),
        ("17", "17%", True),
        ("40,000", "40000", True),
        ("forty", "40", False),  # results are written in digits
        ("5", "inf", False),
        ("5", "nan", False),
    ],
)
def test_typed_and_computed_are_compared_digit_by_digit(typed, computed, same):
    assert marks.same(typed, computed) is same


def test_rewriting_keeps_the_way_of_writing():
    dotted = r"$4\cdot10^{8}$<!-- {b:.0e} -->"
    assert marks.rewritten(dotted, {1: "5e+08"}) == r"$5\cdot10^{8}$<!-- {b:.0e} -->"
    text = r"From −3.1 over $4\times10^{8}$<!-- {a:.1f} {b:.0e} --> on."
    values = {text.index("−"): "-2.9", text.index("4"): "5e+07"}
    assert marks.rewritten(text, values) == (
        r"From −2.9 over $5\times10^{7}$<!-- {a:.1f} {b:.0e} --> on."
    )


def test_marks_are_gone_for_the_reader():
    assert marks.without_marks("A 3.5<!-- {a:.1f} --> and\n<!-- paper: p. 2 -->b") == "A 3.5 and\nb"


def test_braces_of_a_data_file_are_computed_and_its_own_print_is_a_quotation():
    found = marks.of_template("It is {value:.2e} lb, not 47, at 3 or $z^{{-4}}$.", ["47 lb"])
    assert {n.text: n.kind for n in found} == {
        "{value}": marks.COMPUTED,
        "47": marks.QUOTED,
        "3": marks.UNACCOUNTED,
        "-4": marks.STRUCTURAL,
    }


# ---- in a run ----


def executed(make, text, alt="a curve", cells=("x = 2.04", LEDGER, COVER)):
    project = make(one=list(cells))
    path = project.notebooks / "one.ipynb"
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.insert(1, nbformat.v4.new_markdown_cell(text))
    notebook.cells[-1].metadata["mystnb"]["image"]["alt"] = alt
    nbformat.write(notebook, path)
    return project, *execute([path])


def test_a_right_number_passes_even_where_it_stands_before_its_code(make):
    _, _, failures, typed = executed(
        make,
        "It is 2.0<!-- {x:.1f} -->, ours 2.01<!-- {y:.2f} -->.",
        cells=("x = 2.04", LEDGER, "y = x - 0.03", COVER),
    )
    assert not failures
    assert [n.computed for n in typed["one.ipynb"]] == ["2.0", "2.01"]


def test_a_wrong_number_fails_the_run_with_cell_number_and_value(make):
    _, _, failures, _ = executed(make, "It is 2.1<!-- {x:.1f} -->.")
    (failure,) = failures
    assert "2.1" in failure.what and "2.0" in failure.what and "{x}" in failure.what
    assert failure.notebook == "one.ipynb" and failure.cell.startswith("cell ")


def test_a_wrong_number_in_an_alternative_text_fails_too(make):
    _, _, failures, _ = executed(make, "Text.", alt="a curve up to 3<!-- {x:.0f} -->")
    assert len(failures) == 1 and "alternative text" in failures[0].cell


def test_an_expression_that_fails_is_a_failure_that_says_why(make):
    _, _, failures, _ = executed(make, "3<!-- {nowhere:.0f} --> and 2<!-- {x / 0:.0f} -->.")
    assert "NameError" in failures[0].what and "ZeroDivisionError" in failures[1].what


def test_a_notebook_may_call_anything_format(make):
    cells = ("x = 9.9", "format = lambda value, spec: '2.0'", LEDGER, COVER)
    _, _, failures, _ = executed(make, "It is 2.0<!-- {x:.1f} -->.", cells=cells)
    assert len(failures) == 1


def test_what_is_no_number_is_not_typed(make):
    project, _, failures, typed = executed(make, "It is 2.1<!-- {float('nan') * x:.1f} -->.")
    assert len(failures) == 1 and numbers.rewrite(project, typed) == 0


def test_one_command_rewrites_the_numbers(make):
    text = "It is 2.1<!-- {x:.1f} --> or 3<!-- {nowhere:.0f} -->."
    project, _, _, typed = executed(make, text, alt="up to 3<!-- {x:.0f} -->")
    assert numbers.rewrite(project, typed) == 2
    cells = nbformat.read(project.notebooks / "one.ipynb", as_version=4).cells
    assert cells[1].source == "It is 2.0<!-- {x:.1f} --> or 3<!-- {nowhere:.0f} -->."
    assert cells[-1].metadata["mystnb"]["image"]["alt"] == "up to 2<!-- {x:.0f} -->"


# ---- in the book ----


def test_every_number_of_the_book_is_accounted_for():
    lost = [str(p) for p in numbers.survey(find(ROOT)) if p.number.kind == marks.UNACCOUNTED]
    assert not lost, "\n".join(lost)
