"""What is wrong with a project before anything is executed: file, place and mend."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import nbformat
import yaml

from rcbook.book import cost, numbers
from rcbook.book.execute import read
from rcbook.book.project import Project, read_text
from rcbook.ledger import Paper

_CITED = re.compile(r"\{cite(?::\w+)?\}`([^`]+)`")
_ENTRY = re.compile(r"^@\w+\{\s*([^,\s]+)", re.MULTILINE)


def problems(project: Project) -> list[str]:
    """What would end in a dead link, a missing page or a wrong count; empty when all is well."""
    found = [problem for paper in project.papers for problem in _of_paper(project, paper)]
    found += _contents(project)
    found += _citations(project)
    for ask, of in ((numbers.of_texts, project), (cost.read, project.book)):
        try:
            ask(of)
        except ValueError as error:
            found.append(str(error))
    return found


def _of_paper(project: Project, paper: Paper) -> Iterable[str]:
    file = f"{paper.key}.toml"
    twins = [p.key for p in project.papers if p.chapter == paper.chapter and p is not paper]
    if twins:
        yield f"{file}: chapter {paper.chapter} is also that of {twins[0]}; give it another number"
    for chapter in paper.chapters:
        path = project.notebooks / chapter.notebook
        if not path.is_file():
            yield f"{file}: its notebook {chapter.notebook} is not in notebooks/; put it there"
        elif cells := _cells(path):
            first = cells[0].source.splitlines()[0] if cells[0].source else ""
            if first != f"# {chapter.title}":
                wanted = f"make it '# {chapter.title}', the title"
                yield f"{chapter.notebook}: its first line is {first!r}; {wanted}"
            yield from _places(paper, chapter.notebook, _checked(cells))


def _places(paper: Paper, notebook: str, checked: Sequence[re.Pattern]) -> Iterable[str]:
    """Claims that are judged in another notebook than their data say, where several share them."""
    if not paper.further:
        return
    own = [id for id, claim in paper.claims.items() if paper.place(claim) == notebook]
    if not own:
        yield f"{paper.key}.toml: no claim has notebook = {notebook!r}; give it some or remove it"
    for id in own:
        if not any(pattern.fullmatch(id) for pattern in checked):
            yield f"{notebook}: it does not judge {id}, which is its own; check it there"
    for pattern in checked:
        if not any(map(pattern.fullmatch, own)):
            for id in filter(pattern.fullmatch, paper.claims):
                place = paper.place(paper.claims[id])
                yield f"{notebook}: it judges {id}, which {place} should; move the one or the other"


def _checked(cells: Iterable[nbformat.NotebookNode]) -> list[re.Pattern]:
    """The ids of claims that code cells check, each as a pattern: a part that only a run can know
    may be anything."""
    found = []
    for cell in cells:
        if cell.cell_type != "code":
            continue
        try:
            nodes = list(ast.walk(ast.parse(cell.source)))
        except SyntaxError:
            continue  # the run says why
        for call in (node for node in nodes if isinstance(node, ast.Call)):
            name = getattr(call.func, "attr", getattr(call.func, "id", ""))
            if name == "check" and call.args:
                found.append(_pattern(call.args[0]))
    return found


def _pattern(id: ast.expr) -> re.Pattern:
    parts = id.values if isinstance(id, ast.JoinedStr) else [id]
    known = (part.value if isinstance(part, ast.Constant) else None for part in parts)
    return re.compile("".join(".+" if part is None else re.escape(str(part)) for part in known))


def _cells(path: Path) -> list[nbformat.NotebookNode]:
    try:
        return read(path).cells
    except ValueError:
        return []  # the survey of its numbers says why


def _contents(project: Project) -> Iterable[str]:
    """Notebooks without a line in the table of contents, and lines without a file."""
    text = read_text(project.book / "_toc.yml")
    try:
        parts = yaml.safe_load(text)["parts"]
        chapters = [chapter for part in parts for chapter in part["chapters"]]
    except (yaml.YAMLError, KeyError, TypeError):
        yield "_toc.yml: no list of parts with chapters; restore it"
        return
    listed = {chapter["file"] for chapter in chapters if "file" in chapter}
    globbed = any("glob" in chapter for chapter in chapters)
    there = {f"notebooks/{path.stem}" for path in project.notebooks.glob("*.ipynb")}
    for name in sorted(there - listed) * (not globbed):
        yield f"_toc.yml: no line for {name}; add `- file: {name}` where the chapter belongs"
    for name in sorted(name for name in listed if name.startswith("notebooks/")):
        if name not in there:
            yield f"_toc.yml: {name} is no notebook; remove the line or add the notebook"


def _citations(project: Project) -> Iterable[str]:
    """Keys that are cited and not in the bibliography."""
    known = set(_ENTRY.findall(read_text(project.book / "references.bib")))
    texts = {}
    for paper in project.papers:
        cited = ",".join(chapter.idea["cite"] for chapter in paper.chapters)
        texts[f"{paper.key}.toml"] = f"{{cite}}`{cited}`"
    for path in project.notebooks.glob("*.ipynb"):
        texts[path.name] = "\n".join(cell.source for cell in _cells(path))
    for path in project.book.glob("*.md"):
        texts[path.name] = read_text(path)
    for name, text in texts.items():
        cited = {key.strip() for keys in _CITED.findall(text) for key in keys.split(",")}
        for key in sorted(cited - known):
            yield f"{name}: cites {key!r}, which is not in book/references.bib; add the entry"
