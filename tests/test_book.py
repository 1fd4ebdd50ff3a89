"""The real book, built once: every notebook executed, every claim judged as expected."""

import json
from importlib import resources

import jsonschema
import nbformat
import pytest
import yaml
from conftest import ROOT

from rcbook import ledger


def test_every_claim_of_every_paper_was_computed(rows):
    ids = [id for key in ledger.papers() for id in ledger.load(key).claims]
    assert [row["id"] for row in rows] == ids


def test_every_verdict_is_the_expected_one(rows):
    flips = [row["id"] for row in rows if row["verdict"] != row["expected_verdict"]]
    assert not flips


def test_every_failure_to_reproduce_has_a_reason(rows):
    for row in rows:
        if row["verdict"] in (ledger.NOT_REPRODUCED, ledger.NOT_COMPUTABLE):
            assert row["reason"], row["id"]


def test_every_claim_has_its_anchor(rows, built):
    page = (built / "book" / "_build" / "html" / "ledger.html").read_text(encoding="utf-8")
    assert all(f'id="{row["id"]}"' in page for row in rows)


def test_the_build_leaves_the_book_and_the_ledger_and_nothing_else(built):
    left = sorted(path.name for path in (built / "book" / "_build").iterdir())
    assert left == ["html", "ledger.json"]


def test_every_notebook_has_its_place_among_the_chapters(built):
    """Jupyter Book passes over in silence what the table of contents does not name."""
    html = built / "book" / "_build" / "html"
    landing = (html / "index.html").read_text(encoding="utf-8")
    for notebook in (built / "notebooks").glob("*.ipynb"):
        assert (html / "notebooks" / f"{notebook.stem}.html").is_file()
        assert f'href="notebooks/{notebook.stem}.html"' in landing


def test_the_ledger_is_what_its_schema_says(rows):
    schema = json.loads(resources.files("rcbook.ledger").joinpath("schema.json").read_text())
    jsonschema.validate(rows, schema)
    for spoiled in ({"role": "guess"}, {"verdict": "fine"}, {"computed": "3"}, {"colour": "red"}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate([{**rows[0], **spoiled}], schema)


def test_chapters_have_one_order_and_one_title_everywhere():
    papers = [ledger.load(key) for key in ledger.papers()]
    contents = yaml.safe_load((ROOT / "book" / "_toc.yml").read_text(encoding="utf-8"))
    listed = [chapter["file"] for part in contents["parts"] for chapter in part["chapters"]]
    chapters = [chapter for paper in papers for chapter in paper.chapters]
    names = [f"notebooks/{chapter.notebook.removesuffix('.ipynb')}" for chapter in chapters]
    assert [name for name in listed if name in names] == names
    for chapter in chapters:
        first = nbformat.read(ROOT / "notebooks" / chapter.notebook, as_version=4).cells[0]
        assert first.source.splitlines()[0] == f"# {chapter.title}"
