"""Block diagrams as data: a table of items, and a table of right-angled wires between their names.

Lengths are in drawing units, one of which is about the height of a block.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

from rcbook.pictures.sketch import EM, HEAD, INK, LINE, PAPER, Point, Sketch, text_size

LIMITED = ((-1.0, -1.0), (-0.4, -1.0), (0.4, 1.0), (1.0, 1.0))  # icon of a limit
HELD = ((-1, -1), (-0.5, -1), (-0.5, 0.2), (0, 0.2), (0, 1), (0.5, 1), (0.5, -0.2), (1, -0.2))
SUM_RADIUS = 0.24
SIGN_SPOTS = {"w": (-0.41, -0.25), "e": (0.41, -0.25), "n": (0.25, 0.40), "s": (0.25, -0.40)}
_BASELINE = 0.17  # of a label above its wire
_ICON = (0.5, 0.22)  # half width and half height
_COMPASS = {(1, 0): "e", (-1, 0): "w", (0, 1): "n", (0, -1): "s"}
_BEFORE = {"baseline": 0.35, "bottom": 0, "center": 0.5, "top": 1, "left": 0, "right": 1}


@dataclass(frozen=True)
class Block:
    """A box with text, centred at `xy`; a width or height left out is what the text needs.

    A `title` stands above the box.  An `icon` is a curve over the text, its points within -1 to 1.
    """

    name: str
    text: str
    xy: Point = (0.0, 0.0)
    fill: str = PAPER
    width: float | None = None
    height: float | None = None
    title: str = ""
    icon: Sequence[Point] = ()


@dataclass(frozen=True)
class Sum:
    """A summing circle at `xy`; `signs` gives a sign to every side (n, e, s, w) a wire enters."""

    name: str
    xy: Point = (0.0, 0.0)
    signs: Mapping[str, str] = field(default_factory=lambda: {"w": "+", "s": "−"})


@dataclass(frozen=True)
class Node:
    """A pick-off dot at `xy`."""

    name: str
    xy: Point = (0.0, 0.0)


@dataclass(frozen=True)
class Frame:
    """A dashed outline centred at `xy`; its `title` is in the lower left corner."""

    name: str
    xy: Point
    width: float
    height: float
    title: str = ""


@dataclass(frozen=True)
class Wire:
    """A right-angled wire between two items (by name) or free ends (points).

    The wire leaves vertically to the height `via`, runs there, and arrives vertically; without
    `via` it runs at the height of its start.
    """

    start: str | Point
    end: str | Point
    label: str = ""
    via: float | None = None
    color: str = INK
    dashed: bool = False


Item = Block | Sum | Node | Frame
Label = tuple[str, float, float, dict[str, str]]  # text, its place and its alignment


def draw_block_diagram(ax: Axes, items: Sequence[Item], wires: Sequence[Wire]) -> Axes:
    """Draw `items` and the `wires` between them; the axes' limits are set to fit.

    Raises ValueError for a name used twice, a wire to an unknown name, a wire of no length, and
    a wire that enters a sum on a side without a sign.
    """
    routes = _routes(items, wires)
    points = [point for route in routes for point in route]
    points += [np.add(i.xy, np.multiply(half_size(i), side)) for i in items for side in (-1, 1)]
    for text, *xy, style in _labels(items, wires, routes):
        size = np.array(text_size(text))
        corner = xy - size * (_BEFORE[style["ha"]], _BEFORE[style["va"]])
        points += [corner, corner + size]
    box = [*(np.min(points, axis=0) - 0.12), *(np.max(points, axis=0) + 0.12)]
    add_blocks(Sketch(ax, box, EM), items, wires)
    return ax


def add_blocks(sketch: Sketch, items: Sequence[Item], wires: Sequence[Wire]) -> None:
    """Draw a block diagram into a sketch.  Raises ValueError as `draw_block_diagram` does."""
    routes, dots = _routes(items, wires), {item.name for item in items if isinstance(item, Node)}
    for wire, route in zip(wires, routes, strict=True):
        step = np.array(_direction(route[-2], route[-1]))
        end = route[-1] if wire.end in dots else route[-1] - 0.6 * HEAD * step
        style = {"linestyle": (0, (4, 2)) if wire.dashed else "-", "solid_joinstyle": "miter"}
        sketch.line([*route[:-1], end], LINE, wire.color, gid="wire", **style)
        if wire.end not in dots:
            sketch.head(route[-1], step, 1.0, wire.color, gid="wire head", zorder=2.5)
    for item in items:
        _draw_item(sketch, item)
    for text, x, y, style in _labels(items, wires, routes):
        sketch.write(text, x, y, **style)


def path(*stops: str | Point) -> list[Wire]:
    """Wires one after another, from alternating ends and labels: end, label, end, label, end."""
    ends = pairwise(stops[::2])
    return [Wire(*pair, label) for pair, label in zip(ends, stops[1::2], strict=True)]


def row(*parts: str | Item) -> tuple[list[Item], list[Wire]]:
    """Items in a row at height 0 and its wires, from alternating labels and items.

    The first and the last part are the labels of the wires that come in and go out.
    """
    x, items, stops = 0.0, [], [(0.0, 0.0)]
    for label, item in zip(parts[:-1:2], parts[1::2], strict=True):
        bare = isinstance(item, Node) and not label
        half = half_size(item)[0]
        x += half + (0.5 if bare else max(0.9, text_size(label)[0] + 0.8))
        items.append(replace(item, xy=(x, 0.0)))
        stops += [label, item.name]
        x += half
    end = (x + max(0.9, text_size(parts[-1])[0] + 0.8), 0.0)
    return items, path(*stops, parts[-1], end)


def half_size(item: Item) -> Point:
    """Half of an item's width and height."""
    if isinstance(item, Sum | Node):
        return (SUM_RADIUS if isinstance(item, Sum) else 0.0,) * 2
    if isinstance(item, Frame):
        return item.width / 2, item.height / 2
    width, height = text_size(item.text)
    wide, high = max(1.1, width + 0.5), max(1.0, height + 2 * _lift(item) + 0.45)
    return (item.width or wide) / 2, (item.height or high) / 2


def _lift(item: Block) -> float:
    """How far above the middle of a block its icon is; its text is as far below."""
    return _ICON[1] + 0.1 if item.icon else 0.0


def _routes(items: Sequence[Item], wires: Sequence[Wire]) -> list[list[Point]]:
    """Corners of every wire from border to border."""
    named = {item.name: item for item in items}
    for item in items:
        if item is not named[item.name]:
            raise ValueError(f"two items are named {item.name!r}: give every item its own name")
    for end in (end for wire in wires for end in (wire.start, wire.end)):
        if isinstance(end, str) and end not in named:
            known = ", ".join(map(repr, named)) or "no items"
            raise ValueError(f"a wire ends at {end!r}, which is not drawn: use one of {known}")
    return [_route(wire, named) for wire in wires]


def _route(wire: Wire, named: Mapping[str, Item]) -> list[Point]:
    start, end = (named.get(e, Node("", e)) for e in (wire.start, wire.end))
    level = start.xy[1] if wire.via is None else wire.via
    bends = [start.xy, (start.xy[0], level), (end.xy[0], level), end.xy]
    bends = [start.xy, *(b for a, b in pairwise(bends) if not np.allclose(a, b))]
    if len(bends) < 2:
        raise ValueError(f"the wire {wire.start!r} to {wire.end!r} has no length: move an end")
    out, back = _direction(start.xy, bends[1]), _direction(end.xy, bends[-2])
    if isinstance(end, Sum) and (side := _COMPASS[back]) not in end.signs:
        raise ValueError(
            f"a wire enters the sum {end.name!r} from side {side!r}, which has no sign: "
            f"add {side!r} to its signs"
        )
    borders = ((start, out), (end, back))
    first, last = (tuple(np.add(i.xy, np.multiply(way, half_size(i)))) for i, way in borders)
    return [first, *bends[1:-1], last]


def _direction(here: Point, there: Point) -> tuple[int, int]:
    """Compass step from `here` to `there` along the longer of the two offsets."""
    dx, dy = np.subtract(there, here)
    return (int(np.sign(dx)), 0) if abs(dx) > abs(dy) else (0, int(np.sign(dy)))


def _labels(
    items: Sequence[Item], wires: Sequence[Wire], routes: Sequence[list[Point]]
) -> list[Label]:
    middle, above = {"ha": "center", "va": "center"}, {"ha": "center", "va": "baseline"}
    labels = []
    for item in items:
        (x, y), (dx, dy) = item.xy, half_size(item)
        if isinstance(item, Block):
            labels.append((item.text, x, y - _lift(item), middle))
            labels.append((item.title, x, y + dy + _BASELINE, above))
        if isinstance(item, Frame):
            labels.append((item.title, x - dx + 0.3, y - dy + 0.25, {**above, "ha": "left"}))
        for side, sign in item.signs.items() if isinstance(item, Sum) else ():
            dx, dy = SIGN_SPOTS[side]
            mirrored = side == "s" and "e" in item.signs
            labels.append((sign, x + (-dx if mirrored else dx), y + dy, middle))
    labels += map(_wire_label, wires, routes)
    return [label for label in labels if label[0]]


def _wire_label(wire: Wire, route: Sequence[Point]) -> Label:
    """Beyond a free vertical tail, else above the longest level run, else right of the wire."""
    runs = list(pairwise(route))
    level = [run for run in runs if _direction(*run)[1] == 0]
    (x0, y0), (x1, y1) = max(level or runs, key=lambda run: np.hypot(*np.subtract(*run)))
    if level:
        head = HEAD * np.sign(x1 - x0) * ((x1, y1) == route[-1])
        x, y, ha, va = (x0 + x1 - head) / 2, y0 + _BASELINE, "center", "baseline"
    elif isinstance(wire.start, str):
        x, y, ha, va = x0 + 0.14, (y0 + y1) / 2, "left", "center"
    else:
        x, ha, (y, va) = x0, "center", (y0 + 0.12, "bottom") if y1 < y0 else (y0 - 0.1, "top")
    return wire.label, x, y, {"ha": ha, "va": va, "color": wire.color}


def _draw_item(sketch: Sketch, item: Item) -> None:
    half = np.array(half_size(item))
    corner = item.xy - half
    if isinstance(item, Node):
        sketch.dot(item.xy)
    elif isinstance(item, Sum):
        sketch.circle(item.xy, SUM_RADIUS)
    elif isinstance(item, Frame):
        sketch.box(*corner, *2 * half, "none", 1.0, ec="#5a5a5a", linestyle=(0, (5, 3)), zorder=1)
    else:
        rounded = "round,pad=0,rounding_size=0.08"
        sketch.shape(FancyBboxPatch(corner, *2 * half, rounded), item.fill)
        if item.icon:
            sketch.line(np.multiply(item.icon, _ICON) + item.xy + (0.0, _lift(item)))
