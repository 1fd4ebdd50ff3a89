"""Skeletons of a new case study: data file, notebook, machine and test."""

from __future__ import annotations

import json
import keyword
import re
import sys
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

from rcbook.book.project import Project, read_text, write

_CHAPTER = re.compile(r"^ +- file: notebooks/.*\n", re.MULTILINE)


def create(project: Project, key: str, title: str = "") -> list[Path]:
    """Write the skeletons of paper `key`, and its lines in contents and bibliography.

    Returns the files written and changed.  Nothing that exists is overwritten.
    Raises ValueError for a key that is no name in lower case, that Python has for itself or that is
    taken, for a title with quotes or breaks, and for a checkout whose contents have no chapter.
    """
    taken = keyword.iskeyword(key) or key in sys.stdlib_module_names
    if taken or not re.fullmatch(r"[a-z][a-z0-9_]*", key):
        raise ValueError(f"{key!r} is no key; use author and year, such as smith2001")
    title = title or f"{key}: what it is about"
    if title != json.dumps(title, ensure_ascii=False)[1:-1]:
        raise ValueError(f"the title {title!r} holds quotes or breaks; leave them out")
    texts = _skeletons(project, key, title)
    if taken := [path for path in texts if path.exists()]:
        raise ValueError(f"{taken[0]} exists already; choose another key or remove it")
    contents, bibliography = project.book / "_toc.yml", project.book / "references.bib"
    before = {path: read_text(path) for path in (contents, bibliography)}
    entry = f"\n@misc{{{key},\n  author = {{Author, A.}},\n  title  = {{Title}},\n}}\n"
    texts[contents] = _listed(before[contents], key)
    texts[bibliography] = before[bibliography].rstrip("\n") + "\n" + entry
    _write_all(texts, before)
    return list(texts)


def _skeletons(project: Project, key: str, title: str) -> dict[Path, str]:
    """The texts of a new case study's files."""
    package = project.root / "src" / "rcbook"
    files = {
        package / "papers" / f"{key}.toml": "paper.toml",
        package / "machines" / f"{key}.py": "machine.py",
        project.notebooks / f"{key}.ipynb": "notebook.ipynb",
        project.root / "tests" / f"test_{key}.py": "test.py",
    }
    chapter = max(paper.chapter for paper in project.papers) + 1
    values = {"@KEY@": key, "@TITLE@": title, "@CHAPTER@": str(chapter)}
    return {path: _filled(name, values) for path, name in files.items()}


def _write_all(texts: Mapping[Path, str], before: Mapping[Path, str]) -> None:
    """Write all `texts` or none; `before` is what files that exist held."""
    try:
        for path, text in texts.items():
            write(path, text)
    except BaseException:  # also Ctrl-C: all or nothing
        for path in texts:
            if path in before:
                write(path, before[path])
            else:
                path.unlink(missing_ok=True)
        raise


def _listed(contents: str, key: str) -> str:
    """The table of contents with a line for the new chapter after the last one."""
    chapters = list(_CHAPTER.finditer(contents))
    if not chapters:
        raise ValueError("book/_toc.yml lists no chapter in notebooks/; restore it first")
    last = chapters[-1]
    line = re.sub(r"notebooks/.*", f"notebooks/{key}", last[0])
    return contents[: last.end()] + line + contents[last.end() :]


def _filled(name: str, values: dict[str, str]) -> str:
    file = resources.files("rcbook.book").joinpath("skeleton", f"{name}.txt")
    text = file.read_text(encoding="utf-8")
    for mark, value in values.items():
        text = text.replace(mark, value)
    return text
