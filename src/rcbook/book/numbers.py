"""Account for every number in the book's text, and rewrite those that are computed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rcbook import ledger
from rcbook.book.execute import alternative, execute, figure, plain, read
from rcbook.book.project import Project, read_text, write
from rcbook.ledger import marks, words

ROUND = 30  # characters shown on either side of a number


@dataclass(frozen=True)
class Place:
    """A number of the book's text: in which file, in which cell or claim, and what it is."""

    file: str
    at: str
    number: marks.Number
    around: str

    def __str__(self) -> str:
        return f"{self.file}, {self.at}: {self.number.text}   [{self.around}]"


def report(project: Project, file: str | None = None) -> bool:
    """Print what accounts for the numbers of the book or of one file, and say if nothing is left.

    Raises ValueError for a file that is no text of the book, and as `survey` does.
    """
    places = [place for place in survey(project) if file in (None, place.file)]
    if not places and file:
        raise ValueError(f"no text of the book is called {file!r}; name a file of it")
    lost = [place for place in places if place.number.kind == marks.UNACCOUNTED]
    print("".join(f"UNACCOUNTED {place}\n" for place in lost), end="")
    print(table(places))
    print(f"\n{len(places)} numbers in the text, {len(lost)} unaccounted")
    return not lost


def execute_and_rewrite(project: Project, file: str | None = None) -> None:
    """Execute all notebooks or one, and type what comes out into their texts.

    Raises ValueError when there is no such notebook.
    """
    paths = sorted(project.notebooks.glob(file or "*.ipynb"))
    if not paths:
        raise ValueError(f"no notebook {file!r} in {project.notebooks}; name one")
    _, failures, typed = execute(paths)
    for failure in failures:
        print(f"{failure.notebook}, {failure.cell}: {plain(failure.what)}")
    print(f"{rewrite(project, typed)} numbers rewritten")


def survey(project: Project) -> list[Place]:
    """Every number in notebooks, pages and data files of the book.

    Raises ValueError, naming the place, for a mark that cannot be read.
    """
    return [*of_texts(project), *of_data(project)]


def of_texts(project: Project) -> list[Place]:
    """Every number in the notebooks and pages.  Raises ValueError as `survey` does."""
    printed = _printed(project)
    found: list[Place] = []
    for path in sorted(project.notebooks.glob("*.ipynb")):
        found += _read(path.name, _cells(path), partial(marks.numbers, printed=printed))
    for path in sorted(project.book.glob("*.md")):
        text = read_text(path)
        page = partial(marks.numbers, printed=printed, runs=False)
        found += _read(path.name, [("text", text)], page)
    return found


def of_data(project: Project) -> list[Place]:
    """Every number in the data files.  Raises ValueError as `survey` does."""
    printed = _printed(project)
    found: list[Place] = []
    for paper in project.papers:
        for at, text, quoted in _texts(paper.key):
            template = partial(marks.of_template, quoted=quoted, printed=printed)
            found += _read(f"{paper.key}.toml", [(at, text)], template)
    return found + _read("words.toml", _words(), partial(marks.numbers, runs=False))


def _printed(project: Project) -> Callable[[str], str]:
    """What a claim prints, by its id."""
    printed = {claim.id: claim.printed for p in project.papers for claim in p.claims.values()}

    def look_up(id: str) -> str:
        if id not in printed:
            raise ValueError(f"<!-- claim: {id} --> names no claim of any paper")
        return printed[id]

    return look_up


def _read(file: str, texts: Iterable[tuple[str, str]], numbers: Callable) -> list[Place]:
    found = []
    for at, text in texts:
        try:
            listed = numbers(text)
        except ValueError as error:
            raise ValueError(f"{file}, {at}: {error}") from None
        for n in listed:
            around = text[max(0, n.start - ROUND) : n.end + ROUND].replace("\n", " ")
            found.append(Place(file, at, n, around))
    return found


def _cells(path: Path) -> Iterable[tuple[str, str]]:
    for cell in read(path).cells:
        if caption := figure(cell).get("caption"):
            yield f"{cell.id} (caption)", caption
        if cell.cell_type in ("markdown", "raw"):
            yield cell.id, cell.source
        elif text := alternative(cell):
            yield f"{cell.id} (alternative text)", text


def _texts(key: str) -> Iterable[tuple[str, str, Sequence[str]]]:
    """The texts of a paper's data file that are ours, each with what it may quote unmarked."""
    data = ledger.source(key)
    for claim in data["claims"]:
        fields = ("says", "printed", "mended", "unit")
        quoted = [claim.get(name, "") for name in fields]
        for name in ("reason", "tolerance_reason", "lost"):
            yield f"{claim['id']} {name}", claim.get(name, ""), quoted
    for name, erratum in data["errata"].items():
        yield (
            f"erratum {name}",
            erratum["why"].replace("{", "{{").replace("}", "}}"),
            [erratum[part] for part in ("where", "printed", "corrected")],
        )
    for name, reading in data["conventions"].items():
        for part in ("title", "text"):
            plain = reading[part].replace("{", "{{").replace("}", "}}")
            yield f"reading {name}", plain, ()
    for name, change in data["changes"].items():
        yield f"change {name}", change["what"], ()
    for chapter in (data, *data.get("further", [])):
        for name in ("loop", "index", "period"):
            yield f"idea {name}", chapter["idea"][name], ()
        yield "title", chapter["title"], ()


def _words() -> Iterable[tuple[str, str]]:
    return ((key, row["means"]) for key, row in words.source().items())


def rewrite(project: Project, typed: Mapping[str, Sequence]) -> int:
    """Put what a run computed into the notebooks; how many numbers changed.

    A number whose expression failed, or gave no finite number, stays as it is.
    """
    changed, texts = 0, {}
    for name, numbers in typed.items():
        wrong = [n for n in numbers if marks.is_number(n.computed) and not n.right]
        if not wrong:
            continue
        path = project.notebooks / name
        notebook = json.loads(path.read_text(encoding="utf-8"))
        for cell in notebook["cells"]:
            for alt in (False, True):
                here = (cell["id"], alt)
                _put(cell, alt, {n.start: n.computed for n in wrong if (n.cell, n.alt) == here})
        texts[path] = json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"
        changed += len(wrong)
    for path, text in texts.items():
        write(path, text)
    return changed


def _put(cell: dict, alt: bool, values: Mapping[int, str]) -> None:
    """Rewrite one text of a cell as it stands in its file, where a source may be in lines."""
    if not values:
        return
    if alt:
        image = cell["metadata"]["mystnb"]["image"]
        image["alt"] = marks.rewritten(image["alt"], values)
        return
    lines = isinstance(cell["source"], list)
    text = marks.rewritten("".join(cell["source"]), values)
    cell["source"] = text.splitlines(keepends=True) if lines else text


def table(places: Sequence[Place]) -> str:
    """Counts per file and class, as text."""
    width = max((len(place.file) for place in places), default=4)
    lines = [f"{'':{width}}  " + "  ".join(marks.CLASSES)]
    for file in dict.fromkeys(place.file for place in places):
        tally = marks.tally([place.number for place in places if place.file == file])
        cells = "  ".join(f"{tally[kind]:>{len(kind)}}" for kind in marks.CLASSES)
        lines.append(f"{file:{width}}  {cells}")
    return "\n".join(lines)
