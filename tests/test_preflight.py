"""What is wrong with a project is said before anything is executed: file, place and mend."""

import shutil

import nbformat
import pytest
from conftest import LEDGER, ROOT

from rcbook.book import preflight, run
from rcbook.book.project import Project, find


@pytest.fixture
def sound(make):
    """A fake project with nothing wrong."""
    project = make(one=[LEDGER])
    assert not preflight.problems(project)
    return project


def rewrite(path, old, new):
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def test_the_book_has_no_problem():
    assert not preflight.problems(find(ROOT))


def test_a_notebook_that_is_not_there(sound):
    (sound.notebooks / "one.ipynb").rename(sound.notebooks / "two.ipynb")
    assert any(
        "fake.toml: its notebook one.ipynb is not in notebooks/" in problem
        for problem in preflight.problems(sound)
    )


def test_a_notebook_without_a_line_in_the_contents_and_a_line_without_a_notebook(tmp_path):
    for folder in ("book", "notebooks"):
        ignore = shutil.ignore_patterns("_build")
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=ignore)
    rewrite(tmp_path / "book" / "_toc.yml", "noncircular_lathe", "noncircular_late")
    assert preflight.problems(Project(tmp_path, find(ROOT).papers)) == [
        "_toc.yml: no line for notebooks/noncircular_lathe; "
        "add `- file: notebooks/noncircular_lathe` where the chapter belongs",
        "_toc.yml: notebooks/noncircular_late is no notebook; remove the line or add the notebook",
    ]


def test_a_key_that_is_not_in_the_bibliography(sound):
    rewrite(sound.notebooks / "one.ipynb", "With $x^2$.", "With {cite}`nobody1900,francis1976`.")
    (problem,) = preflight.problems(sound)
    assert problem.startswith("one.ipynb: cites 'nobody1900', which is not in book/references.bib")


def test_a_title_that_differs(sound):
    rewrite(sound.notebooks / "one.ipynb", "# The case one", "# Another case")
    (problem,) = preflight.problems(sound)
    assert "its first line is '# Another case'; make it '# The case one'" in problem


def test_a_mark_that_cannot_be_read(sound):
    rewrite(sound.notebooks / "one.ipynb", "With $x^2$.", "A 5<!-- {x} -->.")
    (problem,) = preflight.problems(sound)
    assert problem.startswith("one.ipynb, ") and "format" in problem


def test_nothing_is_executed_when_something_is_wrong(sound):
    rewrite(sound.notebooks / "one.ipynb", "# The case one", "# Another case")
    with pytest.raises(ValueError, match=r"(?s)nothing was executed, because.*first line"):
        run.check(sound)
    assert not sound.ledger_file.exists()


@pytest.mark.parametrize("text", ["", "{", "[]", '{"cells": []}', "\ufeff{}"])
def test_a_file_that_is_no_notebook_is_named_once(sound, text):
    (sound.notebooks / "three.ipynb").write_text(text, encoding="utf-8")
    (problem,) = preflight.problems(sound)
    assert "three.ipynb is not a notebook" in problem


@pytest.mark.parametrize("text", ["", "- a list", "parts: 3", "parts: [", "root: index"])
def test_contents_that_cannot_be_read_are_named(sound, text):
    (sound.book / "_toc.yml").write_text(text, encoding="utf-8")
    (problem,) = preflight.problems(sound)
    assert problem == "_toc.yml: no list of parts with chapters; restore it"


@pytest.mark.parametrize("settings", ["x", {"image": []}, {"image": {"alt": 5}}])
def test_odd_metadata_of_a_cell_are_no_alternative_text(sound, settings):
    notebook = nbformat.read(sound.notebooks / "one.ipynb", as_version=4)
    notebook.cells[-1].metadata["mystnb"] = settings
    nbformat.write(notebook, sound.notebooks / "one.ipynb")
    assert not preflight.problems(sound)


@pytest.mark.parametrize("name", ["_toc.yml", "references.bib", "index.md"])
def test_a_text_that_is_no_utf8_is_named(sound, name):
    (sound.book / name).write_bytes("Stabilit\xe4t".encode("latin-1"))
    with pytest.raises(ValueError, match=rf"{name} is no UTF-8 text.*save it"):
        preflight.problems(sound)
