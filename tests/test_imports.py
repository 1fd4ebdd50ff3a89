"""Imports run downward only, the mathematics stays free of what draws and runs, nothing is long."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import rcbook
from rcbook.zdomain import inverse

PACKAGE = Path(rcbook.__file__).parent
FLOOR = {room: i for i, rooms in enumerate(rcbook.FLOORS) for room in rooms}
MATHEMATICS = {room for room, floor in FLOOR.items() if floor < FLOOR["pictures"]}
BANNED = {
    "bokeh",
    "matplotlib",
    "pandas",
    "nbclient",
    "nbformat",
    "IPython",
    "rich",
    "jupyter_client",
}
DRAWS = {"pictures", "book"}  # the rooms that may wait for what draws and runs
SHARED = {"memory", "run", "verdict"}  # what all loops have; every other room of theirs is a loop
MODULES = sorted(PACKAGE.rglob("*.py"))
LINES, FUNCTION_LINES = 350, 40

each_module = pytest.mark.parametrize(
    "path", MODULES, ids=[path.relative_to(PACKAGE).as_posix() for path in MODULES]
)


def rooms_of(folder: Path) -> dict[str, list[Path]]:
    """The rooms of a folder: modules, and folders of modules, each with its files."""
    found = {}
    for path in sorted(folder.rglob("*.py")):
        name = path.relative_to(folder).with_suffix("").parts[0]
        if name != "__init__":
            found.setdefault(name, []).append(path)
    return found


ROOMS = rooms_of(PACKAGE)
LOOPS = {name: paths for name, paths in rooms_of(PACKAGE / "loops").items() if name not in SHARED}


def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def room(path: Path) -> str:
    """The first part of a module's name inside the package, such as `machines`."""
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def imported(path: Path) -> set[str]:
    """Absolute dotted names that a module imports anywhere, also inside of functions."""
    names = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively; write the full name"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def rooms_used(path: Path) -> set[str]:
    """The other rooms of the package that a module imports from."""
    parts = (name.split(".") for name in imported(path))
    return {part[1] for part in parts if part[0] == "rcbook" and len(part) > 1} & {*ROOMS} - {
        room(path)
    }


def upward(path: Path) -> set[str]:
    """The rooms that a module imports from and that lie on no lower floor than its own."""
    return {other for other in rooms_used(path) if FLOOR[other] >= FLOOR[room(path)]}


def long_functions(path: Path) -> list[str]:
    """The functions of a module that have too many lines, with their lengths."""
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef)
    functions = [node for node in ast.walk(tree(path)) if isinstance(node, kinds)]
    lengths = ((f.name, f.end_lineno - f.lineno + 1) for f in functions)
    return [f"{name}: {length} lines" for name, length in lengths if length > FUNCTION_LINES]


def test_every_room_is_on_one_floor():
    assert sorted(ROOMS) == sorted(room for rooms in rcbook.FLOORS for room in rooms), (
        "mend FLOORS in src/rcbook/__init__.py: each folder and module of the package once"
    )


def test_no_room_is_called_after_nothing():
    names = {part for path in MODULES for part in path.relative_to(PACKAGE).with_suffix("").parts}
    assert not names & {"core", "common", "util", "utils", "helpers", "misc"}


@each_module
def test_imports_run_downward(path):
    if room(path) in ROOMS:
        assert not upward(path), f"{path} imports from its own floor or from above"
    else:
        assert not rooms_used(path), "the front door imports nothing"


@each_module
def test_the_mathematics_imports_nothing_that_draws_or_runs(path):
    if room(path) in MATHEMATICS:
        assert not {name.split(".")[0] for name in imported(path)} & BANNED


def test_what_is_slow_to_import_is_imported_where_it_is_used():
    """python-control brings matplotlib and takes a second; a command or a loop must not wait."""
    paths = [path for path in MODULES if room(path) not in DRAWS]
    names = [path.relative_to(PACKAGE.parent).with_suffix("").as_posix() for path in paths]
    modules = [name.replace("/", ".").removesuffix(".__init__") for name in names]
    code = (
        f"import sys, {', '.join(modules)}; print(*({{'control', *{BANNED}}} & {{*sys.modules}}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


@each_module
def test_no_module_is_longer_than_one_can_read(path):
    lines = len(path.read_text(encoding="utf-8").splitlines())
    assert lines <= LINES, f"{path.relative_to(PACKAGE)} has {lines} lines; split it by subject"


@each_module
def test_no_function_is_longer_than_a_screen(path):
    assert not long_functions(path), f"in {path.relative_to(PACKAGE)}; split them"


@pytest.mark.parametrize("loop", LOOPS)
def test_every_loop_is_built_on_the_inverse_and_on_the_memory(loop):
    """The one idea can be read off the imports of each loop."""
    imports = {name for path in LOOPS[loop] for name in imported(path)}
    assert any(f"{name}.".startswith("rcbook.loops.memory.") for name in imports), (
        f"{loop} does not import rcbook.loops.memory"
    )
    nodes = [node for path in LOOPS[loop] for node in ast.walk(tree(path))]
    named = {name.rpartition(".")[2] for name in imports}
    named |= {node.attr for node in nodes if isinstance(node, ast.Attribute)}
    offered = {name for name, item in vars(inverse).items() if callable(item)}
    offered = {name for name in offered if vars(inverse)[name].__module__ == inverse.__name__}
    assert named & {"inverse", *offered}, f"{loop} takes nothing from rcbook.zdomain.inverse"


# ---- the rules are seen to fail ----


@pytest.mark.parametrize(
    ("room", "line", "found"),
    [
        ("machines", "from rcbook.loops import memory", {"loops"}),
        ("loops", "from rcbook.machines.lathe import Servo", {"machines"}),
        ("zdomain", "def f():\n    import rcbook.pictures.blocks", {"pictures"}),
        ("signals", "from rcbook import zdomain", set()),
        ("pictures", "from rcbook import loops, machines", set()),
    ],
)
def test_an_import_upward_or_across_is_seen(tmp_path, monkeypatch, room, line, found):
    monkeypatch.setitem(globals(), "PACKAGE", tmp_path)
    path = tmp_path / room / "new.py"
    path.parent.mkdir()
    path.write_text(line, encoding="utf-8")
    assert upward(path) == found


def test_a_long_function_is_named_with_its_length(tmp_path):
    body = "    pass\n" * FUNCTION_LINES
    path = tmp_path / "new.py"
    path.write_text(f"async def f():\n{body}def g():\n    pass\n", encoding="utf-8")
    assert long_functions(path) == [f"f: {FUNCTION_LINES + 1} lines"]
