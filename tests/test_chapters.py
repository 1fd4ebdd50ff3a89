"""A paper in several chapters: each judges its own claims, and every place shows both."""

from dataclasses import replace

import nbformat
import pytest
from conftest import write_notebook

from rcbook.book import falsify, pages, preflight, run
from rcbook.book.project import Project
from rcbook.ledger import Chapter, Ledger

IDEA = {"cite": "francis1976", "loop": "a second loop", "index": "angle", "period": "two turns"}
FIRST = """from dataclasses import replace
from fake_paper import PAPER
from rcbook.ledger import Ledger
last = replace(PAPER.claims["fake.z"], notebook="two.ipynb")
paper = replace(PAPER, claims=PAPER.claims | {"fake.z": last})
ledger = Ledger(paper)"""
SECOND = FIRST.replace("(paper)", "(paper, notebook='two.ipynb')")
JUDGED = ['ledger.check("fake.x", 2.01)\nledger.check("fake.y", -0.5, 0.5)\nledger']
REST = ['for name in "z":\n    ledger.check(f"fake.{name}")\nledger']


@pytest.fixture
def two(make):
    """A sound project whose paper has two chapters."""
    made = make(one=[FIRST, *JUDGED], two=[SECOND, *REST])
    (paper,) = made.papers
    claims = paper.claims | {"fake.z": replace(paper.claims["fake.z"], notebook="two.ipynb")}
    further = [Chapter("two.ipynb", "The case two: more of it", IDEA)]
    project = Project(made.root, (replace(paper, claims=claims, further=further),))
    retitled(project, "two", "The case two: more of it")
    return project


def retitled(project, name, title):
    path = project.notebooks / f"{name}.ipynb"
    notebook = nbformat.read(path, as_version=4)
    notebook.cells[0].source = f"# {title}"
    nbformat.write(notebook, path)


# ---- the run ----


def test_both_notebooks_are_executed_and_each_row_names_its_own(two):
    judged = run.check_paper(two, two.papers[0])
    assert judged.ok
    places = {row["id"]: row["notebook"] for row in judged.rows}
    assert places == {"fake.x": "one.ipynb", "fake.y": "one.ipynb", "fake.z": "two.ipynb"}


def test_a_notebook_that_is_not_there_is_named(two):
    (two.notebooks / "two.ipynb").unlink()
    with pytest.raises(ValueError, match=r"its notebook .*two\.ipynb is not there"):
        run.check_paper(two, two.papers[0])


def test_a_change_is_tried_on_both_notebooks(two):
    (plain,) = falsify.trials(two.papers[0], two.notebooks, [("", None)])
    assert set(plain.verdicts) == {"fake.x", "fake.y", "fake.z"} and not plain.troubles


def test_a_statement_that_fails_is_named_with_its_notebook(two):
    write_notebook(two.notebooks / "two.ipynb", [SECOND, *REST, "1 / 0"])
    (plain,) = falsify.trials(two.papers[0], two.notebooks, [("", None)])
    (trouble,) = plain.troubles
    assert trouble.startswith("two.ipynb, ") and "ZeroDivisionError" in trouble


# ---- before the run ----


def test_two_sound_chapters_are_no_problem(two):
    assert not preflight.problems(two)


def test_a_claim_that_its_notebook_does_not_judge_and_one_that_another_judges(two):
    write_notebook(two.notebooks / "one.ipynb", [FIRST, *JUDGED, 'ledger.check("fake.z")'])
    write_notebook(two.notebooks / "two.ipynb", [SECOND])
    retitled(two, "two", "The case two: more of it")
    assert preflight.problems(two) == [
        "one.ipynb: it judges fake.z, which two.ipynb should; move the one or the other",
        "two.ipynb: it does not judge fake.z, which is its own; check it there",
    ]


def test_a_chapter_without_a_claim(two):
    (paper,) = two.papers
    claims = paper.claims | {"fake.z": replace(paper.claims["fake.z"], notebook="")}
    found = preflight.problems(Project(two.root, (replace(paper, claims=claims),)))
    assert "fake.toml: no claim has notebook = 'two.ipynb'; give it some or remove it" in found


def test_the_title_of_the_second_chapter_is_that_of_its_notebook(two):
    retitled(two, "two", "Another case")
    (problem,) = preflight.problems(two)
    assert problem.startswith("two.ipynb: its first line is '# Another case'; make it")


def test_a_second_notebook_that_is_not_there(two):
    (two.notebooks / "two.ipynb").unlink()
    (problem,) = preflight.problems(two)
    assert problem == "fake.toml: its notebook two.ipynb is not in notebooks/; put it there"


# ---- the ledger ----


def test_a_ledger_knows_what_is_its_own(two):
    (paper,) = two.papers
    first, second = Ledger(paper), Ledger(paper, notebook="two.ipynb")
    assert first.missing() == ["fake.x", "fake.y"] and second.missing() == ["fake.z"]
    with pytest.raises(ValueError, match=r"fake\.z is judged in two\.ipynb; check it there"):
        first.check("fake.z")
    with pytest.raises(ValueError, match=r"fake\.x is judged in one\.ipynb"):
        second.check("fake.x", 2.0)


# ---- the pages ----


def test_every_page_leads_to_both_chapters(two):
    (paper,) = two.papers
    rows = run.check_paper(two, paper).rows
    made = pages.pages(two.papers, rows)
    for page in ("scoreboard.md", "ledger.md"):
        assert "notebooks/two.html" in made[page] and "notebooks/one.html" in made[page]
    assert "notebooks/two.html#claim-fake.z" in made["ledger.md"]
    assert "notebooks/one.html#claim-fake.x" in made["ledger.md"]
    assert (
        "| [The case two](notebooks/two.ipynb) | a second loop {cite}`francis1976` |"
        in made["idea.md"]
    )
    assert "The same paper: [The case two: more of it](notebooks/two.ipynb)." in made["errata.md"]
    assert pages.chapters(two.papers) == (
        "- [The case one](notebooks/one.ipynb): Nobody, Nowhere, 1989.\n"
        "- [The case two: more of it](notebooks/two.ipynb): the same paper.\n"
    )
