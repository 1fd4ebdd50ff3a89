"""Imports run downward only, and the mathematics stays free of what draws and runs the book."""

import ast
from pathlib import Path

import pytest

import rcbook

PACKAGE = Path(rcbook.__file__).parent
LAYERS = (
    {"zdomain", "signals", "ledger"},
    {"identify", "loops"},
    {"machines"},
    {"pictures"},
    {"book", "cli"},
)
APART = ({"machines"}, {"identify", "loops"})
MATHEMATICS = set().union(*LAYERS[:3])
BANNED = {"matplotlib", "pandas", "nbclient", "nbformat", "IPython", "rich", "jupyter_client"}
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path.name != "__init__.py")


def room(path: Path) -> str:
    """The first part of a module's name inside the package, such as `machines`."""
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imported(path: Path) -> set[str]:
    """Absolute dotted names that a module imports anywhere, also inside of functions."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively; write the full name"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def rooms(path: Path) -> set[str]:
    """The rooms of the package that a module imports from."""
    parts = (name.split(".") for name in imported(path))
    return {part[1] for part in parts if part[0] == "rcbook" and len(part) > 1} - {"__path__"}


def level(name: str) -> int:
    """The layer of a room.  Fails for a room that no layer names."""
    found = [i for i, layer in enumerate(LAYERS) if name in layer]
    assert found, f"{name} is in no layer; put it into LAYERS where it belongs"
    return found[0]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: room(path) + "." + path.stem)
def test_imports_run_downward(path):
    for other in rooms(path) - {room(path)}:
        same_and_free = level(other) == level(room(path)) in (0, 1, 3, 4)
        assert level(other) < level(room(path)) or same_and_free, f"{path.name} imports {other}"


@pytest.mark.parametrize("path", MODULES, ids=lambda path: room(path) + "." + path.stem)
def test_machines_and_controllers_do_not_know_each_other(path):
    one, other = APART
    if room(path) in one:
        assert not rooms(path) & other
    if room(path) in other:
        assert not rooms(path) & one


@pytest.mark.parametrize("path", MODULES, ids=lambda path: room(path) + "." + path.stem)
def test_the_mathematics_imports_nothing_that_draws_or_runs(path):
    if room(path) in MATHEMATICS:
        assert not {name.split(".")[0] for name in imported(path)} & BANNED
