"""Noncircular boring at a varying speed: the machine, samples at equal angles, and the bore."""

from dataclasses import replace
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from rcbook.machines import boring_bar, chatter
from rcbook.machines.boring_bar import BoringBar
from rcbook.pictures.blocks import Block, Wire, add_blocks, path
from rcbook.pictures.results import MICRO, bare_polar
from rcbook.pictures.sketch import BOLD, FOCUS, PLANT, STEEL, THIN, TOOL, Sketch, about, turn_of

MACHINED = replace(boring_bar.HANSON_TSAO2000, amplitude=23e-6)  # section 5, machining

LEVEL = 5.15  # height of the spindle axis
END = (13.3, LEVEL)  # centre of the view along the axis
JAWS, PIPE, ROUGH, ROD = 2.15, 1.62, 0.8, 0.42  # radii: chuck, workpiece, bore before, bar
BORE, OVAL = 1.1, 0.16  # mean radius and amplitude of the bore; the amplitude is exaggerated
EDGE = 4.95  # where the tool is along the axis
TURNED = np.radians(30.0)  # by which the spindle has turned since its mark faced the tool
DOTS = 24  # samples drawn in a turn

LEFT, RIGHT = 1.9, 15.1  # ends of one period of the speed
ANGLES, TIMES, ZERO, MEAN = 5.75, 3.95, 0.45, 1.4  # heights: both axes, no speed and mean speed
STEPS, SWING = 16, 0.5  # samples in the period; amplitude of the speed, larger than in practice


def draw_boring_setup(
    ax: Axes, bar: BoringBar = MACHINED, cut: chatter.Cut = chatter.HANSON_TSAO2000
) -> Axes:
    """Draw noncircular boring in section and along the axis, and the signals round the computer."""
    samples = round(2 * np.pi / (float(cut.speed) * bar.sampling_interval))
    sketch, size = Sketch(ax, (0.0, 0.2, 16.5, 8.6)), {"width": 2.4, "height": 1.3}
    _draw_side(sketch)
    _draw_end(sketch)
    items = [
        Block("encoder", "encoder", (1.15, LEVEL), FOCUS, width=2.0, height=1.1),
        Block("computer", "computer", (5.0, 1.1), FOCUS, **size),
        Block("amplifier", "amplifier", (9.5, 1.1), **size),
        Block("holder", "holder", (9.1, LEVEL), PLANT, width=1.7, height=1.8),
    ]
    under = LEVEL - 0.9  # the underside of the holder
    wires = [
        Wire("encoder", "computer", via=1.1),
        *path("computer", "$v(k)$", "amplifier", "", (9.5, under)),
        Wire((8.6, under), "computer", "position $y(k)$", via=2.55),
    ]
    add_blocks(sketch, items, wires)
    law = r"speed $\omega(t)=\omega_0\,[1+\mathrm{RVA}\,\sin(\mathrm{RVF}\,\omega_0\,t)]$"
    every = "trigger every\n" + rf"$\Delta\theta$ = {360 / samples:g}°"
    bore = f"elliptical bore,\n{2 * MICRO * bar.amplitude:g} µm peak to peak"
    sketch.words((law, 0.2, 8.2, "left"), (every, 1.4, 2.3, "left"))
    sketch.words((bore, 11.1, 1.4, "left", bored(np.radians(190.0))))
    sketch.words((f"{samples} samples a turn", 12.6, 8.2, "right", bored(np.radians(-30.0))))
    return ax


def bored(angle: ArrayLike) -> np.ndarray:
    """Points on the finished bore at an angle (rad) clockwise from the tool."""
    return about(END, BORE + OVAL * np.cos(2 * (TURNED - np.asarray(angle))), angle)


def _draw_side(sketch: Sketch) -> None:
    """Spindle, chuck and workpiece cut open along the axis; bar, piezo stack and tool in it."""
    sketch.box(2.1, LEVEL - 0.4, 0.7, 0.8, PLANT)
    sketch.box(2.75, LEVEL - JAWS, 0.75, 2 * JAWS)
    wall, grip = bored(0.0)[1] - LEVEL, JAWS - 0.1
    jaw = [(3.5, PIPE), (4.3, PIPE), (4.3, grip), (3.5, grip)]
    cut = [(EDGE, ROUGH), (EDGE, wall), (6.5, wall), (6.5, PIPE), (3.5, PIPE), (3.5, ROUGH)]
    for side in (1, -1):
        for shape, *fill in ((jaw,), (cut, STEEL)):
            sketch.area(np.array(shape) * (1, side) + (0, LEVEL), *fill)
    sketch.box(EDGE - 0.2, LEVEL - ROD, 3.6, 2 * ROD, PLANT)
    for layer in range(6):
        sketch.box(EDGE - 0.05, LEVEL - 0.3 + layer / 10, 0.5, 0.1, FOCUS, THIN)
    tool = [(0.0, wall), (0.35, wall - 0.12), (0.45, 0.3), (-0.05, 0.3)]
    sketch.area(np.add(tool, (EDGE, LEVEL)), TOOL)
    sketch.span((5.68, LEVEL + 0.47), (5.68, LEVEL + wall - 0.05))
    sketch.arrow((10.9, LEVEL), (9.95, LEVEL))
    sketch.words(("chuck", 3.1, 7.55), ("workpiece", 5.5, 7.1), ("$y$", 5.98, LEVEL + 0.76))
    sketch.words(("boring bar", 6.7, 6.6, "left", (7.4, LEVEL + ROD)), ("feed", 10.5, LEVEL + 0.42))
    sketch.words(("piezo", 6.75, 4.2, "left", (5.25, LEVEL - 0.15)))


def _draw_end(sketch: Sketch) -> None:
    """Chuck, workpiece, bore and tool along the axis, the samples of a turn, and the angle."""
    wall = bored(0.0)[1] - LEVEL
    sketch.chuck(END, JAWS, TURNED + np.pi / 3)
    sketch.circle(END, PIPE, STEEL)
    sketch.area(bored(turn_of(360)), PLANT)
    sketch.circle(END, ROUGH, pen=THIN)
    sketch.reference(about(END, [ROD, 2.75], TURNED))
    sketch.line(about(END, [wall, 2.75], 0.0), THIN)
    for at in bored(TURNED - turn_of(DOTS)):
        sketch.dot(at, 0.055)
    tool = [(0.0, wall), (0.3, wall - 0.2), (0.3, 0.2), (0.0, 0.2)]  # cuts with its left face
    sketch.area(np.add(tool, END), TOOL)
    sketch.circle(END, ROD, PLANT)
    sketch.turn(END, 2.5, (0.0, TURNED), THIN)
    sketch.turn(END, JAWS + 0.35, np.radians([48.0, 108.0]))
    sketch.words((r"$\theta$", *about(END, 2.95, 0.55 * TURNED)), (r"$\omega$", 16.09, 5.74))


def draw_periodic_sampling(ax: Axes) -> Axes:
    """Draw one period of a sinusoidal speed: equal steps of the angle, unequal ones of time."""
    sketch = Sketch(ax, (0.0, 0.2, 16.2, 7.9))
    law = partial(
        boring_bar.relative_speed_law, nominal=2 * np.pi, rva=SWING, rvf=1.0
    )  # the period is 1 s
    intervals = boring_bar.angle_triggered_intervals(law, 2 * np.pi / STEPS, STEPS)
    times = np.append(0.0, np.cumsum(intervals))
    above, below = np.linspace(LEFT, RIGHT, STEPS + 1), LEFT + (RIGHT - LEFT) * times
    for word, k in (("short", np.argmin(np.diff(below))), ("long", np.argmax(np.diff(below)))):
        (a, b), (t, u) = above[k : k + 2], below[k : k + 2]
        sketch.area([(a, ANGLES), (b, ANGLES), (u, TIMES), (t, TIMES)], FOCUS, 0)
        sketch.span((a, ANGLES + 0.42), (b, ANGLES + 0.42))
        sketch.span((t, TIMES - 0.42), (u, TIMES - 0.42))
        sketch.words((r"$\Delta\theta$", (a + b) / 2, ANGLES + 0.85))
        sketch.words((f"{word} $T(k)$", (t + u) / 2, TIMES - 0.85))
    for k, text in ((0, "$k=0$"), (1, "1"), (2, "2"), (STEPS, "$N$")):
        sketch.write(text, above[k], ANGLES + 0.5)
    sketch.span((LEFT, ANGLES + 1.4), (RIGHT, ANGLES + 1.4))
    sketch.write("one period of the speed, $N$ samples", (LEFT + RIGHT) / 2, ANGLES + 1.75)

    sketch.reference([(LEFT - 0.2, MEAN), (RIGHT, MEAN)])
    scale, fine = (MEAN - ZERO) / (2 * np.pi), np.linspace(0.0, 1.0, 361)
    wave = np.stack([LEFT + (RIGHT - LEFT) * fine, ZERO + scale * law(fine)], axis=-1)
    sketch.line(wave, BOLD)
    for a, t, speed in zip(above, below, law(times), strict=True):
        sketch.line([(a, ANGLES + 0.24), (a, ANGLES), (t, TIMES), (t, TIMES - 0.24)])
        sketch.line([(t, ZERO), (t, ZERO + scale * speed)], THIN)
        sketch.dot((t, ZERO + scale * speed))
    sketch.words((r"$\omega_0$", LEFT - 0.3, MEAN, "right"), ("0", LEFT - 0.3, ZERO, "right"))
    axes = ("angle", ANGLES, r"$\theta$", ANGLES), ("time", TIMES, "$t$", TIMES)
    for word, y, symbol, height in (*axes, (r"speed $\omega$", MEAN + 0.6, "$t$", ZERO)):
        sketch.arrow((LEFT - 0.25, height), (RIGHT + 0.55, height), THIN)
        sketch.words((word, 0.1, y, "left"), (symbol, RIGHT + 0.75, height))
    return ax


def draw_bore(
    ax: Axes, angle: ArrayLike, desired: ArrayLike, error: ArrayLike, magnified: float, reach: float
) -> Axes:
    """Draw a bore about its nominal circle (`ax` is polar), as a roundness chart shows it, in µm.

    `desired` is the deviation from the circle and `error` what the cut lacks of it, magnified once
    more, at angles in rad over a turn or several; `reach` is the largest deviation with room (m).
    """
    desired, reach = MICRO * np.asarray(desired), MICRO * reach
    cut = desired - magnified * MICRO * np.asarray(error)
    ring = max(s * 10.0**n for n in range(-4, 5) for s in (1, 2, 5) if s * 10.0**n < reach)
    dashed = {"color": "0.35", "linewidth": 0.9, "linestyle": (0, (4, 3)), "zorder": 1.5}
    broad = {"color": "0.75", "linewidth": 4.5, "linestyle": "-", "zorder": 2}
    circle, fine = (turn_of(360), np.zeros(360), dashed), {"linewidth": 1.1}
    for at, values, style in (circle, (angle, desired, broad), (angle, cut, fine)):
        ax.plot(np.append(at, at[0]), np.append(values, values[0]), **style)
    words = f"rings\n±{ring:g} µm" + (f"\nerror {magnified:g}×" if magnified != 1 else "")
    ax.text(0.5, 0.5, words, ha="center", va="center", transform=ax.transAxes)
    ax.set_theta_zero_location("N")
    bare_polar(ax, dict(zip(("0°", "90°", "180°", "270°"), turn_of(4), strict=True)), [-ring, ring])
    ax.set_rlim(-reach, reach)
    ax.set_rorigin(-3 * reach)  # the bore itself is far larger
    return ax
