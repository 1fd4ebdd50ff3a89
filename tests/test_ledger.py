"""Verdicts follow from printed digits and tolerance, and from nothing else."""

import importlib.resources
import json
import math
from fractions import Fraction

import numpy as np
import pytest

from rcbook import ledger
from rcbook.ledger import Claim, Ledger, Paper, judge, show


def claim(**fields):
    base = {
        "id": "paper.x",
        "paper": "paper",
        "where": "eq. 1",
        "kind": "number",
        "says": "a number",
        "printed": "0.8373",
        "unit": "",
        "expected": ledger.REPRODUCED,
    }
    return Claim(**{**base, **fields})


def bound(printed, **fields):
    return claim(kind="bound", printed=printed, **fields)


# ---- digits ----


@pytest.mark.parametrize(
    ("printed", "half"),
    [
        ("0.8373", Fraction(5, 100000)),
        ("20", Fraction(1, 2)),
        ("20.0", Fraction(5, 100)),
        ("-0.5000", Fraction(5, 100000)),
        ("+3", Fraction(1, 2)),
        ("1.50e2", Fraction(1, 2)),
        ("1e-3", Fraction(5, 10000)),
        ("2E3", Fraction(500)),
        ("0", Fraction(1, 2)),
    ],
)
def test_half_width_is_half_a_unit_of_the_last_printed_digit(printed, half):
    assert ledger.half_width(printed) == pytest.approx(float(half), rel=1e-15)


@pytest.mark.parametrize("i", range(-130, 131))
def test_truncate_keeps_a_number_that_has_no_more_decimals(i):
    value = i / 100  # 0.29 * 100 = 28.999999999999996 is the trap
    assert ledger.truncate(value, "0.00") == value


@pytest.mark.parametrize(
    ("value", "printed", "expected"),
    [
        (0.87999, "0.8731", 0.8799),
        (0.28999, "0.28", 0.28),
        (-0.28999, "0.28", -0.28),  # cut, not rounded down
        (1.9999, "2", 1.0),
        (-1.9999, "2", -1.0),
        (0.00004, "0.0001", 0.0),
        (123.456, "12", 123.0),
        (1e-7, "0.01", 0.0),  # repr in scientific notation
        (1.2345e20, "1.0", 1.2345e20),
        (0.29 * 100, "29", 28.0),  # the float is below 29, and so says the cut
    ],
)
def test_truncate_cuts_toward_zero(value, printed, expected):
    assert ledger.truncate(value, printed) == expected


# ---- verdicts ----


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("printed", ["0.8373", "-1.6234", "20", "16.7", "0"])
def test_verdict_of_a_number_flips_just_beyond_half_a_digit(printed, sign):
    half = ledger.half_width(printed)
    inside, outside = (float(printed) + sign * half * f for f in (0.999999, 1.000001))
    assert judge(claim(printed=printed), inside).verdict == ledger.REPRODUCED
    assert judge(claim(printed=printed), outside).verdict == ledger.NOT_REPRODUCED


def test_a_number_exactly_half_a_digit_away_is_reproduced():
    assert judge(claim(printed="0.25"), 0.255).verdict == ledger.REPRODUCED
    assert judge(claim(printed="3"), 3.5).verdict == ledger.REPRODUCED


def test_a_tolerance_of_its_own_replaces_half_a_digit():
    own = claim(printed="600", tolerance=20.0, tolerance_reason="about")
    assert judge(own, 619.99).verdict == ledger.REPRODUCED
    assert judge(own, 620.01).verdict == ledger.NOT_REPRODUCED
    exact = claim(printed="6", tolerance=0.0, tolerance_reason="a count")
    assert judge(exact, 6).verdict == ledger.REPRODUCED
    assert judge(exact, 6.0001).verdict == ledger.NOT_REPRODUCED


def test_a_list_is_judged_number_by_number_with_the_digits_of_each():
    digits = claim(kind="list", printed="1;-1.1748;0.29")
    assert judge(digits, [1.49, -1.17484, 0.2949]).verdict == ledger.REPRODUCED
    for bad in ([1.51, -1.1748, 0.29], [1, -1.17486, 0.29], [1, -1.1748, 0.2951]):
        assert judge(digits, bad).verdict == ledger.NOT_REPRODUCED
    with pytest.raises(ValueError, match=r"3 number.*given 2"):
        judge(digits, [1.0, -1.1748])


@pytest.mark.parametrize(
    ("printed", "good", "bad"),
    [
        ("<20", [19.999, -50.0], [20.0, 20.001]),
        (">1.5", [1.5001, 1e9], [1.5, -2.0]),
        ("<1e-3", [0.0009], [0.0011]),
        (">-2", [-1.9], [-2.1]),
        ("+-50", [50.0, -50.0, 0.0], [50.001, -50.001]),
        ("+-0.3", [-0.3], [0.31]),
    ],
)
def test_bounds_hold_up_to_their_edge(printed, good, bad):
    for value in good:
        assert judge(bound(printed), value).verdict == ledger.REPRODUCED, value
    for value in bad:
        assert judge(bound(printed), value).verdict == ledger.NOT_REPRODUCED, value


def test_a_bound_holds_only_when_every_value_obeys():
    assert judge(bound("<20"), [1.0, 19.0]).verdict == ledger.REPRODUCED
    assert judge(bound("<20"), [1.0, 21.0]).verdict == ledger.NOT_REPRODUCED
    assert judge(bound("+-50"), np.array([-49.0, 51.0])).verdict == ledger.NOT_REPRODUCED


@pytest.mark.parametrize(
    ("printed", "ends"),
    [("0<k_r<2", (0, 2)), ("6<=N<=10", (6, 10)), ("0.6<k_r<1.4", (0.6, 1.4)), ("-1<=x<2", (-1, 2))],
)
def test_a_range_compares_its_two_ends(printed, ends):
    low, high = ends
    own = bound(printed, tolerance=0.01, tolerance_reason="a scan in steps of 0.02")
    assert judge(own, [low + 0.0099, high - 0.0099]).verdict == ledger.REPRODUCED
    assert judge(own, [low - 0.011, high]).verdict == ledger.NOT_REPRODUCED
    assert judge(own, [low, high + 0.011]).verdict == ledger.NOT_REPRODUCED
    with pytest.raises(ValueError, match="2 number"):
        judge(own, low)


@pytest.mark.parametrize("printed", ["about 20", "=<20", "20<", "0<k_r", "+-", "1<a b<2", ""])
def test_a_bound_that_cannot_be_read_is_refused(printed):
    with pytest.raises(ValueError, match="cannot be read as a bound; write"):
        judge(bound(printed), 1.0)


def test_statements_are_true_or_false_and_nothing_else():
    says = claim(kind="statement", printed="")
    assert judge(says, True).verdict == judge(says, np.bool_(True)).verdict == ledger.REPRODUCED
    assert judge(says, False).verdict == ledger.NOT_REPRODUCED
    assert judge(says, np.array(3) > 2, margin=0.4).computed == {"holds": True, "margin": 0.4}
    for value in (1, 0.0, [True], np.array([True, True])):
        with pytest.raises(ValueError, match="True or False"):
            judge(says, value)


def test_corrected_route_is_taken_only_when_the_plain_reading_fails():
    own = claim(expected=ledger.CORRECTED, erratum="eq25")
    both = judge(own, 0.83731, corrected=0.83732)
    assert (both.verdict, both.computed) == (ledger.REPRODUCED, 0.83731)
    assert not both.as_expected
    mended = judge(own, 0.9, corrected=0.83732)
    assert (mended.verdict, mended.computed) == (ledger.CORRECTED, 0.83732)
    assert mended.evidence["plain"] == 0.9 and mended.as_expected
    neither = judge(own, 0.9, corrected=0.8)
    assert (neither.verdict, neither.computed) == (ledger.NOT_REPRODUCED, 0.9)
    statement = judge(claim(kind="statement", erratum="eq25"), False, corrected=True)
    assert statement.verdict == ledger.CORRECTED


def test_misprinted_digits_are_compared_with_what_the_erratum_makes_of_them():
    own = claim(printed="1.6458", mended="1.6471", expected=ledger.CORRECTED, erratum="eq17")
    exact = 0.14 * 3.43**2
    assert judge(own, exact, corrected=exact).verdict == ledger.CORRECTED
    assert judge(own, 1.6458, corrected=exact).verdict == ledger.REPRODUCED
    assert judge(own, 1.65, corrected=1.65).verdict == ledger.NOT_REPRODUCED
    assert judge(own, exact).verdict == ledger.NOT_REPRODUCED  # nothing corrected was given


def test_a_measurement_is_not_computable():
    own = claim(kind="measurement", expected=ledger.NOT_COMPUTABLE, reason="cut on a machine")
    assert judge(own).verdict == ledger.NOT_COMPUTABLE
    assert judge(own, samples=6).computed == {"samples": 6}


@pytest.mark.parametrize("kind", ["number", "list", "bound", "statement"])
def test_everything_but_a_measurement_needs_a_value(kind):
    with pytest.raises(ValueError, match="needs a computed value"):
        judge(claim(kind=kind, printed="<1" if kind == "bound" else "1"))


@pytest.mark.parametrize("bad", [math.nan, np.nan, [0.8373, math.nan], np.array([np.nan])])
def test_nan_is_no_result(bad):
    with pytest.raises(ValueError, match="NaN"):
        judge(claim(), bad)
    with pytest.raises(ValueError, match="NaN"):
        judge(claim(), 0.8373, corrected=bad)
    with pytest.raises(ValueError, match="NaN"):
        judge(claim(), 0.8373, evidence=bad)


@pytest.mark.parametrize("bad", ["0.8373", 1j, {"a": 1}, object()])
def test_what_is_no_number_is_refused(bad):
    with pytest.raises(ValueError, match="neither a real number"):
        judge(claim(), bad)


@pytest.mark.parametrize("infinite", [math.inf, -math.inf])
def test_a_time_never_reached_is_not_reproduced_and_shows_its_evidence(infinite):
    own = judge(claim(printed="0.6", reason="spread {spread:.2f}"), infinite, spread=0.25)
    assert own.verdict == ledger.NOT_REPRODUCED and own.computed == {"spread": 0.25}


# ---- reasons ----


def test_reason_quotes_the_evidence():
    own = claim(reason="{printed} is printed, {value:.3f} comes out, gain {gain:.1f}")
    assert judge(own, 0.9, gain=0.75).reason == "0.8373 is printed, 0.900 comes out, gain 0.8"
    with pytest.raises(ValueError, match=r"quotes \['gain'\]"):
        judge(own, 0.9)


def test_evidence_becomes_plain_python():
    own = judge(claim(), np.float64(0.8373), a=np.int64(3), b=np.bool_(True), c=np.array(2.0))
    assert own.evidence == {"a": 3, "b": True, "c": 2.0}
    assert [type(own.evidence[k]) for k in "abc"] == [int, bool, float]
    assert type(own.computed) is float


# ---- data files ----

GOOD = """
key = "paper"
title = "A title"
citation = "A. Author, A Paper"
notebook = "paper.ipynb"
chapter = 1
[idea]
cite = "horng1989"
loop = "one"
index = "time"
period = "a turn"
[conventions]
primary = { title = "Plain", text = "as printed" }
cut = { title = "Cut", text = "digits are cut" }
[errata.eq25]
where = "eq. 25"
printed = "a"
corrected = "b"
why = "a slip"
[changes.gain]
what = "the gain"
sizes = [0.01, 0.1]
apply = "pass"
[[claims]]
id = "paper.a"
where = "eq. 1"
kind = "number"
says = "pole"
printed = "0.84"
unit = ""
expected = "reproduced"
role = "headline"
flips_under = "gain"
[[claims]]
id = "paper.b"
where = "fig. <2>"
kind = "number"
says = "time & <b>place</b>"
printed = "0.6"
unit = "s"
expected = "not reproduced"
role = "result"
reason = "it takes {value:.2f} s"
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "papers").mkdir()
    monkeypatch.setattr(importlib.resources, "files", lambda package: tmp_path)

    def write(text, key="paper"):
        (tmp_path / "papers" / f"{key}.toml").write_text(text, encoding="utf-8")

    write(GOOD)
    return write


def test_a_good_file_loads(folder):
    paper = ledger.load("paper")
    assert list(paper.claims) == ["paper.a", "paper.b"]
    assert paper.claims["paper.a"].printed == "0.84"  # a string: its digits stay
    folder(GOOD.replace("paper.", "other."), "other")
    assert ledger.papers() == ("other", "paper")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('id = "paper.b"', 'id = "paper.a"', r"paper\.a stands twice.*remove"),
        ('id = "paper.b"', 'id = "b"', "b: .*begin with the paper's key"),
        ('kind = "number"', 'kind = "numeral"', "'numeral' is none of number"),
        ('expected = "reproduced"', 'expected = "fine"', "'fine' is none of reproduced"),
        (
            'unit = ""',
            'unit = ""\nconvention = "lost"',
            "'lost' is none of primary, cut",
        ),
        ('unit = ""', 'unit = ""\nerratum = "eq9"', "erratum 'eq9' is none of eq25"),
        ('unit = ""', 'unit = ""\ntolerance = 0.1', "needs a tolerance_reason"),
        ('unit = ""', 'unit = ""\ntolerance_reason = "so"', "the other way round"),
        ('kind = "number"', 'kind = "measurement"', "a measurement, or what says"),
        ('expected = "reproduced"', 'expected = "not computable"', "a measurement, or what says"),
        ('reason = "it takes {value:.2f} s"', "", "gives no reason"),
        ("it takes {value:.2f} s", "it is wrong", "quotes nothing computed.*braces"),
        ('expected = "reproduced"', 'expected = "reproduced with correction"', "names its erratum"),
        ("[conventions]", "[conventions", r"line \d"),
    ],
)
def test_a_bad_file_is_refused_with_a_reason(folder, old, new, message):
    assert old in GOOD
    folder(GOOD.replace(old, new, 1))
    with pytest.raises(ValueError, match=rf"paper\.toml.*{message}"):
        ledger.load("paper")


def test_an_unknown_paper_is_refused_with_the_known_ones(folder):
    with pytest.raises(ValueError, match=r"no paper 'papre'.*paper"):
        ledger.load("papre")


OWN = 'unit = ""\ntolerance = {}\ntolerance_reason = "no"'


@pytest.mark.parametrize(
    ("old", "new"),
    [
        pytest.param('says = "pole"\n', "", id="a field is missing"),
        pytest.param('unit = ""', 'unit = ""\ncolour = "red"', id="unknown field"),
        pytest.param('citation = "A. Author, A Paper"', "", id="no citation"),
        pytest.param('printed = "0.84"', "printed = 0.84", id="digits not a string"),
        pytest.param('printed = "0.84"', 'printed = "3/8"', id="not a number"),
        pytest.param('printed = "0.84"', 'printed = "nan"', id="printed NaN"),
        pytest.param('printed = "0.84"', 'printed = "0.84;0.29"', id="two numbers for one"),
        pytest.param('unit = ""', OWN.format(-0.1), id="negative tolerance"),
        pytest.param('unit = ""', OWN.format("nan"), id="NaN tolerance"),
        pytest.param('unit = ""', OWN.format("inf"), id="infinite tolerance"),
    ],
)
def test_a_malformed_file_is_a_value_error_naming_the_claim_or_file(folder, old, new):
    assert old in GOOD
    folder(GOOD.replace(old, new, 1))
    with pytest.raises(ValueError, match=r"paper\.toml"):
        ledger.load("paper")


# ---- roles and words ----


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('why = "a slip"\n', "", r"paper\.toml, \[errata\.eq25\]: lacks why; add it"),
        ('key = "paper"', 'key = "other"', "its key is 'other'; make it 'paper'"),
        ("chapter = 1", 'chapter = "1"', r"paper\.toml: chapter = '1' is no int"),
        ("chapter = 1", "chapter = true", "chapter = True is no int"),
        ('title = "A title"', "title = 3", "title = 3 is no str"),
        ('notebook = "paper.ipynb"', 'notebook = "../a.ipynb"', "give the name of a notebook"),
        ('unit = ""', "unit = 3", r"paper\.toml, paper\.a: unit = 3; give a text in quotes"),
        ("sizes = [0.01, 0.1]", "sizes = [true]", "give one or more above 0"),
        ("sizes = [0.01, 0.1]", 'sizes = "x"', "give one or more above 0"),
        ('apply = "pass"', 'apply = "import rcbook.ledger"', "it reaches for the verdicts"),
        ('key = "paper"', 'key = "paper"\nkey = "paper"', r"paper\.toml: .*mend it there"),
        ("{value:.2f} s", "{value.real} s", "is no name of a piece of evidence"),
        ("{value:.2f} s", "{0} s", "is no name of a piece of evidence"),
        ('why = "a slip"', 'because = "a slip"\nwhy = ""', r"\[errata\.eq25\]: unknown because"),
        ('cite = "horng1989"\n', "", r"paper\.toml, \[idea\]: lacks cite"),
        (
            '{ title = "Cut", text = "digits are cut" }',
            '"cut"',
            r"\[conventions\.cut\]: 'cut' is no",
        ),
        ('apply = "pass"\n', "", r"\[changes\.gain\]: lacks apply"),
        ("sizes = [0.01, 0.1]", "sizes = []", r"\[changes\.gain\]: sizes \[\]; give one"),
        ("chapter = 1\n", "chapter = 1\ncolour = 2\n", "unknown part colour; remove it"),
        ("{value:.2f} s", "{value:.2f s", "its reason cannot be read"),
    ],
)
def test_what_is_missing_unknown_or_unreadable_is_named_with_its_place(folder, old, new, message):
    assert old in GOOD
    folder(GOOD.replace(old, new, 1))
    with pytest.raises(ValueError, match=message):
        ledger.load("paper")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('role = "headline"\n', "", "lacks role"),
        ('role = "headline"', 'role = "title"', "role 'title' is none of headline"),
        ('flips_under = "gain"', 'flips_under = "grain"', "flips_under 'grain' is none of gain"),
        ('role = "headline"', 'role = "input"', "an input has no verdict to flip"),
        ('flips_under = "gain"', 'word = "roughly"', "word 'roughly' is none of theorem"),
        (
            'flips_under = "gain"',
            'word = "about"\ntolerance = 0.1\ntolerance_reason = "so"',
            "a word and a tolerance of its own",
        ),
        ("chapter = 1\n", "", r"lacks chapter"),
    ],
)
def test_roles_changes_and_words_are_known_ones(folder, old, new, message):
    assert old in GOOD
    folder(GOOD.replace(old, new, 1))
    with pytest.raises(ValueError, match=message):
        ledger.load("paper")


def test_one_table_says_what_a_word_means_in_every_paper():
    """Ten percent of what is printed for about; the error of a root finder for a theorem."""
    about = claim(printed="500", word="about")
    assert judge(about, 549.9).verdict == ledger.REPRODUCED
    assert judge(about, 550.1).verdict == ledger.NOT_REPRODUCED
    coarse = claim(printed="2", word="about")  # never finer than the digits that are printed
    assert judge(coarse, 2.45).verdict == ledger.REPRODUCED
    range_ = bound("0<k<2", word="theorem")
    assert judge(range_, [0.0, 2 + 0.9e-6]).verdict == ledger.REPRODUCED
    assert judge(range_, [0.0, 2 + 1.1e-6]).verdict == ledger.NOT_REPRODUCED


def test_a_word_gives_its_number_and_one_that_has_none_is_refused():
    assert ledger.word("hardly") == ledger.word("slight") == 0.1
    assert ledger.word("significant") == 2.0
    for name in ("satisfactory", "roughly"):
        with pytest.raises(ValueError, match=f"no number is declared for the word '{name}'"):
            ledger.word(name)


def test_no_word_stands_in_two_rows():
    names = [name for row in ledger.WORDS.values() for name in row.words]
    assert len(names) == len(set(names))


def test_marks_of_numbers_are_not_shown(folder):
    folder(GOOD.replace("it takes {value:.2f} s", "it takes 3 s<!-- paper: p. 2 -->, {value:.1f}"))
    book = Ledger.of("paper")
    assert book.check("paper.b", 1.25).reason == "it takes 3 s, 1.2"


def test_a_value_and_its_evidence_can_be_asked_for(folder):
    book = Ledger.of("paper")
    book.check("paper.b", 1.25, other=3.5)
    assert book.value("paper.b") == 1.25 and book.value("paper.b", "other") == 3.5
    with pytest.raises(ValueError, match=r"paper\.a is not judged yet"):
        book.value("paper.a")
    with pytest.raises(ValueError, match="no evidence 'late'; it has other"):
        book.value("paper.b", "late")


# ---- further chapters ----


FURTHER = """
[[further]]
notebook = "more.ipynb"
title = "More"
idea = { cite = "x", loop = "a 2<!-- chosen: to see --> loop", index = "time", period = "a turn" }
"""


def test_a_further_chapter_is_read_from_the_data_file(folder):
    folder(GOOD + FURTHER)
    (_, more) = ledger.load("paper").chapters
    assert (more.notebook, more.title) == ("more.ipynb", "More")
    assert more.idea["loop"] == "a 2 loop"
    assert Ledger.of("paper", "more.ipynb").missing() == []
    with pytest.raises(ValueError, match=r"no chapter 'less\.ipynb'; it has .*, more\.ipynb"):
        Ledger.of("paper", "less.ipynb")


@pytest.mark.parametrize(
    ("spoiled", "said"),
    [
        (FURTHER.replace("[[further]]", "[further]"), "is no list"),
        (FURTHER.replace('title = "More"', ""), "title is missing or unknown"),
        (FURTHER.replace('"More"', '" "'), "give a title"),
        (FURTHER + 'colour = "red"', "colour is missing or unknown"),
        (FURTHER.replace("more.ipynb", "more.py"), "give the name of a notebook"),
        (FURTHER + FURTHER, "more.ipynb'; give the name of a notebook, once"),
        (FURTHER.replace('cite = "x", ', ""), "lacks cite"),
    ],
)
def test_a_chapter_that_cannot_be_read_is_refused(folder, spoiled, said):
    folder(GOOD + spoiled)
    with pytest.raises(ValueError, match=said):
        ledger.load("paper")


def test_a_claim_in_an_unknown_notebook_is_refused(folder):
    folder(GOOD.replace('id = "paper.a"', 'id = "paper.a"\nnotebook = "more.ipynb"'))
    with pytest.raises(ValueError, match=r"notebook 'more\.ipynb' is none of"):
        ledger.load("paper")


# ---- the ledger ----


def filled(folder):
    book = Ledger.of("paper")
    assert book.missing() == ["paper.a", "paper.b"]
    book.check("paper.b", 1.25)
    assert book.missing() == ["paper.a"]
    book.check("paper.a", 0.8373150978123456)
    return book


def test_rows_come_in_the_order_of_the_paper_with_the_contract_fields(folder):
    first, second = filled(folder).rows()
    assert (first["id"], second["id"]) == ("paper.a", "paper.b")
    contract = "id paper where says printed unit computed verdict expected_verdict tolerance"
    contract += " convention reason erratum notebook kind reading tolerance_reason evidence role"
    contract += " flips_under"
    assert set(contract.split()) <= set(first)
    assert first["computed"] == 0.8373150978123456 and first["tolerance"] == 0.005
    assert first["convention"] == "as printed" and first["role"] == "headline"
    assert first["flips_under"] == "the gain" and second["flips_under"] == ""
    assert second["verdict"] == second["expected_verdict"] == "not reproduced"
    assert second["reason"] == "it takes 1.25 s"


def test_json_round_trip_keeps_full_precision(folder):
    book = filled(folder)
    text = ledger.dumps(book.rows())
    assert json.loads(text) == book.rows() and text.endswith("]\n")
    assert json.loads(text)[0]["computed"] == 0.8373150978123456


def test_infinities_are_null_in_the_file(folder):
    book = Ledger.of("paper")
    book.check("paper.b", math.inf, time=math.inf, other=-math.inf)
    row = json.loads(ledger.dumps(book.rows()))[0]
    assert row["evidence"] == {"time": None, "other": None}
    assert row["reason"] == "it takes inf s"


def test_unknown_claims_are_refused(folder):
    with pytest.raises(ValueError, match=r"no claim 'paper\.c'"):
        Ledger.of("paper").check("paper.c", 1.0)


def test_a_second_check_replaces_the_first(folder):
    book = filled(folder)
    book.check("paper.a", 0.5)
    assert book.rows()[0]["verdict"] == ledger.NOT_REPRODUCED and len(book.rows()) == 2
    assert "EXPECTED: reproduced" in repr(book.judgements["paper.a"])


def test_latest_shows_what_was_checked_since_the_last_call(folder):
    book = filled(folder)
    assert [row["id"] for row in book.latest().rows] == ["paper.b", "paper.a"]
    assert book.latest().rows == []
    assert len(book.rows()) == 2  # showing takes nothing out of the ledger


def test_latest_shows_a_claim_checked_twice_once(folder):
    book = Ledger.of("paper")
    book.check("paper.a", 0.1)
    book.check("paper.a", 0.84)
    assert len(book.latest().rows) == 1


def test_html_escapes_everything_a_paper_can_say(folder):
    folder(GOOD.replace("it takes", "<script>alert('&')</script> it takes"))
    bundle = filled(folder)._repr_mimebundle_()
    page = bundle["text/html"]
    assert "<script>" not in page and "&lt;script&gt;alert('&amp;')" in page
    assert "<b>place</b>" not in page and "time &amp; &lt;b&gt;place" in page
    assert "fig. &lt;2&gt;" in page
    assert bundle[ledger.MIME] == filled(folder).rows()
    assert "paper.a: printed 0.84, ours 0.837315: reproduced" in bundle["text/plain"]


def test_html_says_when_a_verdict_is_not_the_expected_one(folder):
    book = Ledger.of("paper")
    book.check("paper.a", 0.9)
    assert "(expected: reproduced)" in show.table(book.rows())
    assert "(expected" not in show.table(filled(folder).rows())


def test_a_computation_is_one_line_that_unfolds_to_its_claims(folder):
    book = filled(folder)
    page = book.latest()._repr_mimebundle_()["text/html"]
    line, table = page.split("</summary>")
    assert line.startswith("<details") and "2 claims: " in line
    assert "1 reproduced</span>" in line and "1 not reproduced</span>: <code>paper.b</code>" in line
    assert "paper.a" not in line  # what is reproduced is counted and not named
    assert table.count("<tr") == 3 and 'id="claim-paper.a"' in table
    assert show.folded([]) == ""


def test_a_flipped_verdict_stands_unfolded(folder):
    book = Ledger.of("paper")
    book.check("paper.a", 0.9)
    assert (
        '<details class="rcbook-verdicts" open>' in book.latest()._repr_mimebundle_()["text/html"]
    )
    assert " open>" in book._repr_mimebundle_()["text/html"]
    assert " open>" not in filled(folder)._repr_mimebundle_()["text/html"]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("$a < b$ & c", r"\(a &lt; b\) &amp; c"),
        ("V_r(k-1) of k_r = 0.8", r"\(V_{r}(k-1)\) of \(k_{r}\) = 0.8"),
        ("cos a_out, x_10", r"cos \(a_{\mathrm{out}}\), \(x_{\mathrm{10}}\)"),
        ("keep_negative and_so_on, a_ _b", "keep_negative and_so_on, a_ _b"),
    ],
)
def test_symbols_are_typeset(text, shown):
    bare = show.math(text).replace('<span class="math notranslate nohighlight">', "")
    assert bare.replace("</span>", "") == shown


@pytest.mark.parametrize(
    ("printed", "unit", "shown"),
    [
        ("0.75;0.24;3.1", "1;1;lb/mV", "0.75; 0.24; 3.1 lb/mV"),
        ("0.75;0.24", "N", "0.75; 0.24 N"),
        ("0.75; 0.24", "1", "0.75; 0.24"),
        ("4", "N; mm", "4 N; mm"),
    ],
)
def test_each_printed_number_has_its_unit(printed, unit, shown):
    assert show.printed({"kind": "list", "printed": printed, "unit": unit}) == shown


@pytest.mark.parametrize(
    ("computed", "shown"),
    [
        (None, "-"),
        (True, "holds"),
        (False, "does not hold"),
        ({"holds": False, "gain": 2.0}, "does not hold"),
        ({"gain": 2.0, "fast": True}, "see reason"),
        ([1.0, 0.123456789], "1; 0.123457"),
        (6, "6"),
    ],
)
def test_values_are_rounded_for_reading(computed, shown):
    assert show.value(computed) == shown


def test_only_a_named_paper_of_the_package_is_read_from_the_package():
    """Without the temporary folder: the package's own data load and validate."""
    for key in ledger.papers():
        paper = ledger.load(key)
        assert isinstance(paper, Paper) and paper.claims
        for own in paper.claims.values():
            ledger.tolerances(own)


# ---- defects ----


@pytest.mark.parametrize("printed", ["<20", "+-50"])
def test_an_empty_list_proves_no_bound(printed):
    with pytest.raises(ValueError, match="paper"):
        judge(bound(printed), [])


@pytest.mark.parametrize(
    "own", [claim(printed="1"), bound("<20"), claim(kind="list", printed="1;0")]
)
def test_a_boolean_is_no_number(own):
    with pytest.raises(ValueError, match="paper"):
        judge(own, [True, False] if own.kind == "list" else True)


@pytest.mark.parametrize("own", [claim(kind="list", printed="1;2"), bound("<20")])
def test_a_table_is_no_list(own):
    with pytest.raises(ValueError, match="paper"):
        judge(own, np.ones((2, 2)))


def test_evidence_cannot_overwrite_a_statement():
    with pytest.raises(ValueError, match="holds"):
        judge(claim(kind="statement"), True, holds=False)


def test_a_reason_that_quotes_a_missing_correction_says_so():
    with pytest.raises(ValueError, match="corrected"):
        judge(claim(reason="corrected: {corrected:.3f}"), 0.9)


def test_a_value_for_a_measurement_is_refused():
    with pytest.raises(ValueError, match="measurement"):
        judge(claim(kind="measurement", expected=ledger.NOT_COMPUTABLE, reason="lost"), 3.0)


def test_evidence_is_flat():
    with pytest.raises(ValueError, match=r"poles.*one by one"):
        judge(claim(kind="statement"), True, poles=[0.9, 0.1])


@pytest.mark.parametrize(
    "call",
    [
        lambda: ledger.half_width("3/8"),
        lambda: ledger.half_width("nan"),
        lambda: ledger.truncate(math.inf, "1.0"),
        lambda: ledger.truncate(1.0, "x"),
    ],
)
def test_digits_of_what_is_no_number_are_refused(call):
    with pytest.raises(ValueError, match=r"3/8|nan|inf|x"):
        call()


# ---- intervals, weak inequalities, and what is lost ----


@pytest.mark.parametrize(
    ("printed", "inside", "outside"),
    [("0..1", [0.0, 0.17, 1.0], [0.5, 1.001]), ("<=1", 1.0, 1.0001), (">=2", 2.0, 1.9999)],
)
def test_closed_intervals_hold_their_ends(printed, inside, outside):
    assert judge(bound(printed), inside).verdict == ledger.REPRODUCED
    assert judge(bound(printed), outside).verdict == ledger.NOT_REPRODUCED


def test_what_needs_something_lost_is_not_computable_and_takes_no_value():
    own = claim(
        kind="statement", lost="fig. 17", expected=ledger.NOT_COMPUTABLE, reason="{share:.0%} do"
    )
    judged = judge(own, share=0.5)
    assert judged.verdict == ledger.NOT_COMPUTABLE and judged.as_expected
    assert judged.computed == {"share": 0.5} and judged.reason == "50% do"
    with pytest.raises(ValueError, match="lost"):
        judge(own, True)


def test_a_shown_ledger_tabulates_all_but_the_reproduced_and_delivers_all(folder):
    book = filled(folder)
    bundle = book._repr_mimebundle_()
    assert len(bundle[ledger.MIME]) == 2
    assert "2 claims, 2 of them results (1 headline): 1 reproduced" in bundle["text/html"]
    assert "<code>paper.a</code>" not in bundle["text/html"]
    book.check("paper.a", 0.9)  # flipped: now it is shown
    assert "<code>paper.a</code>" in book._repr_mimebundle_()["text/html"]
