"""Noncircular turning seen along the spindle axis, and the signals around the computer."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from rcbook.machines.lathe import polygon_section
from rcbook.pictures import sketch as pen
from rcbook.pictures.blocks import Block, Node, Wire, add_blocks
from rcbook.pictures.sketch import BOLD, FOCUS, PLANT, STEEL, THIN, TOOL, Sketch

CENTRE, INRADIUS = (3.1, 5.1), 1.3  # spindle axis, and half of the square's side
BAR, CHUCK = 2.0, 2.55  # radii
TURNED = np.radians(30.0)  # by which the spindle has turned since a side faced the tool
SLIDE, SCREW = (6.9, 9.2), 4.55  # left and right end, and height of the screw
GRAPH = (10.9, 15.4, 6.35, 7.5)  # left, right, bottom and top of the radius over one turn


def draw_lathe_setup(ax: Axes, half_side: float = 10e-3) -> Axes:
    """Draw noncircular turning seen along the spindle axis, and the signals around the computer.

    A square of that half side, in m, is turned on a round bar; the graph is its radius over one
    turn.  Made for a figure of about 8 by 4.2 inches.
    """
    sketch, below = Sketch(ax), {"fill": FOCUS, "width": 2.3, "height": 1.4}
    _draw_section(sketch)
    _draw_slide(sketch, 1e3 * half_side)
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
        Wire("computer", "motor", "command $y_m$"),
        Wire("position", "computer", "position $y$", via=0.25),
    ]
    add_blocks(sketch, items, wires)
    return ax


def _around(radius: float | np.ndarray, angle: float | np.ndarray) -> np.ndarray:
    """Points about the spindle axis at an angle on the workpiece; the tool is at `TURNED`."""
    return pen.about(CENTRE, radius, np.pi / 2 + TURNED - np.asarray(angle))


def _draw_section(sketch: Sketch) -> None:
    """The turned square in its chuck, its half side, its radius at the tool, the spindle angle."""
    sketch.chuck(CENTRE, CHUCK, np.radians(20.0))
    sketch.turn(CENTRE, CHUCK + 0.32, -34.0, 28.0)
    sketch.circle(CENTRE, BAR, PLANT)
    corners = np.pi / 4 + np.pi / 2 * np.arange(4)
    sketch.area(_around(polygon_section(corners, 4, INRADIUS), corners), STEEL)
    sketch.line([CENTRE, _around(CHUCK, 0.0)], THIN, linestyle=pen.CHAIN)
    sketch.arrow(CENTRE, _around(INRADIUS, np.pi), THIN, both=True)
    sketch.arrow(CENTRE, _around(polygon_section(TURNED, 4, INRADIUS), TURNED), BOLD, both=True)
    sketch.turn(CENTRE, 0.78, 90.0, 90.0 + np.degrees(TURNED), THIN)
    sketch.circle(CENTRE, 0.07, pen.INK, 0)
    x, y = CENTRE
    sketch.words((r"$y_r(\theta)$", x + 0.72, y + 0.35), (r"$\theta$", x + 1.02, y - 0.29))
    sketch.words(("$a$", x - 0.42, y + 0.58), ("workpiece", 5.75, 7.0, "left", (x + 1.3, y + 0.75)))


def _draw_slide(sketch: Sketch, half_side: float) -> None:
    """Tool on the section, slide and screw; the radius over a turn, for a half side in mm."""
    tip, (left, right) = _around(polygon_section(TURNED, 4, INRADIUS), TURNED), SLIDE
    back = left - tip[0]
    sketch.area(np.add(tip, [(0.0, 0.0), (0.22, -0.5), (back, -0.5), (back, 0.0)]), TOOL)
    sketch.box(left - 0.6, 3.25, 4.4, 0.4, hatch="////")
    sketch.box(left, 3.65, right - left, 1.8, PLANT)
    turns = np.linspace(right, 11.2, 23)
    for height in (np.full(23, -0.11), np.full(23, 0.11), 0.11 * (-1.0) ** np.arange(23)):
        sketch.line(np.column_stack([turns, SCREW + height]), THIN)
    sketch.line([(13.2, SCREW), (13.55, SCREW)], 3.0)  # the shaft
    sketch.arrow((left + 0.3, 5.9), (right - 0.3, 5.9), BOLD, both=True)
    sketch.words(("tool", 6.22, 4.2), ("slide", (left + right) / 2, SCREW), ("$y$", 6.92, 5.86))

    left, right, bottom, top = GRAPH
    angle = np.append(np.linspace(0.0, 2 * np.pi, 361), TURNED)
    share = (polygon_section(angle, 4, 1.0) - 1) / (np.sqrt(2) - 1)
    x, y = left + (right - left) * angle / (2 * np.pi), bottom + (top - bottom) * share
    corner = rf"$\sqrt{{2}}\,a$ = {np.sqrt(2) * half_side:.0f} mm"
    for level, word in ((bottom, f"$a$ = {half_side:g} mm"), (top, corner)):
        sketch.line([(left, level), (right, level)], THIN, pen.FAINT, linestyle=pen.DASHED)
        sketch.write(word, left - 0.25, level, "right")
    sketch.line(np.column_stack([x, y])[:-1], BOLD)
    sketch.circle((x[-1], y[-1]), 0.1, pen.INK, 0)
    sketch.write(r"radius $y_r(\theta)$, one turn", (left + right) / 2, 8.1)
