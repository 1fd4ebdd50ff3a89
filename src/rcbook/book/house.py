"""How the library is built: its floors and a plant's way through it, read from the code.

Both are data first (imports by room, stations by name); pictures, their words and the tables under
them are made of the same data.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import io
import math
import pkgutil
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import rcbook
from rcbook.pictures.blocks import Block, Wire, draw_block_diagram
from rcbook.pictures.sketch import EM, FOCUS, LINE, PAPER, PLANT, Sketch

ROOT = Path(rcbook.__file__).parent
_WIDE, _HIGH, _STOREY = 3.0, 1.0, 2.1  # of a room, and from floor to floor
_BUS = 0.9  # width left for a line that passes a floor


@dataclass(frozen=True)
class Station:
    """A stop on a plant's way: what it is, its functions (`module:name`), and what it hands on."""

    key: str
    what: str
    names: tuple[str, ...]
    gives: str = ""
    fill: str = PAPER


WAY = (  # rows of stations; all of a row hand on to all of the next
    [
        Station(
            "machine",
            "a machine with its paper's numbers",
            ("rcbook.machines.peripheral_mill:PeripheralMill",),
            "physics or records",
            PLANT,
        )
    ],
    [
        Station(
            "plant",
            "a sampled plant",
            ("rcbook.zdomain:zero_order_hold", "rcbook.identify:arx"),
            "plant $G$",
            PLANT,
        )
    ],
    [
        Station(
            "inverse",
            "its zero-phase inverse",
            ("rcbook.zdomain:zero_phase_inverse",),
            "compensator $C$",
            FOCUS,
        )
    ],
    [
        Station(
            "memory",
            "the compensator in a memory",
            ("rcbook.loops.memory:RepetitiveController",),
            "controller",
            FOCUS,
        )
    ],
    [Station("loop", "a loop round the plant", ("rcbook.loops.repetitive:Loop",), "loop")],
    [
        Station("verdict", "is it stable?", ("rcbook.loops.repetitive:verdict",), "verdict"),
        Station("run", "what does it do?", ("rcbook.loops.repetitive:simulate",), "signals"),
    ],
    [Station("ledger", "what is printed, and ours", ("rcbook.ledger:Ledger.check",))],
)


# ---- what the code says ----


def imports() -> dict[str, set[str]]:
    """Every room of the package, found in its folders, and the rooms that it imports from."""
    files: dict[str, list[Path]] = {}
    for path in sorted(ROOT.rglob("*.py")):
        room = path.relative_to(ROOT).with_suffix("").parts[0]
        if room != "__init__":
            files.setdefault(room, []).append(path)
    used = {room: set().union(*map(_imported, paths)) for room, paths in files.items()}
    return {room: (names & files.keys()) - {room} for room, names in used.items()}


def _imported(path: Path) -> set[str]:
    """The second parts of the names `rcbook.ROOM...` that a module imports."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            names += [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
    parts = (name.split(".") for name in names)
    return {part[1] for part in parts if part[0] == "rcbook" and len(part) > 1}


def resolve(name: str) -> object:
    """The function or class behind the `module:name` of a station.

    Raises ValueError when there is none.
    """
    try:
        found = pkgutil.resolve_name(name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"{__file__}: WAY names {name}: {error}; mend it there") from None
    if not callable(found):
        raise ValueError(f"{__file__}: WAY names {name}, which is no function; mend it there")
    return found


def _first_sentence(item: object) -> str:
    """The first sentence of a docstring, with what Markdown would read as its own escaped."""
    text = " ".join((inspect.getdoc(item) or "").partition("\n\n")[0].split())
    parts = (text.partition(". ")[0].rstrip(".") + ".").split("`")
    parts[::2] = (re.sub(r"([\\*_|<>$\[\]{}])", r"\\\1", part) for part in parts[::2])
    return "`".join(parts)


# ---- pictures ----


def draw_floors(ax: Axes) -> Axes:
    """The rooms of the library, floor by floor, with an arrow for every import between them."""
    used = imports()
    places, lines = _lay_out(rcbook.FLOORS, used)
    right = max(abs(x) for x, _ in places.values()) + _WIDE / 2 + 0.2
    top = (len(rcbook.FLOORS) - 1) * _STOREY + _HIGH / 2 + 0.2
    sketch = Sketch(ax, (-right, -_HIGH / 2 - 0.2, right, top), EM)
    for *bends, tip in lines:
        sketch.line(bends, LINE)
        sketch.arrow(bends[-1], tip, LINE)
    for room in used:
        x, y = places[room]
        sketch.box(x - _WIDE / 2, y - _HIGH / 2, _WIDE, _HIGH, FOCUS if room == "loops" else PAPER)
        sketch.write(room, x, y)
    return ax


def _lay_out(
    floors: Sequence[Sequence[str]], used: Mapping[str, set[str]]
) -> tuple[dict[str, tuple[float, float]], list[list[tuple[float, float]]]]:
    """Centres of rooms, and the corners of a line for each import.

    A line that passes a floor goes through a gap there; lines to the same room share the gap.
    """
    floor = {room: i for i, rooms in enumerate(floors) for room in rooms if room in used}
    rows = [[room for room in rooms if room in used] for rooms in floors]
    routes = []
    for room in floor:
        for other in sorted(used[room]):
            gaps = [(other, i) for i in range(floor[room] - 1, floor[other], -1)]
            routes.append([room, *gaps, other])
            for gap in gaps:
                if gap not in rows[gap[1]]:
                    rows[gap[1]].append(gap)
    x = _ordered(rows, routes)
    places = {room: (x[room], i * _STOREY) for room, i in floor.items()}
    return places, [_line(route, x, places, routes) for route in routes]


def _ordered(rows: list[list], routes: Sequence[Sequence]) -> dict:
    """Places from left to right: each stop moves towards the mean of its neighbours on routes."""
    near: dict = {stop: set() for row in rows for stop in row}
    for route in routes:
        for one, other in pairwise(route):
            near[one].add(other)
            near[other].add(one)
    x = {}
    for row in rows:
        x |= _spread(row)
    for _ in range(8):
        for row in [*rows, *rows[::-1]]:
            # fsum, since sets have no order and the same code must give the same picture
            middle = {s: math.fsum(x[n] for n in near[s]) / max(len(near[s]), 1) for s in row}
            row.sort(key=lambda stop: (middle[stop], str(stop)))
            x |= _spread(row)
    return x


def _spread(row: Sequence) -> dict:
    """Centres of rooms and gaps side by side about the middle."""
    widths = [_WIDE + 0.4 if isinstance(stop, str) else _BUS for stop in row]
    edges = np.cumsum([0.0, *widths]) - sum(widths) / 2
    return dict(zip(row, (edges[:-1] + edges[1:]) / 2, strict=True))


def _line(route: Sequence, x: Mapping, places: Mapping, routes: Sequence) -> list:
    """Corners from the bottom of a room through gaps to the top of another."""
    room, *gaps, other = route
    out = _berth(x[route[1]], {x[r[1]] for r in routes if r[0] == room})
    into = _berth(x[route[-2]], {x[r[-2]] for r in routes if r[-1] == other})
    points = [(places[room][0] + out, places[room][1] - _HIGH / 2)]
    for gap in gaps:
        points += [(x[gap], gap[1] * _STOREY + side * _HIGH / 2) for side in (1, -1)]
    return [*points, (places[other][0] + into, places[other][1] + _HIGH / 2)]


def _berth(one: float, all_of_them: set[float]) -> float:
    """Where on a room's edge the line from or to `one` is, so that lines do not meet there."""
    place = sorted(all_of_them).index(one) + 1
    return 0.8 * _WIDE * (place / (len(all_of_them) + 1) - 0.5)


def draw_way(ax: Axes) -> Axes:
    """A plant's way from the machine to the verdict, with the functions that take it there."""
    items, wires = [], []
    for i, row in enumerate(WAY):
        for j, station in enumerate(row):
            x = 7.6 * (j - (len(row) - 1) / 2)
            text = "\n".join([station.what, *map(_short, station.names)])
            items.append(Block(station.key, text, (x, -2.6 * i), station.fill))
            for one in WAY[i - 1] if i else ():
                straight = len(row) == len(WAY[i - 1]) == 1
                via = None if straight else -2.6 * i + 1.25
                wires.append(Wire(one.key, station.key, one.gives if not j else "", via))
    return draw_block_diagram(ax, items, wires)


def _short(name: str) -> str:
    return name.removeprefix("rcbook.").replace(":", ".")


def pictures() -> dict[str, bytes]:
    """Both pictures as PNG on white, by file name."""
    return {f"{name}.png": _png(draw, size) for name, (draw, size) in _PICTURES.items()}


def _png(draw: Callable[[Axes], Axes], size: tuple[float, float]) -> bytes:
    with matplotlib.style.context("rcbook.pictures.rcbook"):
        figure, file = Figure(size), io.BytesIO()  # without pyplot: no window system is asked
        draw(figure.add_subplot())
        figure.savefig(file, format="png")
    return file.getvalue()


_PICTURES = {"floors": (draw_floors, (6.6, 6.6)), "way": (draw_way, (6.8, 9.0))}  # inches


# ---- words ----


def pages() -> dict[str, str]:
    """What stands under the headings of `book/house.md`: pictures with their words, and tables."""
    return {
        "floors.md": _image("floors", floors_in_words()) + "\n" + _rooms(),
        "way.md": _image("way", way_in_words()) + "\n" + _stations(),
    }


def _image(name: str, words: str) -> str:
    return f"```{{image}} {name}.png\n:alt: {words}\n:width: 480px\n:align: center\n```\n"


def floors_in_words() -> str:
    """The picture of the floors for those who do not see it."""
    used = imports()
    rows = "; ".join(" and ".join(r for r in rooms if r in used) for rooms in rcbook.FLOORS)
    arrows = "; ".join(f"{room} to {', '.join(sorted(used[room]))}" for room in used if used[room])
    return (
        f"Rooms from the ground up: {rows}. Arrows lead from a room to what it imports: {arrows}."
    )


def way_in_words() -> str:
    """The picture of the way for those who do not see it."""
    stops = (
        " and ".join(f"{s.what} ({', '.join(map(_short, s.names))})" for s in row) for row in WAY
    )
    return f"Boxes in a column, each leading to the next: {'; '.join(stops)}."


def _rooms() -> str:
    """The rooms as a table, from the top down."""
    used = imports()
    lines = ["| room | what it is for | imports |", "|---|---|---|"]
    for room in (room for rooms in reversed(rcbook.FLOORS) for room in rooms if room in used):
        purpose = _first_sentence(importlib.import_module(f"rcbook.{room}"))
        lines.append(f"| {room} | {purpose} | {', '.join(sorted(used[room])) or 'nothing'} |")
    return "\n".join(lines) + "\n"


def _stations() -> str:
    """The functions of the way as a table, each with a link to its description."""
    lines = ["| function | what it does |", "|---|---|"]
    for station in (station for row in WAY for station in row):
        for name in station.names:
            found = resolve(name)
            link = f"{{py:obj}}`{_short(name)} <{found.__module__}.{found.__qualname__}>`"
            lines.append(f"| {link} | *{station.what}*<br>{_first_sentence(found)} |")
    return "\n".join(lines) + "\n"
