"""Side milling seen along the spindle axis, from force to feed command, and the waves it leaves."""

from fractions import Fraction

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator
from scipy.signal import find_peaks

from rcbook.machines.peripheral_mill import HORNG1989, INCH, PeripheralMill
from rcbook.pictures.blocks import Block, Node, Wire, add_blocks, path
from rcbook.pictures.results import AXES, MICRO, MILLI
from rcbook.pictures.sketch import DISTURBED, FOCUS, PLANT, STEEL, Sketch, about

SPINDLE, RADIUS = (3.9, 5.42), 1.35  # spindle axis, and radius of the cutter
OFFSET, PHASE = 0.27, np.radians(-35.0)  # runout, far larger than in truth, and where it points
TURN = 1.6  # feed during one turn, far larger than in truth
PIECE, UNCUT = (1.3, 8.1), 4.4  # left and right end of the workpiece, height of its uncut edge


def draw_milling_setup(ax: Axes, mill: PeripheralMill = HORNG1989) -> Axes:
    """Draw side milling, with runout and feed exaggerated, and the path from force to command."""
    sketch, corner, size = Sketch(ax), (10.3, 2.3), {"width": 3.2, "height": 1.4}
    _draw_workpiece(sketch)
    _draw_cutter(sketch, mill)
    items = [
        Node("force", (8.35, 2.3)),
        Block("filter", f"low-pass\n{mill.filter_corner:g} Hz", (14.2, 7.2), **size),
        Block("sampler", f"sampled\nat {1 / mill.plant.dt:g} Hz", (14.2, 4.9), **size),
        Block("computer", "computer", (14.2, 2.6), FOCUS, **size),
    ]
    sketch.line([(8.35, 2.3), corner], solid_capstyle="projecting")
    wires = [
        Wire(corner, "filter", "force $y$", via=7.2),
        *path("filter", "", "sampler", "", "computer"),
        Wire("computer", (9.3, 0.62), "feed command $v$ (mV)", via=0.62),
    ]
    add_blocks(sketch, items, wires)
    return ax


def cutter_axis(turns_ago: ArrayLike) -> np.ndarray:
    """Axis of the cutter some turns ago, seen from the workpiece, which is fed to the left."""
    feed = np.multiply.outer(turns_ago, (TURN, 0.0))
    return feed + about(SPINDLE, OFFSET, np.pi / 2 - PHASE - 2 * np.pi * np.asarray(turns_ago))


def cut_edge(x: np.ndarray) -> np.ndarray:
    """Height of the workpiece's edge: what all positions of the cutter up to now have left."""
    across, along = cutter_axis(np.linspace(0.0, 4.0, 801)).T
    reach = RADIUS**2 - (x[:, None] - across) ** 2
    lowest = np.where(reach > 0, along - np.sqrt(np.maximum(reach, 0.0)), UNCUT)
    return np.minimum(lowest.min(axis=1), UNCUT)


def _draw_workpiece(sketch: Sketch) -> None:
    """Table, dynamometer, feed, and the workpiece with the length of one wave on its cut edge."""
    sketch.box(0.3, 0.2, 9.0, 3.2)
    for y in (1.5, 2.5):
        sketch.line([(0.36, y), (9.24, y)], 2.5, STEEL)
    sketch.box(0.8, 1.08, 7.8, 2.0, FOCUS)
    sketch.arrow((5.45, 0.62), (7.1, 0.62))
    x = np.linspace(*PIECE, 1200)
    y = cut_edge(x)
    sketch.area([(PIECE[0], 2.0), *zip(x, y, strict=True), (PIECE[1], 2.0)], PLANT)
    left, right = x[find_peaks(y, prominence=0.05)[0]][-2:]
    low, high = y.max() - 0.2, y.max() + 0.2
    sketch.span((left, high), (right, high), [(left, low), (right, low)])
    sketch.words(("one wave per turn", left - 0.25, high + 0.42, "left"))
    sketch.words(("dynamometer", 4.7, 1.52), ("CNC table", 1.65, 0.64), ("feed", 4.8, 0.64))
    sketch.words(("workpiece", 4.7, 3.35))


def _draw_cutter(sketch: Sketch, mill: PeripheralMill) -> None:
    """Cutter, whose cutting faces lead clockwise, its runout and the sense of rotation."""
    pitch, reach = 2 * np.pi / mill.flutes, [1.0, 0.95, 0.85, 0.64, 0.52, 0.56]
    angle = pitch / 90 * np.array([0, 10, 35, 58, 76, 93])
    fine, (x, y), axis = np.linspace(0.0, angle[-1], 60), SPINDLE, cutter_axis(0.0)
    turn = np.pi / 2 - PHASE - np.concatenate([fine + k * pitch for k in range(mill.flutes)])
    ring = RADIUS * np.tile(PchipInterpolator(angle, reach)(fine), mill.flutes)
    sketch.area(about(axis, ring, turn), STEEL)
    sketch.runout(SPINDLE, axis, RADIUS + OFFSET)
    sketch.turn(SPINDLE, 2.0, np.radians([-35.0, 35.0]))  # as seen from the spindle
    inches = Fraction(mill.cutter_diameter / INCH).limit_denominator(64)
    flutes = {2: "two", 3: "three", 4: "four"}.get(mill.flutes, str(mill.flutes))
    cutter = f"{flutes}-flute\ncutter, {inches} in"
    sketch.words((f"{60 * mill.spindle_frequency:g} rpm", x, 7.95))
    sketch.words((cutter, 0.1, 7.0, "left", (x - 1.06, y + 0.62)))
    sketch.words(("spindle axis", 6.4, 7.45, "left", SPINDLE))
    sketch.write("cutter axis,\noff by the runout", 6.4, 6.35, "left", axis, color=DISTURBED)


def draw_waviness(ax: Axes, mill: PeripheralMill, eccentricity: float) -> Axes:
    """Plot three turns of the profile that the teeth leave when the cutter is off by so many m.

    Each tooth leaves an arc of its own radius, `radius + eccentricity cos(2 pi i / flutes)`, and
    the deepest arc remains.  Raises ValueError when the arcs are too short for the length drawn.
    """
    radius, flutes, turns = mill.cutter_diameter / 2, mill.flutes, 3
    feed_per_turn = mill.feed_speed / mill.spindle_frequency
    if (turns + 1) * feed_per_turn >= radius - abs(eccentricity):
        raise ValueError(
            f"a cutter of radius {radius:g} m does not reach over {turns} turns of feed "
            f"{feed_per_turn:g} m: check that all lengths are in metres"
        )
    x = np.linspace(0.0, turns * feed_per_turn, 80 * flutes * turns + 1)  # hits every crest
    tooth = np.arange(-flutes, (turns + 1) * flutes + 1)
    reach = radius + eccentricity * np.cos(2 * np.pi * tooth / flutes)
    behind = x[:, None] - tooth * feed_per_turn / flutes
    height = np.min(radius - np.sqrt(reach**2 - behind**2), axis=1)
    ax.plot(MILLI * x, MICRO * height, label=f"eccentricity {MICRO * eccentricity:g} µm")
    ax.set(xlabel=AXES["along"], ylabel=AXES["height"])
    return ax
