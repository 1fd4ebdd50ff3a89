"""The real book, built once: every notebook executed, every claim judged as expected."""

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
