"""Noncircular turning seen along the spindle axis, the signals round the computer, and sections."""

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from rcbook.machines.lathe import polygon_section
from rcbook.pictures.blocks import Block, Node, Wire, add_blocks
from rcbook.pictures.results import MILLI, bare_polar
from rcbook.pictures.sketch import BOLD, FOCUS, PLANT, STEEL, THIN, TOOL, Sketch, about, turn_of

CENTRE, INRADIUS = (3.1, 5.1), 1.3  # spindle axis, and half of the square's side
BAR, CHUCK = 2.0, 2.55  # radii
TURNED = np.radians(30.0)  # by which the spindle has turned since a side faced the tool
SLIDE, SCREW = (6.9, 9.2), 4.55  # left and right end, and height of the screw
GRAPH = (10.9, 15.4, 6.35, 7.5)  # left, right, bottom and top of the radius over one turn


def draw_lathe_setup(ax: Axes, half_side: float = 10e-3) -> Axes:
    """Draw turning of a square of a half side in m, and the signals around the computer."""
    sketch, below = Sketch(ax), {"fill": FOCUS, "width": 2.3, "height": 1.4}
    _draw_section(sketch)
    _draw_slide(sketch)
    _draw_graph(sketch, MILLI * half_side)
    items = [
        Node("chuck", (CENTRE[0], CENTRE[1] - CHUCK + 0.28)),
        Block("angle", "spindle\nencoder", (CENTRE[0], 1.45), **below),
        Block("computer", "computer", (7.9, 1.45), **below),
        Block("motor", "servo\nmotor", (12.2, SCREW), width=2.0, height=1.5),
        Block("position", "encoder", (14.6, SCREW), FOCUS, width=2.1, height=1.1),
    ]
    wires = [
        Wire("angle", "chuck"),  # without a head: they turn together
        Wire("angle", "computer", r"angle $\theta$"),
        Wire("computer", "motor", "command $v$"),
        Wire("position", "computer", "position $y$", via=0.25),
    ]
    add_blocks(sketch, items, wires)
    return ax


def outline(angle: ArrayLike, radius: ArrayLike | None = None) -> np.ndarray:
    """Points at an angle (rad) on the workpiece, at a radius or on the square's outline."""
    if radius is None:
        radius = polygon_section(angle, 4, INRADIUS)
    return about(CENTRE, radius, np.pi / 2 + TURNED - np.asarray(angle))  # the tool is at TURNED


def _draw_section(sketch: Sketch) -> None:
    """The turned square in its chuck, its half side, its radius at the tool, the spindle angle."""
    sketch.chuck(CENTRE, CHUCK, np.radians(20.0))
    sketch.turn(CENTRE, CHUCK + 0.32, np.radians([-34.0, 28.0]))
    sketch.circle(CENTRE, BAR, PLANT)
    sketch.area(outline(np.pi / 4 + turn_of(4)), STEEL)
    sketch.reference([CENTRE, outline(0.0, CHUCK)])
    sketch.span(CENTRE, outline(np.pi))
    sketch.span(CENTRE, outline(TURNED), pen=BOLD)
    sketch.turn(CENTRE, 0.78, (np.pi / 2, np.pi / 2 + TURNED), THIN)
    sketch.dot(CENTRE)
    x, y = CENTRE
    sketch.words((r"$r(\theta)$", x + 0.72, y + 0.35), (r"$\theta$", x + 1.02, y - 0.29))
    sketch.words(("$a$", x - 0.42, y + 0.58), ("workpiece", 5.75, 7.0, "left", (x + 1.3, y + 0.75)))


def _draw_slide(sketch: Sketch) -> None:
    """Tool on the section, slide, guide, screw and shaft."""
    tip, (left, right) = outline(TURNED), SLIDE
    back = left - tip[0]
    sketch.area(np.add(tip, [(0.0, 0.0), (0.22, -0.5), (back, -0.5), (back, 0.0)]), TOOL)
    sketch.box(left - 0.6, 3.25, 4.4, 0.4, hatch="////")
    sketch.box(left, 3.65, right - left, 1.8, PLANT)
    turns = np.linspace(right, 11.2, 23)
    for height in (np.full(23, -0.11), np.full(23, 0.11), 0.11 * (-1.0) ** np.arange(23)):
        sketch.line(np.column_stack([turns, SCREW + height]), THIN)
    sketch.line([(13.2, SCREW), (13.55, SCREW)], 3.0)  # the shaft
    sketch.span((left + 0.3, 5.9), (right - 0.3, 5.9), pen=BOLD)
    sketch.words(("tool", 6.22, 4.2), ("slide", (left + right) / 2, SCREW), ("$y$", 6.92, 5.86))


def _draw_graph(sketch: Sketch, half_side: float) -> None:
    """The radius over a turn, for a half side in mm."""
    left, right, bottom, top = GRAPH
    angle = np.append(np.linspace(0.0, 2 * np.pi, 361), TURNED)
    share = (polygon_section(angle, 4, 1.0) - 1) / (np.sqrt(2) - 1)
    x, y = left + (right - left) * angle / (2 * np.pi), bottom + (top - bottom) * share
    corner = rf"$\sqrt{{2}}\,a$ = {np.sqrt(2) * half_side:.0f} mm"
    for level, word in ((bottom, f"$a$ = {half_side:g} mm"), (top, corner)):
        sketch.reference([(left, level), (right, level)])
        sketch.write(word, left - 0.25, level, "right")
    sketch.line(np.column_stack([x, y])[:-1], BOLD)
    sketch.dot((x[-1], y[-1]), 0.1)
    sketch.write(r"radius $r(\theta)$, one turn", (left + right) / 2, 8.1)


def draw_section(
    ax: Axes, angle: ArrayLike, radius: ArrayLike, error: ArrayLike, magnified: float
) -> Axes:
    """Draw a turn of a section (`ax` is polar), angles in rad, its error magnified."""
    drawn = np.asarray(radius) - magnified * np.asarray(error)
    ax.plot(np.append(angle, angle[0]), np.append(drawn, drawn[0]))
    bare_polar(ax, {})
    return ax
