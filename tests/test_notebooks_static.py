"""What can be said of the notebooks and the source without running them."""

import ast
import re
import subprocess
import sys

import nbformat
import pytest
from conftest import ROOT

from rcbook import ledger
from rcbook.book import falsify
from rcbook.ledger.marks import without_marks

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
LINES = 15  # a longer cell hides the idea; move the mechanism into the package

DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)

each = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def code_cells(path):
    return [c for c in nbformat.read(path, as_version=4).cells if c.cell_type == "code"]


def test_there_is_a_notebook():
    assert NOTEBOOKS


@each
def test_committed_without_outputs(path):
    assert all(not c.outputs and c.execution_count is None for c in code_cells(path))


@each
def test_cell_ids_are_there_and_unique(path):
    ids = [cell.get("id") for cell in nbformat.read(path, as_version=4).cells]
    assert all(ids)
    assert len(set(ids)) == len(ids)


@each
def test_cells_are_short_and_hold_no_mechanism(path):
    """An experiment may have a name; what is longer, or has state, is in the package."""
    for cell in code_cells(path):
        assert len(cell.source.splitlines()) < LINES, cell.source
        defined = [n for n in ast.walk(ast.parse(cell.source)) if isinstance(n, DEFINITIONS)]
        assert not any(isinstance(node, ast.ClassDef) for node in defined), cell.id
        assert all(node.end_lineno - node.lineno < 12 for node in defined), cell.id
        assert len(defined) <= 1, cell.id


@each
def test_a_cell_that_judges_a_claim_is_not_passed_over_by_the_falsifier(path):
    for cell in code_cells(path):
        if falsify.SKIP in cell.metadata.get("tags", []):
            assert not re.search(r"\bcheck\(", cell.source), cell.id


@each
def test_every_picture_has_words(path):
    """A cell that draws carries an alternative text for those who cannot see it."""
    for cell in code_cells(path):
        if re.search(r"\bplt\.subplots\(|\bdraw_\w+\(|\bwith_sliders\(", cell.source):
            alt = cell.metadata.get("mystnb", {}).get("image", {}).get("alt", "")
            assert len(alt) > 20, f"{cell.id}: {cell.source}"


@each
def test_a_chapter_opens_with_a_picture_and_not_with_set_up(path):
    first = code_cells(path)[0]
    assert first.metadata["mystnb"]["image"]["alt"], first.source
    assert "hide-input" in first.metadata["tags"], first.source
    assert falsify.SKIP not in first.metadata["tags"], "its imports are needed by all other cells"


CASES = [chapter.notebook for key in ledger.papers() for chapter in ledger.load(key).chapters]


@pytest.mark.parametrize("notebook", CASES)
def test_a_case_study_says_in_a_box_what_it_is_about(notebook):
    cells = nbformat.read(ROOT / "notebooks" / notebook, as_version=4).cells
    (box,) = (cell.source for cell in cells[:4] if cell.source.startswith("> "))
    parts = ["The problem.", "The result.", "What failed.", "The lesson.", "You need"]
    assert re.findall(r"\*\*(.+?)\*\*", box) == parts
    assert all(line.startswith(">") for line in box.splitlines())


@pytest.mark.parametrize("command", [["check"], ["format", "--check"]], ids=["lint", "format"])
def test_ruff(command):
    done = subprocess.run(
        [sys.executable, "-m", "ruff", *command, "."], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr


# ---- figures, equations and exercises ----

CODE_THAT_IS_READ = 88  # characters; a longer line scrolls in its box on a wide screen
OF_A_PAPER = re.compile(r"\b(?:eqs?|figs?|tables?|sections?)\.? (?:\(?\d)", re.IGNORECASE)
WHOSE = r"[^.]{0,60}?\bof the (?:paper|thesis)\b"
ITS = re.compile(r"(?:paper's|thesis's|its) $", re.IGNORECASE)


def cells(path):
    return nbformat.read(path, as_version=4).cells


def picture(cell):
    return cell.metadata.get("mystnb", {}).get("image", {}).get("alt", "")


@each
def test_every_picture_has_its_caption(path):
    """The paragraph right below a picture, which begins in bold, becomes its caption."""
    read = cells(path)
    for cell, below in zip(read, [*read[1:], None], strict=True):
        if picture(cell):
            assert below is not None and below.cell_type == "markdown", cell.id
            begins = re.match(r"\*\*[^*]{8,}\*\*", without_marks(below.source))
            assert begins, f"{cell.id}: {below.source[:60]}"


def test_figures_and_equations_have_one_name_each_and_references_meet_one():
    named, meant = [], []
    for path in NOTEBOOKS:
        for cell in cells(path):
            if name := cell.metadata.get("mystnb", {}).get("figure", {}).get("name"):
                assert picture(cell), f"{name} names a cell without a picture"
                named.append(name)
            if cell.cell_type == "markdown":
                named += re.findall(r"\$\$ \((eq-[\w-]+)\)", cell.source)
                meant += re.findall(r"\]\(#((?:fig|eq)-[\w-]+)\)", cell.source)
    assert len({*named}) == len(named)
    assert {*meant} <= {*named}


@each
def test_every_displayed_equation_is_numbered(path):
    for cell in cells(path):
        if cell.cell_type == "markdown":
            for shown in re.finditer(r"\$\$.+?\$\$(.{0,12})", cell.source + "\n", re.DOTALL):
                assert shown[1].startswith(" (eq-"), shown[0]


@each
def test_the_equations_and_figures_of_a_paper_are_said_to_be_its_own(path):
    """Else a reader takes `eq. 12` for an equation of the book."""
    for cell in cells(path):
        text = without_marks(cell.source if cell.cell_type == "markdown" else picture(cell))
        for found in OF_A_PAPER.finditer(text):
            after = re.match(WHOSE, text[found.end() :].replace("\n", " "))
            assert after or ITS.search(text[: found.start()]), (
                f"{cell.id}: {text[found.start() - 40 : found.end() + 60]!r}"
            )


@each
def test_exercises_say_how_long_how_hard_and_where_one_stands(path):
    """Each with a hint and a check of one's own, folded."""
    read = [cell.source for cell in cells(path) if cell.cell_type == "markdown"]
    (start,) = (i for i, text in enumerate(read) if re.search("^## Exercises$", text, re.MULTILINE))
    exercises = [text for text in read[start:] if text.startswith("### ")]
    assert 4 <= len(exercises) <= 8
    for text in exercises:
        lines = "\n".join(text.splitlines()[1:])
        how = r"\s*\*\d+(?: to \d+)? minutes, (?:warm-up|exercise|project)\.\*"
        assert re.match(how, lines), text
        for summary in ("Hint", "Check yourself"):
            folded = rf"<details><summary>{summary}</summary>\n\n.+?\n\n</details>"
            assert re.search(folded, text, re.DOTALL), text


@each
def test_code_that_is_read_fits_its_box(path):
    for cell in code_cells(path):
        if "hide-input" not in cell.metadata.get("tags", []):
            for line in cell.source.splitlines():
                assert len(line) <= CODE_THAT_IS_READ, line
