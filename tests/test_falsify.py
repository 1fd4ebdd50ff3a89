"""Every scored verdict can fail: a stated change of the model turns it, and here it is applied."""

import math
from dataclasses import replace

import nbformat
import pytest
from conftest import ROOT

from rcbook import ledger
from rcbook.book import falsify
from rcbook.book.falsify import Trial
from rcbook.ledger import Claim, Paper

PAPERS = [ledger.load(key) for key in ledger.papers()]
each = pytest.mark.parametrize("paper", PAPERS, ids=lambda paper: paper.key)


# ---- the papers of the book ----


@pytest.fixture(scope="module")
def tried():
    """Per paper the notebook as it is and under every change at its largest size."""
    cache = {}

    def tried(paper):
        if paper.key not in cache:
            largest = [(name, falsify.sizes(c)[-1]) for name, c in paper.changes.items()]
            wanted = [("", None), *largest]
            cache[paper.key] = falsify.trials(paper, ROOT / "notebooks", wanted)
        return cache[paper.key]

    return tried


@each
def test_without_a_change_every_verdict_is_the_expected_one(paper, tried):
    plain = tried(paper)[0]
    assert not plain.troubles
    assert plain.verdicts == {id: claim.expected for id, claim in paper.claims.items()}


@each
def test_every_scored_verdict_flips_under_the_change_that_it_names(paper, tried):
    lacking = falsify.unflipped(paper, tried(paper))
    assert not lacking, "\n".join(lacking)


@each
def test_every_change_is_named_by_a_claim(paper):
    named = {claim.flips_under for claim in paper.claims.values()}
    assert set(paper.changes) <= named


@each
def test_stored_margins_are_of_scored_claims_and_known_changes(paper):
    for id, margin in paper.margins.items():
        assert paper.claims[id].role in ledger.SCORED
        assert margin["what"] == paper.changes[margin["change"]]["what"]
        assert margin["flips"] in paper.changes[margin["change"]]["sizes"]
        assert margin["keeps"] < margin["flips"]
        assert margin["about"] is None or margin["keeps"] <= margin["about"] <= margin["flips"]


@each
def test_every_computed_number_has_a_margin(paper):
    """How far the most telling parameter may move is known for each number of the score."""
    for claim in paper.claims.values():
        computed = claim.role in ledger.SCORED and claim.expected != ledger.NOT_COMPUTABLE
        if computed and claim.kind == "number" and "sizes" in paper.changes[claim.flips_under]:
            assert claim.id in paper.margins, claim.id


# ---- the machinery, on a paper of one line ----


CHANGE = "import math\nmath.pi = math.pi * (1 + size)"
CODE = """import math
from fake import ledger
ledger.check("fake.area", math.pi)
ledger.check("fake.mad", 1.0 / (math.pi < 3.2))
ledger.check("fake.safe", 1.0)"""


def paper(**changes):
    claims = [
        Claim(f"fake.{name}", "fake", "eq. 1", "number", "It.", printed, "1", "reproduced")
        for name, printed in (("area", "3.14"), ("mad", "1"), ("safe", "1"))
    ]
    return Paper("fake", "Fake", "Nobody.", "one.ipynb", 1, {}, {}, {}, changes,
                 {claim.id: claim for claim in claims})  # fmt: skip


def named(what, **names):
    claims = {id: replace(c, flips_under=names.get(id[5:], "")) for id, c in what.claims.items()}
    return replace(what, claims=claims)


@pytest.fixture
def folder(tmp_path):
    module = "from rcbook.ledger import Claim, Ledger, Paper\n"
    module += "claims = {c: Claim(c, 'fake', 'x', 'number', 'It.', p, '1', 'reproduced')\n"
    module += "  for c, p in (('fake.area', '3.14'), ('fake.mad', '1'), ('fake.safe', '1'))}\n"
    module += "ledger = Ledger(Paper('fake', 't', 'c', 'one.ipynb', 1, {}, {'primary': "
    module += "{'title': 't', 'text': 't'}}, {}, {}, claims))\n"
    (tmp_path / "fake.py").write_text(module, encoding="utf-8")
    cells = [nbformat.v4.new_code_cell(CODE), nbformat.v4.new_code_cell("1 / 0")]
    cells[1].metadata["tags"] = [falsify.SKIP]
    nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / "one.ipynb")
    return tmp_path


GROW = {"what": "the ratio of a circle", "sizes": [0.001, 0.04, 0.0001], "apply": CHANGE}


def test_a_change_turns_what_it_should_and_a_statement_that_fails_takes_no_other_with_it(folder):
    here = named(paper(grow=GROW), area="grow", mad="grow", safe="grow")
    plain, grown = falsify.trials(here, folder, [("", None), ("grow", 0.04)])
    assert set(plain.verdicts.values()) == {"reproduced"} and not plain.troubles
    assert grown.verdicts == {"fake.area": "not reproduced", "fake.safe": "reproduced"}
    assert len(grown.troubles) == 1 and "ZeroDivisionError" in grown.troubles[0]
    assert falsify.unflipped(here, [grown]) == [
        "fake.mad: not reached under 'grow'",
        "fake.safe: still reproduced under 'grow'",
    ]


def test_margins_bracket_the_size_that_flips(folder):
    """pi leaves 3.135 .. 3.145 when it grows to 3.145; the number is linear in the size."""
    here = named(paper(grow=GROW), area="grow", mad="grow", safe="grow")
    tried = falsify.trials(here, folder, [("grow", size) for size in falsify.sizes(GROW)])
    margin = falsify.margins(here, tried)["fake.area"]
    assert margin.pop("about") == pytest.approx(3.145 / math.pi - 1, rel=1e-9)
    assert margin == {
        "change": "grow",
        "what": "the ratio of a circle",
        "unit": "relative",
        "keeps": 0.001,
        "flips": 0.04,
    }


def test_a_margin_below_the_smallest_size_is_measured_from_the_unchanged_model(folder):
    grow = GROW | {"sizes": [0.04]}
    here = named(paper(grow=grow), area="grow")
    margin = falsify.margins(here, falsify.trials(here, folder, [("", None), ("grow", 0.04)]))
    assert margin["fake.area"]["keeps"] == 0.0
    assert margin["fake.area"]["about"] == pytest.approx(3.145 / math.pi - 1, rel=1e-9)


def test_no_line_is_drawn_to_a_number_that_has_run_away():
    here = named(paper(grow=GROW), area="grow")
    values = {"": 3.14159, "grow": 3.14 + 0.005 * (falsify.SHORT + 1)}
    tried = [
        Trial(name, size, {"fake.area": verdict}, {"fake.area": values[name]}, ())
        for name, size, verdict in (("", None, "reproduced"), ("grow", 0.1, "not reproduced"))
    ]
    assert falsify.margins(here, tried)["fake.area"]["about"] is None


def test_the_change_that_flips_first_is_the_most_telling():
    here = paper(a={"what": "a", "sizes": [0.1]}, b={"what": "b", "sizes": [0.01]})
    tried = [
        Trial(n, s, {"fake.area": "not reproduced"}, {}, ()) for n, s in (("a", 0.1), ("b", 0.01))
    ]
    assert falsify.margins(here, tried)["fake.area"]["change"] == "b"


def test_a_claim_without_a_change_is_told_apart_from_one_whose_change_was_not_tried():
    here = named(paper(grow=GROW), area="grow")
    problems = falsify.unflipped(here, [])
    assert problems[0] == "fake.area: its change 'grow' was not tried"
    assert "is it an identity?" in problems[1]


def test_an_identity_and_what_cannot_be_computed_need_no_change():
    here = paper()
    roles = ("identity", "input", "result")
    claims = {
        id: replace(c, role=role) for (id, c), role in zip(here.claims.items(), roles, strict=True)
    }
    claims["fake.safe"] = replace(claims["fake.safe"], expected=ledger.NOT_COMPUTABLE)
    assert not falsify.unflipped(replace(here, claims=claims), [])


def test_what_is_wrong_without_a_change_is_no_flip():
    here = named(paper(grow=GROW), area="grow", mad="grow", safe="grow")
    ids = list(here.claims)
    plain = Trial("", None, dict.fromkeys(ids, "not reproduced"), {}, ())
    grown = Trial("grow", 0.04, dict.fromkeys(ids, "not reproduced"), {}, ())
    assert len(falsify.unflipped(here, [plain, grown])) == 3


def test_an_old_value_is_no_result_of_a_statement_that_failed(folder):
    path = folder / "one.ipynb"
    notebook = nbformat.read(path, as_version=4)
    notebook.cells[0].source = (
        "import math\nfrom fake import ledger\nx = 3.0\nx = math.tau / 2\n"
        'ledger.check("fake.area", x)'
    )
    nbformat.write(notebook, path)
    lost = paper(lost={"what": "w", "apply": "import math\ndel math.tau"})
    (trial,) = falsify.trials(lost, folder, [("lost", None)])
    assert not trial.verdicts and len(trial.troubles) == 2


@pytest.mark.parametrize("apply", ["raise SystemExit(0)", "import os; os._exit(0)"])
def test_a_change_that_ends_the_program_is_refused(folder, apply):
    ends = paper(ends={"what": "w", "apply": apply})
    with pytest.raises(ValueError, match=r"fake.toml: change 'ends' does not run"):
        falsify.trials(ends, folder, [("ends", None)])


def test_an_unknown_change_and_one_that_does_not_run_are_refused(folder):
    with pytest.raises(ValueError, match=r"no change shrink"):
        falsify.trials(paper(), folder, [("shrink", None)])
    broken = paper(broken={"what": "w", "apply": "import nowhere"})
    with pytest.raises(ValueError, match=r"(?s)'broken'.*does not run.*nowhere"):
        falsify.trials(broken, folder, [("broken", None)])


# ---- what the command prints ----


def test_what_is_run_is_none_and_every_change_or_one_at_its_largest_or_every_size():
    here = paper(grow=GROW, lost={"what": "w", "apply": ""})
    assert falsify.wanted(here) == [("", None), ("grow", 0.04), ("lost", None)]
    assert falsify.wanted(here, "grow", every=True) == [
        ("grow", size) for size in (0.0001, 0.001, 0.04)
    ]


def test_trials_are_ordered_by_size_within_their_change():
    sizes = [("b", 0.2), ("a", None), ("b", 0.1), ("b", 0.3)]
    tried = falsify.by_size([Trial(name, size, {}, {}, ()) for name, size in sizes])
    assert [trial.size for trial in tried["b"]] == [0.1, 0.2, 0.3]
    assert [trial.size for trial in tried["a"]] == [None]


def test_the_command_says_what_turned_and_what_did_not(folder, capsys):
    here = named(paper(grow=GROW), area="grow", mad="grow", safe="grow")
    assert not falsify.falsify([here], folder)
    said = capsys.readouterr().out
    assert "fake, no change: 0 verdicts turned: \n" in said
    assert "fake, grow 0.04: 1 verdicts turned: fake.area\n    failed: " in said
    assert "UNFLIPPED fake.safe: still reproduced under 'grow'\n" in said
    assert said.splitlines()[-1] == "3 scored claims, 2 not shown to be falsifiable"


def test_one_change_is_tried_on_the_papers_that_have_it(folder, capsys):
    grown, other = paper(grow=GROW), replace(paper(), key="other")
    assert falsify.falsify([other, grown], folder, change="grow")
    assert "fake, grow 0.04: 1 verdicts turned" in capsys.readouterr().out
    with pytest.raises(ValueError, match=r"no change 'shrink' in the data of other, fake"):
        falsify.falsify([other, grown], folder, change="shrink")
