"""A newcomer's first case study: skeletons that run at once."""

import os
import shutil
import subprocess
import sys

import pytest
from conftest import ROOT

from rcbook.book import new
from rcbook.book.project import find


@pytest.fixture
def clone(tmp_path):
    """A copy of the project without its history and its builds."""
    ignore = shutil.ignore_patterns("_build", ".ipynb_checkpoints", "__pycache__")
    for folder in ("book", "notebooks", "src", "tests"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=ignore)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    # Kernels drop PYTHONPATH on purpose and run in notebooks/, where they find the copy so.
    (tmp_path / "notebooks" / "rcbook").symlink_to(tmp_path / "src" / "rcbook")
    return tmp_path


def run(clone, *command):
    """A command in the clone, whose package goes before the installed one."""
    environment = os.environ | {"PYTHONPATH": str(clone / "src")}
    return subprocess.run(
        [sys.executable, *command], cwd=clone, env=environment, capture_output=True, text=True
    )


def test_a_new_case_study_can_be_checked_falsified_and_tested_at_once(clone):
    made = run(clone, "-m", "rcbook.cli", "new", "smith2001")
    assert made.returncode == 0, made.stdout + made.stderr
    assert "smith2001.toml" in made.stdout and "rcbook check --paper smith2001" in made.stdout
    look = (
        "from pathlib import Path; from rcbook.book import preflight, project;"
        "found = preflight.problems(project.find(Path.cwd())); assert not found, found"
    )
    done = run(clone, "-c", look)
    assert done.returncode == 0, done.stderr
    paper = "smith2001"
    for command in (["check", "--paper", paper], ["falsify", "--paper", paper]):
        done = run(clone, "-m", "rcbook.cli", *command)
        assert done.returncode == 0, done.stdout + done.stderr
    done = run(clone, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests/test_smith2001.py")
    assert done.returncode == 0, done.stdout


def test_nothing_is_overwritten_and_a_bad_key_is_refused(clone):
    project = find(clone)
    new.create(project, "smith2001")
    before = (clone / "book" / "_toc.yml").read_text(encoding="utf-8")
    with pytest.raises(ValueError, match="exists already"):
        new.create(project, "smith2001")
    assert (clone / "book" / "_toc.yml").read_text(encoding="utf-8") == before
    for key in ("Smith", "2001smith", "smith-2001", "", "class", "numbers"):
        with pytest.raises(ValueError, match="is no key"):
            new.create(project, key)


def test_a_title_that_would_break_the_data_file_is_refused(clone):
    for title in ('A "quoted" one', "two\nlines", "a \\ slash"):
        with pytest.raises(ValueError, match="leave them out"):
            new.create(find(clone), "smith2001", title)
    assert not (clone / "notebooks" / "smith2001.ipynb").exists()


def test_an_interrupt_half_way_leaves_nothing(clone, monkeypatch):
    project, written = find(clone), []

    def stopped(path, text):
        if len(written) == 3:
            written.append(path)
            raise KeyboardInterrupt
        written.append(path)
        write(path, text)

    write = new.write
    contents = (clone / "book" / "_toc.yml").read_text(encoding="utf-8")
    monkeypatch.setattr(new, "write", stopped)
    with pytest.raises(KeyboardInterrupt):
        new.create(project, "smith2001")
    assert len(written) > 3 and not list(clone.rglob("*smith2001*"))
    assert (clone / "book" / "_toc.yml").read_text(encoding="utf-8") == contents


def test_the_new_chapter_stands_after_the_last_one(clone):
    new.create(find(clone), "smith2001")
    lines = (clone / "book" / "_toc.yml").read_text(encoding="utf-8").splitlines()
    at = lines.index("      - file: notebooks/smith2001")
    assert lines[at - 1].startswith("      - file: notebooks/")
    assert not any(line.startswith("      - file: notebooks/") for line in lines[at + 1 :])
    assert "@misc{smith2001," in (clone / "book" / "references.bib").read_text(encoding="utf-8")
