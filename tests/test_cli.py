"""The command line: what it prints and its exit statuses."""

import json
import subprocess
import sys

import nbformat
import pytest
from conftest import COVER, LEDGER, write_notebook

from rcbook import cli, ledger
from rcbook.book import project, render
from rcbook.ledger import show


@pytest.fixture
def at(make, monkeypatch):
    """Makes a fake project and stands in it."""

    def at(**notebooks):
        made = make(**notebooks)
        monkeypatch.chdir(made.root)
        monkeypatch.setattr(project, "find", lambda start: made)
        monkeypatch.setattr(ledger, "papers", lambda: ("fake", "other"))
        nothing = {part: {} for part in ("errata", "conventions", "changes")}
        idea = dict.fromkeys(("loop", "index", "period"), "")
        fields = {"claims": [], "idea": idea, "title": "", **nothing}
        monkeypatch.setattr(ledger, "source", lambda key: fields)
        return made

    return at


def test_check_and_ledger(at, capsys):
    made = at(one=[LEDGER])
    assert cli.main(["check"]) == 0
    said = capsys.readouterr().out
    assert "one.ipynb: done after" in said
    counted = (
        "3 claims, 3 of them results (0 headlines): 1 reproduced, 1 reproduced with correction"
    )
    assert counted in said
    assert cli.main(["ledger"]) == 0
    said = capsys.readouterr().out
    assert "fake.x" in said
    assert "2.01" in said
    assert counted in said
    assert cli.main(["ledger", "--json"]) == 0
    assert capsys.readouterr().out == made.ledger_file.read_text(encoding="utf-8")
    assert cli.main(["ledger", "--json", "--paper", "other"]) == 0
    assert json.loads(capsys.readouterr().out) == []


def test_a_flip_fails_and_leaves_the_book(at, capsys):
    made = at(one=[COVER, LEDGER.replace("2.01", "7")])
    made.html.mkdir(parents=True)
    (made.html / "index.html").write_text("old")
    assert cli.main(["build"]) == 1
    assert "the book was not rendered" in capsys.readouterr().out
    assert (made.html / "index.html").read_text() == "old"
    assert cli.main(["ledger"]) == 0
    assert "NOT EXPECTED" in capsys.readouterr().out


def test_build_says_why_it_could_not_render(at, capsys, monkeypatch):
    made = at(one=[LEDGER])  # no cover
    assert cli.main(["build"]) == 1
    assert "the book has no cover" in capsys.readouterr().err
    assert not list(made.build.glob("stage-*"))


def test_a_ctrl_c_while_rendering_leaves_no_stage(at, capsys, monkeypatch):
    def interrupted(stage):
        raise KeyboardInterrupt

    made = at(one=[COVER, LEDGER])
    monkeypatch.setattr(render, "_sphinx", interrupted)
    assert cli.main(["build"]) == 130
    assert [path.name for path in made.build.iterdir()] == ["ledger.json"]


def test_no_ledger_yet(at, capsys):
    made = at(one=[LEDGER])
    assert cli.main(["ledger"]) == 1
    said = f"rcbook: there is no {made.ledger_file} yet; run `rcbook check` first\n"
    assert capsys.readouterr().err == said


@pytest.mark.parametrize("content", [b"[", b"{}", b"\xff"])
def test_a_ledger_that_cannot_be_read_is_named(at, capsys, content):
    made = at(one=[LEDGER])
    made.build.mkdir()
    made.ledger_file.write_bytes(content)
    assert cli.main(["ledger"]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"rcbook: {made.ledger_file} ")
    assert "Traceback" not in said


def test_wrong_use_is_status_2(at, capsys):
    at(one=[LEDGER])
    for command in ("ledger", "falsify"):
        assert cli.main([command, "--paper", "nobody"]) == 2
        assert "no paper 'nobody'; choose one of fake, other" in capsys.readouterr().err
    with pytest.raises(SystemExit) as stop:
        cli.main(["bake"])
    assert stop.value.code == 2


@pytest.mark.parametrize("command", ["build", "check", "ledger", "numbers", "falsify"])
def test_outside_of_a_clone_there_is_one_clear_line(tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    assert cli.main([command]) == 1
    assert capsys.readouterr().err == (
        f"rcbook: no checkout of rcbook at or above {tmp_path}; run this inside a clone\n"
    )


def test_help_does_not_wait_for_heavy_imports():
    code = (
        "import sys, rcbook.cli; rcbook.cli._parser();"
        "print([m for m in ('numpy', 'matplotlib', 'nbclient', 'rich') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "[]"


def test_long_lists_are_shown_by_their_ends():
    assert show.value([3.0, -1.5, *[0.0] * 20]) == "-1.5 to 3 (22 values)"
    assert show.value([1.0, 2.0]) == "1; 2"


def test_numbers_says_what_it_counted_and_fails_when_one_is_left(at, capsys):
    made = at(one=[LEDGER])
    (made.book / "index.md").write_text("# A book\n\nIn eq. 3 a gain of 7.\n", encoding="utf-8")
    assert cli.main(["numbers", "--file", "index.md"]) == 1
    said = capsys.readouterr().out
    assert "UNACCOUNTED index.md, text: 7" in said
    assert said.splitlines()[-1] == "2 numbers in the text, 1 unaccounted"
    (made.book / "index.md").write_text("# A book\n\nIn eq. 3.\n", encoding="utf-8")
    assert cli.main(["numbers", "--file", "index.md"]) == 0


def test_numbers_are_rewritten_by_one_command(at, capsys):
    made = at(one=["x = 2.04", LEDGER])
    path = made.notebooks / "one.ipynb"
    notebook = nbformat.read(path, as_version=4)
    notebook.cells[0].source = "# The case one\n\nIt is 2.1<!-- {x:.1f} -->."
    nbformat.write(notebook, path)
    assert cli.main(["check"]) == 1
    assert "the text says 2.1, and {x} is 2.0" in capsys.readouterr().out
    assert cli.main(["numbers", "--file", "one.ipynb", "--rewrite"]) == 0
    assert "1 numbers rewritten" in capsys.readouterr().out
    assert cli.main(["check"]) == 0


def test_one_chapter_can_be_checked_alone_and_the_ledger_stays(at, capsys):
    made = at(one=[LEDGER], two=["1 / 0"])
    made.build.mkdir()
    made.ledger_file.write_text("old", encoding="utf-8")
    assert cli.main(["check", "--paper", "fake"]) == 0
    said = capsys.readouterr().out
    assert "fake.x: printed 2.0, ours 2.01: reproduced\n" in said
    assert "two.ipynb" not in said
    assert made.ledger_file.read_text(encoding="utf-8") == "old"


def test_a_ledger_older_than_a_failed_run_says_so(at, capsys):
    made = at(one=[LEDGER])
    assert cli.main(["check"]) == 0
    write_notebook(made.notebooks / "two.ipynb", ["1 / 0"])
    assert cli.main(["check"]) == 1
    capsys.readouterr()
    assert cli.main(["ledger"]) == 0
    assert "the last run failed; this is the ledger of an earlier one" in capsys.readouterr().err
    (made.notebooks / "two.ipynb").unlink()
    assert cli.main(["check"]) == 0
    capsys.readouterr()
    assert cli.main(["ledger"]) == 0
    assert not capsys.readouterr().err


def test_a_ledger_older_than_a_run_that_could_not_begin_says_so(at, capsys):
    made = at(one=[LEDGER])
    assert cli.main(["check"]) == 0
    (made.book / "references.bib").write_text("", encoding="utf-8")
    assert cli.main(["check"]) == 1
    assert "nothing was executed" in capsys.readouterr().err
    assert cli.main(["ledger"]) == 0
    assert "the last run failed; this is the ledger of an earlier one" in capsys.readouterr().err
