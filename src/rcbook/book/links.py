"""Links in the text of a chapter: to figures and equations, to the glossary, to the functions.

A chapter is written in plain Markdown, which any Jupyter shows; what only the rendered book can
lead to is put in here.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterable, Mapping

import rcbook

# What has no words of the text in it: code, formulas, roles, links, tags, headings, targets.
_CLOSED = re.compile(
    r"```.*?```|\$\$.+?\$\$|\$[^$]+\$|\{[\w:-]+\}`[^`]+`|`[^`\n]+`|\[[^\]]*\]\([^)]*\)|<[^>]+>|"
    r"^#+ [^\n]*$|^\([\w-]+\)=$",
    re.DOTALL | re.MULTILINE,
)
_NUMBERED = re.compile(r"\[(figure|equation)\]\(#((?:fig|eq)-[\w-]+)\)", re.IGNORECASE)
_CODE = re.compile(r"(?<![`}])`([A-Za-z_]\w*\.[A-Za-z_]\w*)(?:\(\))?`(?!`)")
# Words of the glossary that a text also uses in their everyday sense; an author links them by hand.
EVERYDAY = {"advance", "cascade", "claim", "factor", "headline", "lead", "period", "process"}
EVERYDAY |= {"reading", "verdict"}
_GLOSSARY = re.compile(r"^:::\{glossary\}\n(.*?)^:::$", re.DOTALL | re.MULTILINE)
_MACHINERY = ("rcbook.book", "rcbook.cli")


def modules() -> list[str]:
    """The modules of the package that have a place on the API page."""
    found = pkgutil.walk_packages(rcbook.__path__, "rcbook.")
    return [m.name for m in found if not m.ispkg and not m.name.startswith(_MACHINERY)]


def functions() -> dict[str, str]:
    """Where each public function and class stands, by the name that chapters call it by.

    A chapter says `repetitive.simulate`, whichever module of that package it is in; a name that two
    packages use for two things is left out.
    """
    found: dict[str, set[str]] = {}
    documented = set(modules())
    packages = [m.name for m in pkgutil.walk_packages(rcbook.__path__, "rcbook.")]
    for name in packages:
        if name.startswith(_MACHINERY):
            continue
        for member, thing in vars(importlib.import_module(name)).items():
            home = getattr(thing, "__module__", None)
            is_ours = inspect.isroutine(thing) or inspect.isclass(thing)
            if is_ours and home in documented and not member.startswith("_") and thing.__doc__:
                called = f"{name.rpartition('.')[2]}.{member}"
                found.setdefault(called, set()).add(f"{home}.{thing.__qualname__}")
    return {called: places.pop() for called, places in found.items() if len(places) == 1}


def terms(glossary: str) -> list[str]:
    """The terms of a glossary page, those that texts also use in their everyday sense left out."""
    lines = "\n".join(_GLOSSARY.findall(glossary)).splitlines()
    return [line for line in lines if line.strip() and line[0] != " " and line not in EVERYDAY]


def numbered(text: str) -> str:
    """`text` with links to figures and equations as roles that show their numbers."""

    def role(found: re.Match) -> str:
        word, name = found.groups()
        kind = name.partition("-")[0]
        return f"{{numref}}`{word} %s <{name}>`" if kind == "fig" else f"{word} {{eq}}`{name}`"

    return _NUMBERED.sub(role, text)


def called(text: str, functions: Mapping[str, str]) -> str:
    """`text` with names of functions in backticks as links to the API page."""

    def role(found: re.Match) -> str:
        place = functions.get(found[1])
        return f"{{py:obj}}`{found[1]} <{place}>`" if place else found[0]

    return _CODE.sub(role, text)


def first_uses(texts: Iterable[str], terms: Iterable[str]) -> list[str]:
    """The texts of a chapter in order, each term linked to the glossary where it first stands."""
    left = {term.casefold(): term for term in terms}
    return [_linked(text, left) for text in texts]


def _linked(text: str, left: dict[str, str]) -> str:
    """`text` with its first uses of the terms in `left`, from which they are taken."""
    if not left:
        return text
    any_term = "|".join(re.escape(t).replace(r"\ ", r"\s+") for t in sorted(left, key=len)[::-1])
    use = re.compile(rf"(?<![\w-])({any_term})((?:es|s)?)(?![\w-])", re.IGNORECASE)

    def role(found: re.Match) -> str:
        term = left.pop(" ".join(found[1].casefold().split()), None)
        return f"{{term}}`{' '.join(found[0].split())} <{term}>`" if term else found[0]

    parts, at = [], 0
    for closed in [*_CLOSED.finditer(text), None]:
        end = closed.start() if closed else len(text)
        parts.append(use.sub(role, text[at:end]))
        if closed:
            parts.append(closed[0])
            at = closed.end()
    return "".join(parts)
