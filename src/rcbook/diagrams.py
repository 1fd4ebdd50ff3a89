"""Drawn pictures: block diagrams made of items and wires, and the machines they stand for.

A diagram is data.  `draw_block_diagram` takes blocks, sums, nodes and frames, and wires between
their names; the `draw_..._loop` functions set out the loops that the case studies share.  Lengths
are in diagram units: one unit is about the height of a block.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyBboxPatch, Patch, Polygon, Rectangle
from matplotlib.textpath import TextPath
from scipy.interpolate import PchipInterpolator
from scipy.signal import find_peaks

INK = "#1a1a1a"
DISTURBED = "#9c3a00"  # a darkened Okabe-Ito vermilion: 7:1 on white
PAPER = "#ffffff"
PLANT = "#ececec"  # fill of the machine
FOCUS = "#bad8f0"  # fill of what the picture is about; darker than PLANT in grey, too
STEEL = "#c4c4c4"  # fill of the cutter and of a turned section

Point = tuple[float, float]

_EM = 0.36  # font size in diagram units
_LARGEST_FONT = 16.0  # points; a diagram stops growing with its axes here
_LINE = 1.2  # points
_RADIUS = 0.24  # of a sum
_DOT = 0.07  # radius of a pick-off
_HEAD = (0.24, 0.09)  # length and half width of an arrow head
_GAP = 0.9  # shortest wire between two parts of a row
_BASELINE = 0.17  # of a label above its wire
_ICON = (0.5, 0.22)  # half width and half height
_COMPASS = {(1, 0): "e", (-1, 0): "w", (0, 1): "n", (0, -1): "s"}
_SIGN_SPOTS = {
    "w": (-_RADIUS - 0.17, -0.25),
    "e": (_RADIUS + 0.17, -0.25),
    "n": (0.25, _RADIUS + 0.16),
    "s": (0.25, -_RADIUS - 0.16),
}


@dataclass(frozen=True)
class Block:
    """A box with text, centred at `xy`; a width or height left out is what the text needs.

    A `title` stands above the box.  An `icon` is a curve over the text, its points within -1 to 1.
    """

    name: str
    text: str
    xy: Point = (0.0, 0.0)
    width: float | None = None
    height: float | None = None
    fill: str = PAPER
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
    """A dashed outline centred at `xy` around the parts that belong together.

    Its `title` is in the lower left corner.
    """

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


class _Label(NamedTuple):
    x: float
    y: float
    text: str
    ha: str = "center"
    va: str = "center"
    color: str = INK


_Note = tuple[_Label, tuple[Point, Point] | None]  # words, and a line from them to what they name


def draw_block_diagram(ax: Axes, items: Sequence[Item], wires: Sequence[Wire]) -> Axes:
    """Draw `items` and the `wires` between them; the axes' limits are set to fit.

    Raises ValueError for a name used twice, a wire to an unknown name, a wire of no length, and
    a wire that enters a sum on a side without a sign.
    """
    by_name = _by_name(items)
    routes = [_route(wire, by_name) for wire in wires]
    labels = _labels(items, wires, routes)
    font = _fit(ax, _extent(items, routes, labels))
    _paint(ax, items, wires, routes, labels, font)
    return ax


def draw_feedback_loop(
    ax: Axes,
    controller: str,
    plant: str,
    reference: str,
    command: str,
    output: str,
    disturbance: str = "",
    *,
    error: str = "",
    plant_input: str = "",
    focus: bool = False,
) -> Axes:
    """Draw a unity feedback loop; arguments are the texts of its blocks and signals.

    A `disturbance` is added between controller and plant; `focus` tints the controller.
    """
    load, load_label = _load(disturbance, plant_input)
    parts = [
        Sum("error"),
        Block("controller", controller, fill=FOCUS if focus else PAPER),
        *load,
        Block("plant", plant, fill=PLANT),
        Node("out"),
    ]
    items, wires = _row(parts, [reference, error, command, *load_label, "", output])
    wires += [Wire("out", "error", via=-1.3), *_load_wire(items, disturbance)]
    return draw_block_diagram(ax, items, wires)


def draw_cascade_loop(
    ax: Axes,
    outer: str,
    inner: str,
    plant: str,
    reference: str,
    outer_command: str,
    inner_command: str,
    output: str,
    disturbance: str = "",
    *,
    outer_error: str = "",
    inner_error: str = "",
    plant_input: str = "",
    inner_loop: str = "",
) -> Axes:
    """Draw an outer controller that sets the reference of an inner feedback loop, all from texts.

    A `disturbance` enters at the plant's input; a text for `inner_loop` frames and names that loop.
    """
    load, load_label = _load(disturbance, plant_input)
    parts = [
        Sum("outer error"),
        Block("outer", outer, fill=FOCUS),
        Sum("inner error"),
        Block("inner", inner),
        *load,
        Block("plant", plant, fill=PLANT),
        Node("inner out"),
        Node("out"),
    ]
    into = [reference, outer_error, outer_command, inner_error, inner_command, *load_label, "", ""]
    items, wires = _row(parts, [*into, output])
    feedback = Wire("inner out", "inner error", inner_loop, via=-1.3)
    wires += [feedback, Wire("out", "outer error", via=-2.0), *_load_wire(items, disturbance)]
    if inner_loop:
        items.append(_frame_around(items, "inner error", "inner out"))
    return draw_block_diagram(ax, items, wires)


def draw_plugin_loop(
    ax: Axes,
    repetitive: str,
    controller: str,
    plant: str,
    reference: str,
    command: str,
    output: str,
    disturbance: str = "",
    *,
    error: str = "",
    correction: str = "",
    plant_input: str = "",
) -> Axes:
    """Draw a loop whose error passes a repetitive controller in parallel and is added to itself.

    Arguments are the texts of blocks and signals; `correction` is what the repetitive controller
    adds, the `disturbance` enters at the plant's input.
    """
    load, load_label = _load(disturbance, plant_input)
    parts = [
        Sum("error"),
        Node("tap"),
        Block("repetitive", repetitive, (0.0, 1.5), fill=FOCUS),
        Sum("corrected", signs={"w": "+", "n": "+"}),
        Block("controller", controller),
        *load,
        Block("plant", plant, fill=PLANT),
        Node("out"),
    ]
    into = [reference, error, "", correction, "", command, *load_label, ""]
    items, wires = _row(parts, [*into, output])
    wires += [
        Wire("tap", "corrected"),
        Wire("out", "error", via=-1.3),
        *_load_wire(items, disturbance),
    ]
    return draw_block_diagram(ax, items, wires)


def draw_learning_loop(ax: Axes, law: str = "$H$", plant: str = "$G$") -> Axes:
    """Draw learning from pass to pass: the error through the law corrects the next command."""
    items = [
        Block("memory", "memory of\none pass", (0.0, 0.0), fill=FOCUS),
        Node("command", (3.2, 0.0)),
        Block("plant", plant, (5.4, 0.0), fill=PLANT),
        Sum("error", (8.0, 0.0), {"w": "−", "n": "+"}),
        Block("law", law, (5.4, -2.0), fill=FOCUS),
        Sum("corrected", (3.2, -2.0), {"n": "+", "e": "+"}),
    ]
    wires = [
        Wire("memory", "command", "$y_{m,L}$"),
        Wire("command", "plant"),
        Wire("plant", "error", "$y_L$"),
        Wire((8.0, 1.3), "error", "$y_r$"),
        Wire("error", "law", "$e_L$", via=-2.0),
        Wire("law", "corrected"),
        Wire("command", "corrected"),
        Wire("corrected", "memory", "$y_{m,L+1}$", via=-2.0),
    ]
    return draw_block_diagram(ax, items, wires)


def draw_repetitive_generator(
    ax: Axes,
    gain: str = r"$k_r$",
    memory: str = r"$q(z)\,z^{-(N-d-\nu)}$",
    rest: str = r"$z^{-(d+\nu)}$",
    compensator: str = r"$z^{-\nu}\,C(z)$",
    error: str = r"$e$",
    output: str = r"$u$",
) -> Axes:
    """Draw the inside of a repetitive controller; arguments are the texts of blocks and signals.

    `memory` and `rest` close a positive loop over one period, `k_r q z^-(N-d) C / (1 - q z^-N)`
    as a whole; the filter q and the advance nu of the inverse C lie inside the delay.
    """
    parts = [
        Block("gain", gain),
        Sum("sum", signs={"w": "+", "s": "+"}),
        Block("memory", memory, fill=FOCUS),
        Node("tap"),
        Block("compensator", compensator),
    ]
    items, wires = _row(parts, [error, "", "", "", "", output])
    middle = next(item.xy[0] for item in items if item.name == "memory")
    items.append(Block("rest", rest, xy=(middle, -1.5), fill=FOCUS))
    wires += [Wire("tap", "rest", via=-1.5), Wire("rest", "sum", via=-1.5)]
    return draw_block_diagram(ax, items, wires)


_LIMITED = ((-1.0, -1.0), (-0.4, -1.0), (0.4, 1.0), (1.0, 1.0))
_HELD = ((-1, -1), (-0.5, -1), (-0.5, 0.2), (0, 0.2), (0, 1), (0.5, 1), (0.5, -0.2), (1, -0.2))


def draw_spindle_drive(ax: Axes, limit: str = "50 A") -> Axes:
    """Draw the cascade of a spindle drive, from speed command to speed, and the cut as its load.

    The controllers are above, from left to right; motor and spindle are below, from right to left.
    `limit` is the text of the current limit.  Made for a figure of about 7.5 by 4 inches.
    """
    proportional = r"$K_{pv}+\dfrac{K_{iv}}{s}$"
    current = r"$K_u\left(K_{pi}+\dfrac{K_{ii}}{s}\right)$"
    size = {"height": 1.4}
    motor = {"height": 1.4, "fill": PLANT}
    items = [
        Sum("speed error", (1.9, 0.0)),
        Block("velocity", proportional, (4.4, 0.0), title="velocity control", **size),
        Block("limit", limit, (7.4, 0.0), title="current limit", icon=_LIMITED, **size),
        Sum("current error", (9.8, 0.0)),
        Block("current", current, (12.3, 0.0), title="current control", **size),
        Sum("voltage", (15.6, -3.5), {"n": "+", "s": "−"}),
        Block("armature", r"$\dfrac{1}{L_a s+R_a}$", (12.6, -3.5), title="armature", **motor),
        Node("i", (9.8, -3.5)),
        Block("sensor", "$K_f$", (9.8, -1.75)),
        Block("torque", "$C_{w1}$", (8.4, -3.5), fill=PLANT),
        Sum("torque error", (6.6, -3.5), {"e": "+", "s": "−"}),
        Block("inertia", r"$\dfrac{1}{Js+B}$", (4.7, -3.5), title="spindle", **motor),
        Node("cut off", (3.0, -3.5)),
        Node("w", (1.9, -3.5)),
        Block("tacho", r"$\dfrac{C_{wt}}{T_g s+1}$", (1.9, -1.75), height=1.4),
        Block("cut", "cut $G_d$", (4.7, -5.1), fill=FOCUS),
        Block("emf", "$C_{w2}$", (8.4, -6.2), fill=PLANT),
    ]
    wires = [
        Wire((0.0, 0.0), "speed error", "$U_w^*$"),
        Wire("speed error", "velocity"),
        Wire("velocity", "limit"),
        Wire("limit", "current error", "$U_i^*$"),
        Wire("current error", "current"),
        Wire("current", "voltage", "voltage"),
        Wire("voltage", "armature"),
        Wire("armature", "i", "$i$"),
        Wire("i", "sensor"),
        Wire("sensor", "current error"),
        Wire("i", "torque"),
        Wire("torque", "torque error"),
        Wire("torque error", "inertia"),
        Wire("inertia", "cut off"),
        Wire("cut off", "w"),
        Wire("w", (0.0, -3.5), "$w$"),
        Wire("w", "tacho"),
        Wire("tacho", "speed error"),
        Wire("cut off", "cut", via=-5.1, dashed=True),
        Wire("cut", "torque error", r"$T_\mathrm{cut}$", color=DISTURBED, dashed=True),
        Wire("w", "emf", via=-6.2),
        Wire("emf", "voltage", "back EMF"),
    ]
    return draw_block_diagram(ax, items, wires)


def draw_angle_loop(ax: Axes, step: str = "9°") -> Axes:
    """Draw the repetitive loop that samples every `step` of the cutter's turn.

    Above is the controller `L_n F z^-N C / (1 - F z^-N)`, from left to right; below, from right to
    left, is what turns with the cutter.  Made for a figure of about 7.5 by 3.3 inches.
    """
    size = {"width": 2.0, "height": 1.5}
    items = [
        Sum("error", (1.9, 0.0)),
        Block("gain", "$L_n$", (3.7, 0.0), fill=FOCUS),
        Sum("learned", (5.4, 0.0), {"w": "+", "n": "+"}),
        Block("memory", r"$F(z^{-1})\,z^{-N}$", (7.9, 0.0), fill=FOCUS, title="memory of a turn"),
        Node("tap", (9.95, 0.0)),
        Block("inverse", "$C(z^{-1})$", (11.5, 0.0), fill=FOCUS),
        Sum("command", (13.6, 0.0), {"w": "+", "n": "+"}),
        Block("hold", f"hold {step}", (15.6, -3.4), icon=_HELD, **size),
        Block("drive", "spindle\ndrive", (12.25, -3.4), fill=PLANT, **size),
        Block("cut", "cut", (9.0, -3.4), fill=PLANT, **size),
        Block("largest", "max over\nteeth", (5.75, -3.4), **size),
        Block("sampler", f"sampled\nevery {step}", (1.9, -3.4), **size),
        Frame("angle", (9.0, -3.55), 9.0, 3.2, title=r"in the cutter angle $\theta$"),
    ]
    wires = [
        Wire((0.0, 0.0), "error", "$F_0$"),
        Wire("error", "gain"),
        Wire("gain", "learned"),
        Wire("learned", "memory"),
        Wire("memory", "tap"),
        Wire("tap", "learned", via=1.55),
        Wire("tap", "inverse"),
        Wire("inverse", "command"),
        Wire((13.6, 1.2), "command", "nominal $U_0$"),
        Wire("command", "hold", "$U_w^*(k)$"),
        Wire("hold", "drive"),
        Wire("drive", "cut", "$w$"),
        Wire("cut", "drive", r"$T_\mathrm{cut}$", via=-4.8, dashed=True),
        Wire((9.0, -1.75), "cut", r"runout $\Delta_i$", color=DISTURBED),
        Wire("cut", "largest", "$F_{ti}$"),
        Wire("largest", "sampler", r"$F_{t\max}$"),
        Wire("sampler", "error"),
    ]
    return draw_block_diagram(ax, items, wires)


def draw_periodic_loop(ax: Axes, plant: str = "$G(s)$", step: str = r"$\Delta\theta$") -> Axes:
    """Draw the repetitive loop whose hold and sampler act every `step` of the spindle's turn.

    Above, from left to right, is the controller, which repeats every N samples; below, from right
    to left, the plant in continuous time.  Made for a figure of about 8 by 4 inches.
    """
    size = {"width": 2.0, "height": 1.4}
    items = [
        Sum("error", (1.7, 0.0)),
        Sum("learned", (4.1, 0.0), {"w": "+", "n": "+"}),
        Block("memory", r"$Q\,q^{-(N-L)}$", (7.15, 0.0), fill=FOCUS),
        Block("rest", "$q^{-L}$", (7.15, 1.5), fill=FOCUS),
        Node("tap", (9.4, 0.0)),
        Block("compensator", "$G_c(k)$", (12.0, 0.0), fill=FOCUS),
        Block("hold", "hold $T(k)$", (14.4, -2.6), icon=_HELD, **size),
        Block("plant", plant, (9.4, -2.6), fill=PLANT, **size),
        Block("sampler", "sampled\n$T(k)$", (4.4, -2.6), **size),
        Node("y", (1.7, -2.6)),
        Block("spindle", f"encoder, every {step}", (9.4, -4.5)),
        Frame("period", (6.55, 0.6), 6.4, 3.6, title="memory of one period"),
    ]
    wires = [
        Wire((0.0, 0.0), "error", "$r(k)$"),
        Wire("error", "learned", "$e(k)$"),
        Wire("learned", "memory", "$w(k)$"),
        Wire("memory", "tap"),
        Wire("tap", "rest", via=1.5),
        Wire("rest", "learned", via=1.5),
        Wire("tap", "compensator", "$u(k)$"),
        Wire("compensator", "hold", "$v(k)$"),
        Wire("hold", "plant", "$v(t)$"),
        Wire("plant", "sampler", "$y(t)$"),
        Wire("sampler", "y", "$y(k)$"),
        Wire("y", "error"),
        Wire("y", (0.0, -2.6)),
        Wire("spindle", "hold", dashed=True),
        Wire("spindle", "sampler", dashed=True),
    ]
    return draw_block_diagram(ax, items, wires)


def draw_waviness(
    ax: Axes,
    eccentricity: float,
    feed_per_turn: float,
    radius: float,
    flutes: int = 4,
    turns: int = 3,
) -> Axes:
    """Plot the profile that `flutes` teeth of a cutter leave when it runs out; lengths in metres.

    Each tooth leaves an arc of its own radius, `radius + eccentricity cos(2 pi i / flutes)`, and
    the deepest arc remains; feed is drawn in mm, height in micrometres.

    Raises ValueError when the arcs are too short for the length drawn.
    """
    if (turns + 1) * feed_per_turn >= radius - abs(eccentricity):
        raise ValueError(
            f"a cutter of radius {radius:g} m does not reach over {turns} turns of feed "
            f"{feed_per_turn:g} m: draw fewer turns, or check that all lengths are in metres"
        )
    x = np.linspace(0.0, turns * feed_per_turn, 80 * flutes * turns + 1)  # hits every crest
    tooth = np.arange(-flutes, (turns + 1) * flutes + 1)
    reach = radius + eccentricity * np.cos(2 * np.pi * tooth / flutes)
    behind = x[:, None] - tooth * feed_per_turn / flutes
    height = np.min(radius - np.sqrt(reach**2 - behind**2), axis=1)
    ax.plot(1e3 * x, 1e6 * height, label=f"eccentricity {1e6 * eccentricity:g} µm")
    ax.set_xlabel("distance along the feed (mm)")
    ax.set_ylabel("height (µm)")
    return ax


# --- the milling machine -------------------------------------------------------------------------

_SPINDLE = (3.9, 5.42)
_CUTTER = 1.35  # radius
_OFFSET = 0.27  # of the cutter's axis from the spindle's, far larger than in truth
_PHASE = np.radians(-35.0)  # where the cutter's axis stands on its orbit
_TURN = 1.6  # feed during one turn, far larger than in truth
_UNCUT = 4.4  # height of the uncut edge
_PIECE = (1.3, 8.1)  # left and right end of the workpiece


def draw_milling_setup(ax: Axes) -> Axes:
    """Draw side milling seen along the spindle axis, and the path from force to feed command.

    Made for a figure of about 8 by 4.2 inches; runout, depth of cut and feed are exaggerated.
    """
    font = 1.08 * _fit(ax, (0.0, 0.0, 16.0, 8.4))
    _draw_table(ax)
    _draw_workpiece(ax, font)
    _draw_cutter(ax)
    _draw_signal_path(ax, font)
    _annotate(ax, _milling_notes(), font)
    return ax


def _milling_notes() -> list[_Note]:
    """The words on the picture, and the line from a word to what it names."""
    x, y = _cutter_axis()
    rim = (_SPINDLE[0] - 1.06, _SPINDLE[1] + 0.62)
    offset = _Label(6.4, 6.35, "cutter axis,\noff by the runout", "left", color=DISTURBED)
    return [
        (_Label(_SPINDLE[0], 7.95, "600 rpm"), None),
        (_Label(0.1, 7.0, "four-flute\ncutter, 3/8 in", "left"), ((2.0, 6.4), rim)),
        (_Label(6.4, 7.45, "spindle axis", "left"), ((6.3, 7.42), _SPINDLE)),
        (offset, ((6.3, 6.35), (x, y))),
        (_Label(4.7, 3.35, "workpiece"), None),
        (_Label(4.7, 1.52, "dynamometer"), None),
        (_Label(0.7, 0.64, "CNC table", "left"), None),
        (_Label(5.2, 0.64, "feed", "right"), None),
    ]


def _draw_table(ax: Axes) -> None:
    """Table with its slots, dynamometer, and the direction of feed."""
    ink = {"edgecolor": INK, "linewidth": _LINE}
    ax.add_patch(Rectangle((0.3, 0.2), 9.0, 3.2, facecolor=PAPER, zorder=0.5, **ink))
    for y in (1.5, 2.5):
        ax.plot([0.36, 9.24], [y, y], color=STEEL, linewidth=2.5, linestyle="-", zorder=0.6)
    ax.add_patch(Rectangle((0.8, 1.08), 7.8, 2.0, facecolor=FOCUS, zorder=0.7, **ink))
    ax.plot([5.45, 6.8], [0.62, 0.62], color=INK, linewidth=2.2, linestyle="-")
    _head(ax, (7.1, 0.62), (1, 0), INK, scale=1.5)


def _draw_workpiece(ax: Axes, font: float) -> None:
    """Workpiece with its cut edge, and the length of one wave."""
    x = np.linspace(*_PIECE, 1200)
    y = _cut_edge(x)
    outline = [(_PIECE[0], 2.0), *zip(x, y, strict=True), (_PIECE[1], 2.0)]
    ax.add_patch(Polygon(outline, facecolor=PLANT, edgecolor=INK, linewidth=_LINE))
    crest = x[find_peaks(y, prominence=0.05)[0]][-2:]
    style = {"color": INK, "linewidth": 0.8, "linestyle": "-"}
    for end in crest:
        ax.plot([end, end], [y.max() - 0.2, y.max() + 0.35], **style)
    _double_arrow(ax, (crest[0], y.max() + 0.2), (crest[1], y.max() + 0.2))
    _write(ax, _Label(crest[0] - 0.25, y.max() + 0.62, "one wave per turn", "left"), font)


def _cutter_axis(turns_ago: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Axis of the cutter some turns ago, seen from the workpiece (clockwise, fed to the right)."""
    angle = _PHASE + 2 * np.pi * np.asarray(turns_ago)
    return (
        _SPINDLE[0] + _TURN * np.asarray(turns_ago) + _OFFSET * np.cos(angle),
        _SPINDLE[1] + _OFFSET * np.sin(angle),
    )


def _cut_edge(x: np.ndarray) -> np.ndarray:
    """Height of the workpiece's edge: what all positions of the cutter up to now have left."""
    across, along = _cutter_axis(np.linspace(0.0, 4.0, 801))
    reach = _CUTTER**2 - (x[:, None] - across) ** 2
    lowest = np.where(reach > 0, along - np.sqrt(np.maximum(reach, 0.0)), _UNCUT)
    return np.minimum(lowest.min(axis=1), _UNCUT)


def _draw_cutter(ax: Axes) -> None:
    """Cutter, both axes, the circle that its outermost tooth sweeps, and the sense of rotation."""
    axis = _cutter_axis()
    outline = _flutes() + axis
    ax.add_patch(Polygon(outline, facecolor=STEEL, edgecolor=INK, linewidth=_LINE, zorder=2))
    _mark_offset(ax, _SPINDLE, axis, _CUTTER + _OFFSET)
    _clockwise(ax, _SPINDLE, 2.0, (125.0, 62.0))  # as seen from the spindle


def _mark_offset(ax: Axes, spindle: Point, cutter: Point, radius: float) -> None:
    """A cross at the spindle axis with a dashed circle about it, and a dot at the cutter's axis."""
    x, y = spindle
    swept = {"fill": False, "linestyle": (0, (5, 3)), "linewidth": 0.8, "edgecolor": INK}
    ax.add_patch(Circle(spindle, radius, zorder=2.5, **swept))
    offset = {"color": DISTURBED, "linewidth": 2.4, "linestyle": "-"}
    ax.plot(*zip(spindle, cutter, strict=True), zorder=4, **offset)
    ax.add_patch(Circle(cutter, 0.08, facecolor=DISTURBED, linewidth=0, zorder=5))
    for dx, dy in ((0.17, 0.0), (0.0, 0.17)):
        cross = {"color": INK, "linewidth": 1.5, "linestyle": "-"}
        ax.plot([x - dx, x + dx], [y - dy, y + dy], zorder=5, **cross)


def _flutes() -> np.ndarray:
    """Outline of a four-flute cutter about its own axis; the cutting faces lead clockwise."""
    angle, reach = np.radians([0, 10, 35, 58, 76, 93]), [1.0, 0.95, 0.85, 0.64, 0.52, 0.56]
    fine = np.linspace(0.0, angle[-1], 60)
    ring = _CUTTER * np.tile(PchipInterpolator(angle, reach)(fine), 4)
    turn = np.concatenate([fine + _PHASE + k * np.pi / 2 for k in range(4)])
    return np.column_stack([ring * np.cos(turn), ring * np.sin(turn)])


def _draw_signal_path(ax: Axes, font: float) -> None:
    """From the dynamometer by way of filter, sampler and computer to the table."""
    x, size = 14.2, {"width": 3.2, "height": 1.4}
    items = [
        Node("force", (8.35, 2.3)),
        Block("filter", "low-pass\n30 Hz", (x, 7.2), **size),
        Block("sampler", "sampled\nat 60 Hz", (x, 4.9), **size),
        Block("computer", "computer", (x, 2.6), fill=FOCUS, **size),
    ]
    wires = [
        Wire("force", "filter", "force $F$"),
        Wire("filter", "sampler"),
        Wire("sampler", "computer"),
        Wire("computer", (9.3, 0.62), "feed command $V$ (mV)", via=0.62),
    ]
    by_name = _by_name(items)
    routes = [_route(wire, by_name) for wire in wires]
    routes[0] = [(8.35, 2.3), (10.3, 2.3), (10.3, 7.2), (x - 1.6, 7.2)]
    _paint(ax, items, wires, routes, _labels(items, wires, routes), font)


# --- the face mill -------------------------------------------------------------------------------

_AXIS = (5.3, 4.2)  # of the spindle
_TEETH, _PITCH = 8, np.pi / 4
_REACH = 2.6  # radius of the cutter, which stands for 50 mm
_TOOTH_FEED = 0.6  # far larger than in truth
_OUT = _TOOTH_FEED / 3  # of the cutter's centre from the axis; in true proportion to the feed
_LONGEST = 2  # the insert that the offset points to
_STANDS = np.radians(80.0)  # the angle at which this insert stands
_BLANK = (0.5, 11.9)  # left and right end of the workpiece
_MEASURED = np.radians(106.0)  # where the chip's thickness is shown
_CHIP = "#7fb4dd"  # fill of this chip, darker than FOCUS
_INSERT = ((0.0, 0.0), (-0.08, -0.62), (-0.5, -0.58), (-0.42, -0.14))  # along, outward


def draw_face_mill_setup(ax: Axes) -> Axes:
    """Draw face milling seen along the spindle axis: inserts, what they cut, runout and force.

    A tooth enters the workpiece at the top, at 0 degrees, and leaves at the bottom.  Made for a
    figure of about 7.5 by 3.9 inches; feed and runout are exaggerated, alike and about 200 times.
    """
    font = 1.08 * _fit(ax, (0.0, 0.0, 16.0, 8.4))
    _draw_blank(ax)
    _draw_face_mill(ax, font)
    _draw_mill_angles(ax)
    _annotate(ax, _face_mill_notes(), font)
    return ax


def _face_mill_notes() -> list[_Note]:
    """The words on the picture, and the line from a word to what it names."""
    x = _AXIS[0]
    centre = _Label(7.0, 0.62, "cutter centre,\noff by the runout", "left", color=DISTURBED)
    chip = _Label(12.35, 3.9, "chip thickness\n" + r"$f_t\,\sin\theta_i+\Delta_i$", "left")
    return [
        (_Label(x, 7.95, "entry, 0°"), None),
        (_Label(x, 0.62, "exit, 180°"), None),
        (_Label(0.8, 2.05, "spindle axis", "left"), ((2.95, 2.3), _AXIS)),
        (centre, ((7.4, 1.15), tuple(_seen(_OUT, _STANDS)))),
        (_Label(3.0, 7.35, "speed $w$", "right"), None),
        (_Label(*_seen(3.75, _tooth_angle(5) - _PITCH / 2), r"$\Delta\theta$"), None),
        (_Label(*_seen(0.8, 0.5 * _STANDS), r"$\theta_i$"), None),
        (_Label(*_seen(_REACH + 0.8, 1.08), "$F_t$"), None),
        (_Label(10.2, 6.2, "workpiece"), None),
        (chip, ((12.2, 3.9), tuple(_chip_ends()[1]))),
        (_Label(12.35, 2.3, "feed $v_0$", "left"), None),
    ]


def _tooth_angle(number: int) -> float:
    """Where an insert stands now, clockwise from the top."""
    return _STANDS - (number - _LONGEST) * _PITCH


def _tooth_reach(number: int) -> float:
    """Distance of an insert's edge from the spindle axis."""
    return _REACH + _OUT * np.cos((number - _LONGEST) * _PITCH)


def _seen(radius: np.ndarray | float, angle: np.ndarray | float) -> np.ndarray:
    """Points about the spindle axis, at an angle clockwise from the top."""
    angle = np.asarray(angle)
    offset = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    return np.asarray(radius)[..., None] * offset + _AXIS


def _tooth_path(number: int, direction: np.ndarray, until: float = np.inf) -> np.ndarray:
    """How far the path of an insert is from the spindle axis in directions clockwise from the top.

    Numbers below one are inserts of the turn before.  The path runs from 0 to 180 degrees and on
    straight out of the workpiece, or ends where the insert stands at the angle `until`.
    """
    angle = np.linspace(0.0, np.clip(until, 0.0, np.pi), 1200)
    fed = _TOOTH_FEED * (angle - _tooth_angle(number)) / _PITCH
    x, y = _tooth_reach(number) * np.array([np.sin(angle), np.cos(angle)]) + [fed, 0 * fed]
    beyond = np.linspace(0.05, 6.0, 120)
    x, y = np.append(x[0] + 0 * beyond, x), np.append(y[0] + beyond[::-1], y)
    if ends := until >= np.pi:
        x, y = np.append(x, x[-1] + 0 * beyond), np.append(y, y[-1] - beyond)
    radius = np.hypot(x, y)
    last = radius[-1] if ends else -np.inf
    return np.interp(direction, np.unwrap(np.arctan2(x, y)), radius, right=last)


def _front(direction: np.ndarray) -> np.ndarray:
    """How far the workpiece is cut in each direction: to the outermost of the paths so far."""
    latest = (-1, 0, 1, 2, 3)  # one that has just left, four in the cut
    return np.max([_tooth_path(n, direction, _tooth_angle(n)) for n in latest], axis=0)


def _chip_ends() -> np.ndarray:
    """Inner and outer end of the measured chip, on a line from the spindle axis."""
    radius = [_tooth_path(n, np.array(_MEASURED)) for n in (_LONGEST - 1, _LONGEST)]
    return _seen(np.array(radius), np.full(2, _MEASURED))


def _draw_blank(ax: Axes) -> None:
    """Workpiece with its cut front, the layers that the inserts will cut, and the feed."""
    (left, right), (_, y) = _BLANK, _AXIS
    ink = {"edgecolor": INK, "linewidth": _LINE}
    whole = Rectangle((left, y - _REACH), right - left, 2 * _REACH, facecolor=PAPER, **ink)
    ax.add_patch(whole)
    half_turn = np.linspace(0.0, np.pi, 1500)
    front = _seen(_front(half_turn), half_turn)
    rest = Polygon([*front, (right, y - 4.0), (right, y + 4.0)], facecolor=PLANT, **ink)
    ax.add_patch(rest).set_clip_path(whole)
    for number in (0, 1, 3, 2):
        ahead = np.linspace(_tooth_angle(number), np.pi, 400)
        inner, outer = (_seen(_tooth_path(n, ahead), ahead) for n in (number - 1, number))
        fill = _CHIP if number == _LONGEST else FOCUS
        layer = Polygon([*inner, *outer[::-1]], facecolor=fill, edgecolor=INK, linewidth=0.8)
        ax.add_patch(layer).set_clip_path(whole)
    ax.add_patch(Rectangle(whole.get_xy(), right - left, 2 * _REACH, fill=False, **ink))
    ax.plot([12.6, 13.9], [1.8, 1.8], color=INK, linewidth=2.2, linestyle="-")
    _head(ax, (12.3, 1.8), (-1, 0), INK, scale=1.5)


def _draw_face_mill(ax: Axes, font: float) -> None:
    """Body and numbered inserts, the axis and the cutter's centre, and the sense of rotation."""
    ink = {"edgecolor": INK, "linewidth": _LINE}
    ax.add_patch(Polygon(_face_mill_body(), facecolor=STEEL, zorder=2, **ink))
    for number in range(1, _TEETH + 1):
        angle, reach = _tooth_angle(number), _tooth_reach(number)
        along = np.array([np.cos(angle), -np.sin(angle)])  # the way it moves
        outward = np.array([np.sin(angle), np.cos(angle)])
        wedge = [_AXIS + (reach + r) * outward + t * along for t, r in _INSERT]
        fill = DISTURBED if number == _LONGEST else "#6e6e6e"
        ax.add_patch(Polygon(wedge, facecolor=fill, zorder=3, **ink))
        label = _AXIS + (reach - 0.95) * outward - 0.25 * along
        _write(ax, _Label(*label, str(number)), font)
    _mark_offset(ax, _AXIS, tuple(_seen(_OUT, _STANDS)), _REACH)
    _clockwise(ax, _AXIS, 3.2, (138.0, 104.0))


def _face_mill_body() -> np.ndarray:
    """Outline of the body about the cutter's centre, with a pocket ahead of every insert."""
    angle, reach = np.radians([-2, 0, 6, 14, 22, 43]), [2.3, 1.85, 1.8, 1.95, 2.3, 2.3]
    fine = np.linspace(angle[0], angle[-1], 60)
    ring = np.tile(PchipInterpolator(angle, reach)(fine), _TEETH)
    turn = np.concatenate([fine + _tooth_angle(n) for n in range(_TEETH, 0, -1)])
    return _seen(ring, turn) + _seen(_OUT, _STANDS) - _AXIS


def _draw_mill_angles(ax: Axes) -> None:
    """Where a tooth enters and leaves, an insert's angle, chip and force, and the pitch."""
    (x, y), tip = _AXIS, _seen(_tooth_reach(_LONGEST), _STANDS)
    thin = {"color": INK, "linewidth": 0.8, "linestyle": "-", "zorder": 3.5}
    for line in ([_AXIS, (x, y + 3.4)], [(x, y - _REACH), (x, y - 3.2)], [_AXIS, tip]):
        ax.plot(*zip(*line, strict=True), **thin)
    _clockwise(ax, _AXIS, 1.2, (90.0, 102.0 - np.degrees(_STANDS)))  # its head takes 12 degrees
    _double_arrow(ax, *_chip_ends())
    ends = _tooth_angle(5), _tooth_angle(6)
    ax.plot(*_seen(3.3, np.linspace(*ends, 60)).T, **thin)
    for angle, sense in zip(ends, (1, -1), strict=True):
        ax.plot(*_seen(np.array([2.5, 3.55]), np.full(2, angle)).T, **thin)
        step = sense * np.array([np.cos(angle), -np.sin(angle)])
        _head(ax, tuple(_seen(3.3, angle)), tuple(step), INK, scale=0.8)
    push = np.array([-np.cos(_STANDS), np.sin(_STANDS)])  # against the way the insert moves
    arrow = np.stack([tip, tip + 1.3 * push])
    ax.plot(*arrow.T, color=INK, linewidth=2.2, linestyle="-", zorder=4)
    _head(ax, tuple(tip + 1.6 * push), tuple(push), INK, scale=1.5)


# --- the lathe -----------------------------------------------------------------------------------

_CENTRE = (3.1, 5.1)  # of the spindle
_INRADIUS = 1.3  # of the square section, which stands for 10 mm
_ANGLE = np.radians(30.0)  # by which the spindle has turned since a side faced the tool
_BAR, _CHUCK = 2.0, 2.55  # radii
_SLIDE = (6.9, 9.2)  # left and right end
_SCREW = 4.55  # height
_PLOT = (10.9, 15.4, 6.35, 7.5)  # left, right, bottom and top of the radius over one turn


def draw_lathe_setup(ax: Axes) -> Axes:
    """Draw noncircular turning seen along the spindle axis, and the signals around the computer.

    A square of half side a = 10 mm is turned on a round bar; the graph is its radius over one
    turn.  Made for a figure of about 8 by 4.2 inches.
    """
    font = 1.08 * _fit(ax, (0.0, 0.0, 16.0, 8.4))
    _draw_chuck(ax)
    _draw_section(ax)
    _draw_slide(ax)
    _draw_lathe_signals(ax, font)
    _draw_radius(ax)
    _annotate(ax, _lathe_notes(), font)
    return ax


def _lathe_notes() -> list[_Note]:
    """The words on the picture, and the line from a word to what it names."""
    x, y = _CENTRE
    left, right, bottom, top = _PLOT
    return [
        (_Label(x + 0.72, y + 0.3, r"$y_r(\theta)$"), None),
        (_Label(x + 1.06, y - 0.29, r"$\theta$"), None),
        (_Label(x - 0.42, y + 0.58, "$a$"), None),
        (_Label(5.75, 7.0, "workpiece", "left"), ((5.65, 6.9), (x + 1.3, y + 0.75))),
        (_Label(6.22, 4.2, "tool"), None),
        (_Label(sum(_SLIDE) / 2, _SCREW, "slide"), None),
        (_Label(_SLIDE[0] + 0.02, 5.86, "$y$"), None),
        (_Label(left - 0.25, bottom, "$a$ = 10 mm", "right"), None),
        (_Label(left - 0.25, top, r"$\sqrt{2}\,a$ = 14 mm", "right"), None),
        (_Label((left + right) / 2, 8.1, r"radius $y_r(\theta)$, one turn"), None),
    ]


def _square_radius(angle: np.ndarray | float) -> np.ndarray:
    """Radius of the square at an angle from the middle of a side."""
    return _INRADIUS / np.cos(np.mod(np.asarray(angle) + np.pi / 4, np.pi / 2) - np.pi / 4)


def _around(radius: np.ndarray | float, angle: np.ndarray | float) -> np.ndarray:
    """Points about the spindle axis at an angle on the workpiece; the tool is at `_ANGLE`."""
    turned = np.asarray(angle) - _ANGLE  # the spindle turns clockwise
    offset = np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    return np.asarray(radius)[..., None] * offset + _CENTRE


def _draw_chuck(ax: Axes) -> None:
    """Chuck with three jaws, the round bar in it, and the sense of rotation."""
    ink = {"edgecolor": INK, "linewidth": _LINE}
    ax.add_patch(Circle(_CENTRE, _CHUCK, facecolor=PAPER, zorder=0.5, **ink))
    for middle in np.radians([100.0, 220.0, 340.0]):
        along, across = _around(1.0, middle) - _CENTRE, _around(1.0, middle + np.pi / 2) - _CENTRE
        jaw = [
            along * reach + across * side + _CENTRE
            for reach, side in ((1.8, -0.38), (2.42, -0.38), (2.42, 0.38), (1.8, 0.38))
        ]
        ax.add_patch(Polygon(jaw, facecolor=PAPER, zorder=0.6, **ink))
    ax.add_patch(Circle(_CENTRE, _BAR, facecolor=PLANT, zorder=0.7, **ink))
    _clockwise(ax, _CENTRE, _CHUCK + 0.32, (124.0, 66.0))


def _draw_section(ax: Axes) -> None:
    """The turned square with its half side, its radius at the tool, and the spindle angle."""
    corners = np.pi / 4 + np.pi / 2 * np.arange(4)
    square = _around(_square_radius(corners), corners)
    ax.add_patch(Polygon(square, facecolor=STEEL, edgecolor=INK, linewidth=1.5, zorder=0.8))
    thin = {"color": INK, "linewidth": 0.8}
    mark = np.stack([_around(0.0, 0.0), _around(_CHUCK, 0.0)])
    ax.plot(*mark.T, linestyle=(0, (7, 2.5, 1.5, 2.5)), zorder=1, **thin)
    _double_arrow(ax, _CENTRE, tuple(_around(_INRADIUS, np.pi)))
    _double_arrow(ax, _CENTRE, tuple(_around(_square_radius(_ANGLE), _ANGLE)), 1.6)
    arc = _around(0.78, np.linspace(_ANGLE, 0.2 * _ANGLE, 30))
    ax.plot(*arc.T, linestyle="-", **thin)
    step = _around(1.0, -np.pi / 2 + 0.1 * _ANGLE) - _CENTRE
    _head(ax, tuple(_around(0.78, 0.0)), tuple(step), INK, scale=0.8)
    ax.add_patch(Circle(_CENTRE, _DOT, facecolor=INK, linewidth=0, zorder=4))


def _draw_slide(ax: Axes) -> None:
    """Tool with its edge on the section, slide on its way, and the screw that moves it."""
    tip, (left, right) = _around(_square_radius(_ANGLE), _ANGLE), _SLIDE
    ink = {"edgecolor": INK, "linewidth": _LINE}
    shank = [(0.0, 0.0), (0.22, -0.5), (left - tip[0], -0.5), (left - tip[0], 0.0)]
    ax.add_patch(Polygon(tip + shank, facecolor="#6e6e6e", zorder=2, **ink))
    ax.add_patch(Rectangle((6.3, 3.25), 4.4, 0.4, facecolor=PAPER, hatch="////", **ink))
    ax.add_patch(Rectangle((left, 3.65), right - left, 1.8, facecolor=PLANT, zorder=3, **ink))
    turns = np.linspace(right, 11.2, 23)
    for side in (-0.11, 0.11):
        ax.plot(turns[[0, -1]], [_SCREW + side] * 2, color=INK, linewidth=0.8, linestyle="-")
    thread = _SCREW + 0.11 * (-1.0) ** np.arange(turns.size)
    ax.plot(turns, thread, color=INK, linewidth=0.8, linestyle="-")
    _double_arrow(ax, (left + 0.3, 5.9), (right - 0.3, 5.9), 2.2, 1.3)


def _draw_lathe_signals(ax: Axes, font: float) -> None:
    """Both encoders, the computer and the motor, and the wires between them."""
    size = {"width": 2.3, "height": 1.4}
    items = [
        Node("chuck", (_CENTRE[0], _CENTRE[1] - _CHUCK + 0.28)),
        Block("angle", "spindle\nencoder", (_CENTRE[0], 1.45), fill=FOCUS, **size),
        Block("computer", "computer", (7.9, 1.45), fill=FOCUS, **size),
        Block("motor", "servo\nmotor", (12.2, _SCREW), width=2.0, height=1.5),
        Block("position", "encoder", (14.6, _SCREW), width=2.1, height=1.1, fill=FOCUS),
    ]
    wires = [
        Wire("angle", "chuck"),  # without a head: they turn together
        Wire("angle", "computer", r"angle $\theta$"),
        Wire("computer", "motor", "command $y_m$"),
        Wire("position", "computer", "position $y$", via=0.25),
    ]
    by_name = _by_name(items)
    routes = [_route(wire, by_name) for wire in wires]
    _paint(ax, items, wires, routes, _labels(items, wires, routes), font)
    shaft = {"color": INK, "linewidth": 3.0, "linestyle": "-", "solid_capstyle": "butt"}
    ax.plot([13.2, 13.55], [_SCREW, _SCREW], **shaft)


def _draw_radius(ax: Axes) -> None:
    """Radius of the section over one turn, and where the spindle stands."""
    left, right, bottom, top = _PLOT
    angle = np.linspace(0.0, 2 * np.pi, 361)
    scale = (top - bottom) / (_INRADIUS * (np.sqrt(2) - 1))
    height = bottom + scale * (_square_radius(angle) - _INRADIUS)
    for level in (bottom, top):
        ax.plot([left, right], [level] * 2, color="#8a8a8a", linewidth=0.8, linestyle=(0, (4, 3)))
    ax.plot(left + (right - left) * angle / (2 * np.pi), height, color=INK, linestyle="-")
    now = (left + (right - left) * _ANGLE / (2 * np.pi), np.interp(_ANGLE, angle, height))
    ax.add_patch(Circle(now, 1.4 * _DOT, facecolor=INK, linewidth=0, zorder=4))


# --- boring at a varying speed -------------------------------------------------------------------

_LEVEL = 5.15  # height of the spindle axis
_END = (13.3, _LEVEL)  # centre of the view along the axis
_JAWS, _PIPE = 2.15, 1.62  # outer radii of chuck and workpiece
_BORE, _OVAL = 1.1, 0.16  # mean radius and amplitude of the bore; the amplitude is exaggerated
_ROUGH = 0.8  # radius before this pass
_ROD = 0.42  # radius of the boring bar
_EDGE = 4.95  # where the tool is along the axis
_TURNED = np.radians(30.0)  # by which the spindle has turned since its mark faced the tool
_DOTS = 24  # samples drawn in a turn


def draw_boring_setup(ax: Axes, samples: int = 240) -> Axes:
    """Draw noncircular boring, in section and along the axis, and the signals round the computer.

    The encoder triggers `samples` a turn, of which 24 are drawn, at equal angles while the speed
    varies.  Made for a figure of about 8 by 4.2 inches; the ellipse is exaggerated.
    """
    font = 1.08 * _fit(ax, (0.0, 0.2, 16.5, 8.6))
    _draw_boring_section(ax)
    _draw_boring_bar(ax)
    _draw_boring_end(ax)
    _draw_boring_signals(ax, font)
    _annotate(ax, _boring_notes(samples), font)
    return ax


def _boring_notes(samples: int) -> list[_Note]:
    """The words on the picture, and the line from a word to what it names."""
    law = r"speed $\omega(t)=\omega_0\,[1+\mathrm{RVA}\,\sin(\mathrm{RVF}\,\omega_0\,t)]$"
    every = "trigger every\n" + rf"$\Delta\theta$ = {360 / samples:g}°"
    bore = _Label(11.1, 1.4, "elliptical bore,\n46 µm peak to peak", "left")
    wall, dot = (tuple(_bored(np.radians(at))) for at in (190.0, -30.0))
    return [
        (_Label(0.2, 8.2, law, "left"), None),
        (_Label(1.4, 2.3, every, "left"), None),
        (_Label(3.1, 7.55, "chuck"), None),
        (_Label(5.5, 7.1, "workpiece"), None),
        (_Label(5.98, _LEVEL + 0.76, "$y$"), None),
        (_Label(6.7, 6.6, "boring bar", "left"), ((7.4, 6.32), (7.4, _LEVEL + _ROD))),
        (_Label(6.75, 4.2, "piezo", "left"), ((6.65, 4.25), (5.25, _LEVEL - 0.15))),
        (_Label(10.5, _LEVEL + 0.42, "feed"), None),
        (_Label(12.6, 8.2, f"{samples} samples a turn", "right"), ((11.7, 7.93), dot)),
        (_Label(*_ahead(2.95, 0.55 * _TURNED), r"$\theta$"), None),
        (_Label(*_ahead(2.85, np.radians(78.0)), r"$\omega$"), None),
        (bore, ((12.6, 2.05), wall)),
    ]


def _ahead(radius: np.ndarray | float, angle: np.ndarray | float) -> np.ndarray:
    """Points of the view along the axis, at an angle clockwise from the tool, which is on top."""
    return _seen(radius, angle) + np.subtract(_END, _AXIS)


def _bore_radius(angle: np.ndarray | float) -> np.ndarray:
    """Radius of the finished bore at an angle clockwise from the tool."""
    return _BORE + _OVAL * np.cos(2 * (_TURNED - np.asarray(angle)))


def _bored(angle: np.ndarray | float) -> np.ndarray:
    """Points on the finished bore."""
    return _ahead(_bore_radius(angle), angle)


def _draw_boring_section(ax: Axes) -> None:
    """Spindle, chuck with jaws, and the workpiece cut open along the axis."""
    ink = {"edgecolor": INK, "linewidth": _LINE}
    ax.add_patch(Rectangle((2.1, _LEVEL - 0.4), 0.7, 0.8, facecolor=PLANT, zorder=0.5, **ink))
    corner = (2.75, _LEVEL - _JAWS)
    ax.add_patch(Rectangle(corner, 0.75, 2 * _JAWS, facecolor=PAPER, zorder=0.6, **ink))
    wall, grip = float(_bore_radius(0.0)), _JAWS - 0.1
    jaw = [(3.5, _PIPE), (4.3, _PIPE), (4.3, grip), (3.5, grip)]
    cut = [(_EDGE, _ROUGH), (_EDGE, wall), (6.5, wall), (6.5, _PIPE), (3.5, _PIPE), (3.5, _ROUGH)]
    for side in (1, -1):
        for shape, fill in ((jaw, PAPER), (cut, STEEL)):
            corners = np.array(shape) * (1, side) + (0, _LEVEL)
            ax.add_patch(Polygon(corners, facecolor=fill, zorder=0.7, **ink))


def _draw_boring_bar(ax: Axes) -> None:
    """Bar with its piezo stack and the tool, whose edge is on the wall, and the ways they move."""
    ink = {"edgecolor": INK, "linewidth": _LINE}
    corner = (_EDGE - 0.2, _LEVEL - _ROD)
    ax.add_patch(Rectangle(corner, 3.6, 2 * _ROD, facecolor=PLANT, zorder=1.5, **ink))
    left, right, wall = _EDGE - 0.05, _EDGE + 0.45, _LEVEL + float(_bore_radius(0.0))
    low, high = _LEVEL - 0.3, _LEVEL + 0.3
    ax.add_patch(Rectangle((left, low), right - left, high - low, facecolor=FOCUS, zorder=2, **ink))
    for y in np.linspace(low, high, 7)[1:-1]:
        ax.plot([left, right], [y, y], color=INK, linewidth=0.8, linestyle="-", zorder=2)
    tool = [(_EDGE, wall), (right - 0.1, wall - 0.12), (right, high), (left, high)]
    ax.add_patch(Polygon(tool, facecolor="#6e6e6e", zorder=2.2, **ink))
    _double_arrow(ax, (5.68, _LEVEL + 0.47), (5.68, wall - 0.05), 1.6)
    ax.plot([10.25, 10.9], [_LEVEL, _LEVEL], color=INK, linewidth=2.2, linestyle="-")
    _head(ax, (9.95, _LEVEL), (-1, 0), INK, scale=1.5)


def _draw_boring_end(ax: Axes) -> None:
    """Chuck, workpiece, bore and tool along the axis, the samples of a turn, and the angle."""
    ink = {"edgecolor": INK, "linewidth": _LINE}
    ax.add_patch(Circle(_END, _JAWS, facecolor=PAPER, zorder=0.5, **ink))
    for middle in _TURNED + np.radians([60.0, 180.0, 300.0]):
        along, across = _ahead(1.0, middle) - _END, _ahead(1.0, middle + np.pi / 2) - _END
        corners = ((1.5, -0.3), (_JAWS - 0.1, -0.3), (_JAWS - 0.1, 0.3), (1.5, 0.3))
        jaw = [along * reach + across * side + _END for reach, side in corners]
        ax.add_patch(Polygon(jaw, facecolor=PAPER, zorder=0.6, **ink))
    ax.add_patch(Circle(_END, _PIPE, facecolor=STEEL, zorder=0.7, **ink))
    turn = np.linspace(0.0, 2 * np.pi, 361)
    ax.add_patch(Polygon(_bored(turn), facecolor=PLANT, zorder=0.8, **ink))
    ax.add_patch(Circle(_END, _ROUGH, facecolor=PAPER, zorder=0.8, edgecolor=INK, linewidth=0.8))
    for at in _bored(_TURNED - 2 * np.pi * np.arange(_DOTS) / _DOTS):
        ax.add_patch(Circle(at, 0.055, facecolor=INK, linewidth=0, zorder=2.5))
    wall = float(_bore_radius(0.0))
    tool = [(0.0, wall), (0.3, wall - 0.2), (0.3, 0.2), (0.0, 0.2)]  # cuts with its left face
    ax.add_patch(Polygon(np.add(tool, _END), facecolor="#6e6e6e", zorder=2.2, **ink))
    ax.add_patch(Circle(_END, _ROD, facecolor=PLANT, zorder=2.3, **ink))
    thin = {"color": INK, "linewidth": 0.8, "zorder": 1}
    mark = _ahead(np.array([_ROD, 2.75]), np.full(2, _TURNED))
    ax.plot(*mark.T, linestyle=(0, (7, 2.5, 1.5, 2.5)), **thin)
    ax.plot(*_ahead(np.array([wall, 2.75]), np.zeros(2)).T, linestyle="-", **thin)
    ax.plot(*_ahead(2.5, np.linspace(0.0, 0.85 * _TURNED, 40)).T, linestyle="-", **thin)
    step = np.array([np.cos(0.95 * _TURNED), -np.sin(0.95 * _TURNED)])
    _head(ax, tuple(_ahead(2.5, _TURNED)), tuple(step), INK, scale=0.8)
    _clockwise(ax, _END, _JAWS + 0.35, (42.0, -12.0))


def _draw_boring_signals(ax: Axes, font: float) -> None:
    """Encoder, computer, amplifier and the holder of the bar, and the wires between them."""
    size = {"width": 2.4, "height": 1.3}
    items = [
        Block("encoder", "encoder", (1.15, _LEVEL), width=2.0, height=1.1, fill=FOCUS),
        Block("computer", "computer", (5.0, 1.1), fill=FOCUS, **size),
        Block("amplifier", "amplifier", (9.5, 1.1), **size),
        Block("holder", "holder", (9.1, _LEVEL), width=1.7, height=1.8, fill=PLANT),
        Node("input", (9.5, _LEVEL - 0.9)),  # on the underside of the holder
        Node("sensor", (8.6, _LEVEL - 0.9)),
    ]
    wires = [
        Wire("encoder", "computer", via=1.1),
        Wire("computer", "amplifier", "$v(k)$"),
        Wire("amplifier", "input"),
        Wire("sensor", "computer", "position $y(k)$", via=2.55),
    ]
    by_name = _by_name(items)
    routes = [_route(wire, by_name) for wire in wires]
    _paint(ax, items[:4], wires, routes, _labels(items[:4], wires, routes), font)


# --- samples at equal angles ---------------------------------------------------------------------

_STRIP = (1.9, 15.1)  # left and right end of one period
_ANGLES, _TIMES = 5.75, 3.95  # heights of the two axes
_SPEEDS = (0.45, 1.4)  # heights of no speed and of the mean
_STEPS = 16  # samples in the period
_SWING = 0.5  # amplitude of the speed over its mean, larger than in practice


def draw_periodic_sampling(ax: Axes) -> Axes:
    """Draw one period of a sinusoidal speed: equal steps of the angle, unequal ones of time.

    Lines join the steps on the axis of the angle to their instants on that of time, below which
    is the speed.  Made for a figure of about 8 by 3.8 inches.
    """
    font = 1.08 * _fit(ax, (0.0, 0.2, 16.2, 7.9))
    left, right = _STRIP
    angle, time = _sampling_instants()
    above, below = (left + (right - left) * share for share in (angle, time))
    _draw_strip(ax, above, below)
    _draw_strip_speed(ax, time)
    gaps = np.diff(below)
    short, long = int(np.argmin(gaps)), int(np.argmax(gaps))
    for k in (short, long):
        (a, b), (t, u) = above[k : k + 2], below[k : k + 2]
        band = [(a, _ANGLES), (b, _ANGLES), (u, _TIMES), (t, _TIMES)]
        ax.add_patch(Polygon(band, facecolor=FOCUS, linewidth=0, zorder=0.5))
        _double_arrow(ax, (a, _ANGLES + 0.42), (b, _ANGLES + 0.42))
        _double_arrow(ax, (t, _TIMES - 0.42), (u, _TIMES - 0.42))
    _double_arrow(ax, (left, _ANGLES + 1.4), (right, _ANGLES + 1.4))
    _annotate(ax, _strip_notes(above, below, short, long), font)
    return ax


def _strip_notes(above: np.ndarray, below: np.ndarray, short: int, long: int) -> list[_Note]:
    """The words on the strip; `short` and `long` are the steps whose lengths are named."""
    left, right = _STRIP
    period = "one period of the speed, $N$ samples"
    mean = _SPEEDS[1]
    counts = [(above[0], "$k=0$"), (above[1], "1"), (above[2], "2"), (above[-1], "$N$")]
    labels = [_Label(x, _ANGLES + 0.5, text) for x, text in counts]
    labels += [
        _Label((left + right) / 2, _ANGLES + 1.75, period),
        _Label(above[short : short + 2].mean(), _ANGLES + 0.85, r"$\Delta\theta$"),
        _Label(above[long : long + 2].mean(), _ANGLES + 0.85, r"$\Delta\theta$"),
        _Label(below[short : short + 2].mean(), _TIMES - 0.85, "short $T(k)$"),
        _Label(below[long : long + 2].mean(), _TIMES - 0.85, "long $T(k)$"),
        _Label(0.1, _ANGLES, "angle", "left"),
        _Label(right + 0.75, _ANGLES, r"$\theta$"),
        _Label(0.1, _TIMES, "time", "left"),
        _Label(right + 0.75, _TIMES, "$t$"),
        _Label(0.1, mean + 0.6, r"speed $\omega$", "left"),
        _Label(right + 0.75, _SPEEDS[0], "$t$"),
        _Label(left - 0.3, mean, r"$\omega_0$", "right"),
        _Label(left - 0.3, _SPEEDS[0], "0", "right"),
    ]
    return [(label, None) for label in labels]


def _sampling_instants() -> tuple[np.ndarray, np.ndarray]:
    """Equal steps of the angle and their instants, from 0 to 1 in a period, both included."""
    time = np.linspace(0.0, 1.0, 2001)
    turned = time + _SWING * (1 - np.cos(2 * np.pi * time)) / (2 * np.pi)
    angle = np.linspace(0.0, 1.0, _STEPS + 1)
    return angle, np.interp(angle, turned, time)


def _draw_strip(ax: Axes, above: np.ndarray, below: np.ndarray) -> None:
    """The axes of angle and time with their steps, and the lines that join these."""
    left, right = _STRIP
    for height in (_ANGLES, _TIMES):
        _draw_wire(ax, [(left - 0.25, height), (right + 0.55, height)], INK, arrow=True)
    for a, t in zip(above, below, strict=True):
        ax.plot([a, t], [_ANGLES, _TIMES], color=INK, linewidth=0.8, linestyle="-", zorder=2)
        for x, height, end in ((a, _ANGLES, 0.24), (t, _TIMES, -0.24)):
            tick = {"linewidth": 1.6, "linestyle": "-", "zorder": 3}
            ax.plot([x, x], [height, height + end], color=INK, **tick)


def _draw_strip_speed(ax: Axes, samples: np.ndarray) -> None:
    """The speed over one period with its mean, and its samples as stems."""
    (left, right), (zero, mean) = _STRIP, _SPEEDS
    _draw_wire(ax, [(left - 0.25, zero), (right + 0.55, zero)], INK, arrow=True)
    dashes = {"color": "#8a8a8a", "linewidth": 0.8, "linestyle": (0, (4, 3))}
    ax.plot([left - 0.2, right], [mean, mean], **dashes)

    def height(time: np.ndarray) -> np.ndarray:
        return mean + (mean - zero) * _SWING * np.sin(2 * np.pi * time)

    time = np.linspace(0.0, 1.0, 361)
    curve = {"color": INK, "linewidth": 1.6, "linestyle": "-", "zorder": 3}
    ax.plot(left + (right - left) * time, height(time), **curve)
    for x, y in zip(left + (right - left) * samples, height(samples), strict=True):
        ax.plot([x, x], [zero, y], color=INK, linewidth=0.8, linestyle="-", zorder=2)
        ax.add_patch(Circle((x, y), _DOT, facecolor=INK, linewidth=0, zorder=4))


# --- regenerative chatter ------------------------------------------------------------------------

_TIP = 6.2  # where the tool's edge is along the cut
_MEAN_CUT, _MEAN_CHIP = 2.15, 1.15  # mean height of the cut surface, and h0
_WAVE, _CREST = 3.2, 0.4  # length and amplitude of the chatter marks, exaggerated
_LAG = np.radians(75.0)  # by which the wave being cut is behind that of the last turn
_CUT_PIECE = (0.5, 15.2, 0.3)  # left end, right end and bottom of the workpiece
_MASS = (6.75, 5.35, 2.3, 1.15)  # centre, width and height


def draw_regeneration(ax: Axes) -> Axes:
    """Draw regenerative chatter: a tool on a spring cuts the wave that it left one turn ago.

    The surface is unrolled and moves to the right; on its right is what the tool has just cut.
    Made for a figure of about 8 by 4.2 inches; the chatter marks are exaggerated.
    """
    font = 1.08 * _fit(ax, (0.2, 0.2, 16.4, 8.5))
    _draw_chatter_marks(ax)
    _draw_chatter_lengths(ax)
    _draw_chatter_tool(ax, font)
    _annotate(ax, _chatter_notes(), font)
    return ax


def _chatter_notes() -> list[_Note]:
    """The words on the picture, and the line from a word to what it names."""
    old, cut = _TIP - 1.55 * _WAVE, _TIP + 2.3 * _WAVE
    turn = _Label(0.5, 5.0, "left one turn ago,\n" + r"$x(t-\tau)$", "left", color=DISTURBED)
    now = _Label(11.4, 0.85, "being cut, $x(t)$", "left")
    thickness = "chip thickness\n" + r"$h(t)=h_0+x(t-\tau)-x(t)$"
    x, y, width, height = _MASS
    shifted = _TIP + _WAVE * (1 - _LAG / (4 * np.pi))
    return [
        (turn, ((1.5, 4.4), (old, float(_last_surface(old))))),
        (now, ((cut, 1.15), (cut, float(_cut_surface(cut))))),
        (_Label(10.0, 7.2, thickness, "left"), None),
        (_Label(10.0, 6.05, r"cutting force $K\,h(t)$", "left"), None),
        (_Label(x, y, "mass $m$"), None),
        (_Label(x - 1.0, y + height / 2 + 0.85, "$k$", "right"), None),
        (_Label(x + 1.05, y + height / 2 + 0.85, "$c$", "left"), None),
        (_Label(x - width / 2 - 0.75, y + 0.35, "$x$", "right"), None),
        (_Label(shifted - 0.35, 4.78, "phase shift", "left"), None),
        (_Label(_TIP - 0.55, _MEAN_CUT + 0.72, "$h(t)$"), None),
        (_Label(_TIP + 3.7, _MEAN_CUT + 0.57, "chip"), None),
        (_Label(_TIP + 1.25, 4.1, "tool", "left"), None),
        (_Label(15.5, _MEAN_CUT + _MEAN_CHIP / 2, "$h_0$", "left"), None),
        (_Label(0.8, 0.85, "workpiece", "left"), None),
    ]


def _cut_surface(x: np.ndarray | float) -> np.ndarray:
    """Height that the tool leaves, which rises now as it moves to the left."""
    return _MEAN_CUT + _CREST * np.cos(2 * np.pi * (np.asarray(x) - _TIP) / _WAVE + _LAG)


def _last_surface(x: np.ndarray | float) -> np.ndarray:
    """Height left one turn ago; the tool is at one of its crests."""
    return _MEAN_CUT + _MEAN_CHIP + _CREST * np.cos(2 * np.pi * (np.asarray(x) - _TIP) / _WAVE)


def _draw_chatter_marks(ax: Axes) -> None:
    """Workpiece with both surfaces, the layer between them that is gone, and how it moves."""
    left, right, bottom = _CUT_PIECE
    ahead, behind = np.linspace(left, _TIP, 400), np.linspace(_TIP, right, 600)
    old, cut, gone = _last_surface(ahead), _cut_surface(behind), _last_surface(behind)
    layer = [*zip(behind, cut, strict=True), *zip(behind[::-1], gone[::-1], strict=True)]
    ax.add_patch(Polygon(layer, facecolor=FOCUS, linewidth=0, zorder=0.5))
    surface = [*zip(ahead, old, strict=True), *zip(behind, cut, strict=True)]
    body = [(left, bottom), *surface, (right, bottom)]
    ax.add_patch(Polygon(body, facecolor=PLANT, edgecolor=INK, linewidth=_LINE, zorder=0.6))
    ax.plot(ahead, old, color=DISTURBED, linewidth=2.2, linestyle="-")
    ax.plot(behind, gone, color=DISTURBED, linewidth=1.6, linestyle=(0, (4, 2)))
    ax.plot(behind, cut, color=INK, linewidth=2.2, linestyle="-")
    ax.plot([3.4, 5.0], [0.85, 0.85], color=INK, linewidth=2.2, linestyle="-")
    _head(ax, (5.3, 0.85), (1, 0), INK, scale=1.5)


def _draw_chatter_lengths(ax: Axes) -> None:
    """Chip thickness at the tool and on average, and the shift between the two waves."""
    thin = {"color": INK, "linewidth": 0.8, "linestyle": "-"}
    tip, crest = float(_cut_surface(_TIP)), float(_last_surface(_TIP))
    at = _TIP - 1.15
    ax.plot([at - 0.2, _TIP], [tip, tip], **thin)
    ax.plot([at - 0.2, _TIP], [crest, crest], **thin)
    _double_arrow(ax, (at, tip), (at, crest))
    right = _CUT_PIECE[1]
    for height in (_MEAN_CUT, _MEAN_CUT + _MEAN_CHIP):
        dashes = {"color": "#6a6a6a", "linewidth": 0.8, "linestyle": (0, (7, 2.5, 1.5, 2.5))}
        ax.plot([_TIP + 1.6, right + 0.3], [height, height], **dashes)
    _double_arrow(ax, (right + 0.15, _MEAN_CUT), (right + 0.15, _MEAN_CUT + _MEAN_CHIP))
    old = _TIP + _WAVE
    cut = old - _WAVE * _LAG / (2 * np.pi)
    for x, surface in ((old, _last_surface), (cut, _cut_surface)):
        ax.plot([x, x], [float(surface(x)), 4.5], **thin)
    _double_arrow(ax, (cut, 4.3), (old, 4.3))


def _draw_chatter_tool(ax: Axes, font: float) -> None:
    """Tool and mass on spring and damper, the frame that holds them, and the sense of x."""
    ink = {"edgecolor": INK, "linewidth": _LINE}
    x, y, width, height = _MASS
    tip = (_TIP, float(_cut_surface(_TIP)))
    low, high, roof = y - height / 2, y + height / 2, 7.7
    shank = [tip, (_TIP + 0.1, low), (_TIP + 1.1, low), (_TIP + 0.95, tip[1] + 0.75)]
    ax.add_patch(Polygon(shank, facecolor="#6e6e6e", zorder=2.5, **ink))
    _paint(ax, [Block("mass", "", (x, y), width, height, PAPER)], [], [], [], font)
    ax.add_patch(
        Rectangle((x - 1.5, roof), 3.0, 0.35, facecolor=PAPER, hatch="////", zorder=2, **ink)
    )
    _draw_spring(ax, x - 0.6, high, roof)
    _draw_damper(ax, x + 0.6, high, roof)
    side = x - width / 2
    ax.plot([side - 0.75, side - 0.15], [y, y], color=INK, linewidth=0.8, linestyle="-")
    _draw_wire(ax, [(side - 0.45, y), (side - 0.45, y + 1.0)], INK, arrow=True)


def _draw_spring(ax: Axes, x: float, low: float, high: float) -> None:
    """A vertical spring with straight ends."""
    reach = np.linspace(0.18, 0.82, 14)
    side = 0.2 * np.array([0, *np.resize([1, -1], 12), 0])
    points = [(x, low), *zip(x + side, low + (high - low) * reach, strict=True), (x, high)]
    ax.plot(*zip(*points, strict=True), color=INK, linewidth=_LINE, linestyle="-", zorder=2)


def _draw_damper(ax: Axes, x: float, low: float, high: float) -> None:
    """A vertical dashpot: a cup below, and a piston that hangs in it."""
    line = {"color": INK, "linewidth": _LINE, "linestyle": "-", "zorder": 2}
    floor, rim, piston = (low + (high - low) * share for share in (0.3, 0.68, 0.5))
    ax.plot([x, x], [low, floor], **line)
    ax.plot([x - 0.24, x - 0.24, x + 0.24, x + 0.24], [rim, floor, floor, rim], **line)
    ax.plot([x, x], [piston, high], **line)
    ax.plot([x - 0.18, x + 0.18], [piston, piston], color=INK, linewidth=2.6, linestyle="-")


# --- the layout of loops -------------------------------------------------------------------------


def _row(parts: Sequence[Item], labels: Sequence[str]) -> tuple[list[Item], list[Wire]]:
    """Set out parts from left to right, with a wire before, between and after them.

    A part keeps its height; a wire between two heights runs at the upper one.
    """
    x, placed = 0.0, []
    for part, label in zip(parts, labels[:-1], strict=True):
        half = _half_size(part)[0]
        x += _length(label, arrow=not isinstance(part, Node)) + half
        placed.append(replace(part, xy=(x, part.xy[1])))
        x += half
    stops = [(0.0, 0.0), *(part.name for part in parts), (x + _length(labels[-1]), 0.0)]
    heights = [0.0, *(part.xy[1] for part in parts), 0.0]
    wires = [
        Wire(*ends, label, via=max(levels))
        for ends, levels, label in zip(pairwise(stops), pairwise(heights), labels, strict=True)
    ]
    return placed, wires


def _length(label: str, arrow: bool = True) -> float:
    """Length of the wire that carries `label`."""
    if not (label or arrow):
        return 0.5
    return max(_GAP, _text_size(label)[0] + 0.8)


def _load(disturbance: str, plant_input: str) -> tuple[list[Item], list[str]]:
    """The sum that lets a disturbance in, if there is one, and the label behind it."""
    if not disturbance:
        return [], []
    return [Sum("load", signs={"w": "+", "n": "+"})], [plant_input]


def _load_wire(items: Sequence[Item], disturbance: str) -> list[Wire]:
    """The wire that brings the disturbance down to its sum."""
    return [
        Wire((item.xy[0], 1.1), "load", disturbance, color=DISTURBED)
        for item in items
        if item.name == "load"
    ]


def _frame_around(items: Sequence[Item], first: str, last: str) -> Frame:
    """A frame around the inner loop that runs from the sum `first` to the node `last`."""
    by_name = _by_name(items)
    left = by_name[first].xy[0] - _RADIUS - 0.36
    right = by_name[last].xy[0] + 0.22
    bottom, top = -1.55, 0.8
    centre = ((left + right) / 2, (bottom + top) / 2)
    return Frame(f"{first} frame", centre, right - left, top - bottom)


# --- where things are ----------------------------------------------------------------------------


def _by_name(items: Sequence[Item]) -> dict[str, Item]:
    named: dict[str, Item] = {}
    for item in items:
        if item.name in named:
            raise ValueError(f"two items are named {item.name!r}: give every item its own name")
        named[item.name] = item
    return named


def _item(end: str | Point, by_name: Mapping[str, Item]) -> Item:
    """The item at the end of a wire; a free end is a node without ink."""
    if not isinstance(end, str):
        return Node("", end)
    if end not in by_name:
        known = ", ".join(map(repr, by_name)) or "no items"
        raise ValueError(f"a wire ends at {end!r}, which is not drawn: use one of {known}")
    return by_name[end]


def _text_size(text: str) -> tuple[float, float]:
    """Width and height of a text in diagram units."""
    boxes = [TextPath((0, 0), line, size=_EM).get_extents() for line in text.split("\n") if line]
    if not boxes:
        return 0.0, 0.0
    return max(b.width for b in boxes), max(b.height for b in boxes) + 1.2 * _EM * (len(boxes) - 1)


def _half_size(item: Item) -> Point:
    if isinstance(item, Sum):
        return _RADIUS, _RADIUS
    if isinstance(item, Node):
        return 0.0, 0.0
    width, height = _text_size(item.text) if isinstance(item, Block) else (0.0, 0.0)
    height += 2 * _icon_lift(item)
    width = max(1.1, width + 0.5) if item.width is None else item.width
    height = max(1.0, height + 0.45) if item.height is None else item.height
    return width / 2, height / 2


def _icon_lift(item: Item) -> float:
    """How far above the middle of a block its icon is; its text is as far below."""
    return _ICON[1] + 0.1 if isinstance(item, Block) and item.icon else 0.0


def _route(wire: Wire, by_name: Mapping[str, Item]) -> list[Point]:
    """Corners of a wire from border to border."""
    start, end = _item(wire.start, by_name), _item(wire.end, by_name)
    level = start.xy[1] if wire.via is None else wire.via
    corners: list[Point] = []
    for corner in (start.xy, (start.xy[0], level), (end.xy[0], level), end.xy):
        if not corners or not np.allclose(corner, corners[-1]):
            corners.append(corner)
    if len(corners) < 2:
        raise ValueError(f"the wire {wire.start!r} to {wire.end!r} has no length: move an end")
    if isinstance(end, Sum) and (side := _side(end.xy, corners[-2])) not in end.signs:
        raise ValueError(
            f"a wire enters the sum {end.name!r} from side {side!r}, which has no sign: "
            f"add {side!r} to its signs"
        )
    first, last = _border(start, corners[1]), _border(end, corners[-2])
    return [first, *corners[1:-1], last]


def _direction(here: Point, there: Point) -> tuple[int, int]:
    """Compass step from `here` to `there` along the longer of the two offsets."""
    dx, dy = there[0] - here[0], there[1] - here[1]
    return (int(np.sign(dx)), 0) if abs(dx) > abs(dy) else (0, int(np.sign(dy)))


def _side(here: Point, there: Point) -> str:
    return _COMPASS[_direction(here, there)]


def _border(item: Item, towards: Point) -> Point:
    """Where a wire to `towards` crosses the outline of an item."""
    (dx, dy), (half_x, half_y) = _direction(item.xy, towards), _half_size(item)
    return item.xy[0] + dx * half_x, item.xy[1] + dy * half_y


def _labels(
    items: Sequence[Item], wires: Sequence[Wire], routes: Sequence[list[Point]]
) -> list[_Label]:
    """Every text of a diagram and its place."""
    labels = []
    for item in items:
        if isinstance(item, Block):
            labels.append(_Label(item.xy[0], item.xy[1] - _icon_lift(item), item.text))
        if isinstance(item, Block | Frame) and item.title:
            (x, y), (dx, dy) = item.xy, _half_size(item)
            inside = (x - dx + 0.3, y - dy + 0.25, item.title, "left", "baseline")
            above = (x, y + dy + _BASELINE, item.title, "center", "baseline")
            labels.append(_Label(*(inside if isinstance(item, Frame) else above)))
        if isinstance(item, Sum):
            for side, sign in item.signs.items():
                dx, dy = _SIGN_SPOTS[side]
                if side == "s" and "e" in item.signs:
                    dx = -dx
                labels.append(_Label(item.xy[0] + dx, item.xy[1] + dy, sign))
    labels += [_wire_label(w, route) for w, route in zip(wires, routes, strict=True) if w.label]
    return labels


def _wire_label(wire: Wire, route: Sequence[Point]) -> _Label:
    """Beyond a free vertical tail, else above the longest level run, else right of the wire."""
    runs = list(pairwise(route))
    level = [run for run in runs if _direction(*run)[1] == 0]
    (x0, y0), (x1, y1) = max(level or runs, key=lambda run: np.hypot(*np.subtract(*run)))
    if level:
        head = _HEAD[0] * np.sign(x1 - x0) * ((x1, y1) == route[-1])
        place = ((x0 + x1 - head) / 2, y0 + _BASELINE, wire.label, "center", "baseline")
    elif not isinstance(wire.start, str) and y1 < y0:
        place = (x0, y0 + 0.12, wire.label, "center", "bottom")
    elif not isinstance(wire.start, str):
        place = (x0, y0 - 0.1, wire.label, "center", "top")
    else:
        place = (x0 + 0.14, (y0 + y1) / 2, wire.label, "left", "center")
    return _Label(*place, wire.color)


def _extent(
    items: Sequence[Item], routes: Sequence[list[Point]], labels: Sequence[_Label]
) -> tuple[float, float, float, float]:
    """Left, bottom, right and top of all ink."""
    points = [point for route in routes for point in route]
    for item in items:
        (x, y), (dx, dy) = item.xy, _half_size(item)
        points += [(x - dx, y - dy), (x + dx, y + dy)]
    for label in labels:
        width, height = _text_size(label.text)
        x = label.x - width * {"left": 0.0, "center": 0.5, "right": 1.0}[label.ha]
        below = {"baseline": 0.35, "bottom": 0.0, "center": 0.5, "top": 1.0}[label.va]
        y = label.y - height * below
        points += [(x, y), (x + width, y + height)]
    x, y = np.array(points).T
    return x.min() - 0.12, y.min() - 0.12, x.max() + 0.12, y.max() + 0.12


# --- ink -----------------------------------------------------------------------------------------


def _fit(ax: Axes, box: tuple[float, float, float, float]) -> float:
    """Show `box` in the axes and return the font size, in points, that belongs to its scale."""
    left, bottom, right, top = box
    ax.set_axis_off()
    ax.set_aspect("equal")
    ax.set(xlim=(left, right), ylim=(bottom, top))
    figure = ax.get_figure(root=True)
    figure.draw_without_rendering()  # runs the layout, so that the scale below is the final one
    unit = np.ptp(ax.transData.transform([(0, 0), (1, 0)])[:, 0]) * 72 / figure.dpi
    shrink = max(1.0, unit * _EM / _LARGEST_FONT)
    half_x, half_y = shrink * (right - left) / 2, shrink * (top - bottom) / 2
    x, y = (left + right) / 2, (bottom + top) / 2
    ax.set(xlim=(x - half_x, x + half_x), ylim=(y - half_y, y + half_y))
    return unit * _EM / shrink


def _paint(
    ax: Axes,
    items: Sequence[Item],
    wires: Sequence[Wire],
    routes: Sequence[list[Point]],
    labels: Sequence[_Label],
    font: float,
) -> None:
    for wire, route in zip(wires, routes, strict=True):
        into_dot = any(isinstance(i, Node) and i.name == wire.end for i in items)
        _draw_wire(ax, route, wire.color, arrow=not into_dot, dashed=wire.dashed)
    for item in items:
        ax.add_patch(_shape(item))
        if lift := _icon_lift(item):
            icon = item.xy + np.multiply(item.icon, _ICON) + (0.0, lift)
            ax.plot(*icon.T, color=INK, linewidth=_LINE, linestyle="-", zorder=4)
    for label in labels:
        _write(ax, label, font)


def _shape(item: Item) -> Patch:
    """The patch that stands for an item."""
    (x, y), (dx, dy) = item.xy, _half_size(item)
    ink = {"edgecolor": INK, "linewidth": _LINE}
    if isinstance(item, Node):
        return Circle(item.xy, _DOT, facecolor=INK, linewidth=0, zorder=4)
    if isinstance(item, Sum):
        return Circle(item.xy, _RADIUS, facecolor=PAPER, zorder=3, **ink)
    corner = (x - dx, y - dy)
    if isinstance(item, Frame):
        dashes = {"linestyle": (0, (5, 3)), "edgecolor": "#5a5a5a", "linewidth": 1.0}
        return Rectangle(corner, 2 * dx, 2 * dy, fill=False, zorder=1, **dashes)
    pad = "round,pad=0,rounding_size=0.08"
    return FancyBboxPatch(corner, 2 * dx, 2 * dy, pad, facecolor=item.fill, zorder=3, **ink)


def _draw_wire(
    ax: Axes, route: Sequence[Point], color: str, arrow: bool, dashed: bool = False
) -> None:
    """A polyline whose arrow head ends exactly on the outline it points at."""
    x, y = np.array(route, dtype=float).T
    if arrow:
        step = _direction(route[-2], route[-1])
        _head(ax, route[-1], step, color)
        x[-1] -= 0.6 * _HEAD[0] * step[0]
        y[-1] -= 0.6 * _HEAD[0] * step[1]
    dashes = (0, (4, 2)) if dashed else "-"
    style = {"linewidth": _LINE, "linestyle": dashes, "marker": "", "solid_joinstyle": "miter"}
    ax.plot(x, y, color=color, zorder=2, solid_capstyle="butt", **style)


def _head(ax: Axes, tip: Point, step: Point, color: str, scale: float = 1.0) -> None:
    """A filled arrow head with its tip at `tip`, pointing along the unit vector `step`."""
    along, across = np.array(step, dtype=float), np.array([-step[1], step[0]], dtype=float)
    length, half = scale * _HEAD[0], scale * _HEAD[1]
    base = np.array(tip) - length * along
    corners = [tip, base + half * across, base - half * across]
    ax.add_patch(Polygon(corners, facecolor=color, linewidth=0, zorder=4))


def _double_arrow(
    ax: Axes, start: Point, end: Point, linewidth: float = 0.8, scale: float = 0.8
) -> None:
    """A line with a head at either end, as of a dimension."""
    reach = np.subtract(end, start)
    step = reach / np.hypot(*reach)
    inset = 0.6 * scale * _HEAD[0] * step  # the line stops inside the heads
    line = np.stack([start + inset, end - inset])
    ax.plot(*line.T, color=INK, linewidth=linewidth, linestyle="-", solid_capstyle="butt")
    _head(ax, start, tuple(-step), INK, scale)
    _head(ax, end, tuple(step), INK, scale)


def _clockwise(ax: Axes, centre: Point, radius: float, degrees: tuple[float, float]) -> None:
    """An arc with a head that shows a sense of rotation, from the larger angle to the smaller."""
    turn = np.radians(np.linspace(*degrees, 60))
    arc = np.column_stack([np.cos(turn), np.sin(turn)]) * radius + centre
    ax.plot(*arc.T, color=INK, linewidth=1.6, linestyle="-")
    step = np.array([np.sin(turn[-1]), -np.cos(turn[-1])])
    _head(ax, tuple(arc[-1] + 0.25 * step), tuple(step), INK, scale=1.2)


def _annotate(ax: Axes, notes: Sequence[_Note], font: float) -> None:
    for label, target in notes:
        _write(ax, label, font)
        if target is not None:
            line = {"color": label.color, "linewidth": 0.8, "linestyle": "-"}
            ax.plot(*zip(*target, strict=True), zorder=4, **line)


def _write(ax: Axes, label: _Label, font: float) -> None:
    ax.text(
        label.x,
        label.y,
        label.text,
        ha=label.ha,
        va=label.va,
        color=label.color,
        fontsize=font,
        multialignment="left" if label.ha == "left" else "center",
        linespacing=1.15,
        zorder=5,
    )
