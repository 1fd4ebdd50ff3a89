"""Skeletons of a new case study: data file, notebook, machine and test."""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path

from rcbook.book.project import Project, write

_LAST = re.compile(r"(?:^ +- file: notebooks/.*\n)+", re.MULTILINE)


def create(project: Project, key: str, title: str = "") -> list[Path]:
    """Write the skeletons of paper `key`, and its lines in contents and bibliography.

    Returns the files written and changed.  Nothing that exists is overwritten.
    Raises ValueError for a key that is no name in lower case or that is taken, and for a checkout
    whose contents have no chapter.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", key):
        raise ValueError(f"{key!r} is no key; use lower case, digits and _, such as smith2001")
    package = project.root / "src" / "rcbook"
    files = {
        package / "papers" / f"{key}.toml": "paper.toml",
        package / "machines" / f"{key}.py": "machine.py",
        project.notebooks / f"{key}.ipynb": "notebook.ipynb",
        project.root / "tests" / f"test_{key}.py": "test.py",
    }
    if taken := [path for path in files if path.exists()]:
        raise ValueError(f"{taken[0]} exists already; choose another key or remove it")
    contents, bibliography = project.book / "_toc.yml", project.book / "references.bib"
    listed = _listed(contents.read_text(encoding="utf-8"), key)
    entry = f"\n@misc{{{key},\n  author = {{Author, A.}},\n  title  = {{Title}},\n}}\n"
    values = {
        "@KEY@": key,
        "@TITLE@": title or f"{key}: what it is about",
        "@CHAPTER@": str(max(paper.chapter for paper in project.papers) + 1),
    }
    for path, name in files.items():
        write(path, _filled(name, values))
    write(contents, listed)
    write(bibliography, bibliography.read_text(encoding="utf-8").rstrip("\n") + "\n" + entry)
    return [*files, contents, bibliography]


def _listed(contents: str, key: str) -> str:
    """The table of contents with a line for the new chapter after the last one."""
    chapters = _LAST.search(contents)
    if chapters is None:
        raise ValueError("book/_toc.yml lists no chapter in notebooks/; restore it first")
    line = re.sub(r"notebooks/.*", f"notebooks/{key}", chapters[0].splitlines()[-1])
    return contents[: chapters.end()] + line + "\n" + contents[chapters.end() :]


def _filled(name: str, values: dict[str, str]) -> str:
    file = resources.files("rcbook.book").joinpath("skeleton", f"{name}.txt")
    text = file.read_text(encoding="utf-8")
    for mark, value in values.items():
        text = text.replace(mark, value)
    return text
