"""Regenerative chatter: a tool on a spring cuts the wave that it left one turn ago."""

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from rcbook.pictures.blocks import Block, add_blocks
from rcbook.pictures.sketch import BOLD, DASHED, DISTURBED, FOCUS, LINE, PLANT, THIN, TOOL, Sketch

TIP = 6.2  # where the tool's edge is along the cut
CUT, CHIP = 2.15, 1.15  # mean height of the cut surface, and h0
WAVE, CREST = 3.2, 0.4  # length and amplitude of the chatter marks, exaggerated
LAG = np.radians(75.0)  # by which the wave being cut is behind that of the last turn
LEFT, RIGHT, BOTTOM = 0.5, 15.2, 0.3  # ends and bottom of the workpiece
MASS, ROOF = (6.75, 5.35), 7.7  # centre of the mass, and where its spring is held


def draw_regeneration(ax: Axes) -> Axes:
    """Draw a surface, unrolled and moving to the right, between a tool's last cut and its next."""
    sketch = Sketch(ax, (0.2, 0.2, 16.4, 8.5))
    _draw_marks(sketch)
    _draw_tool(sketch)
    thickness = "chip thickness\n" + r"$h(t)=h_0+x(t-\tau)-x(t)$"
    sketch.words((thickness, 10.0, 7.2, "left"), (r"cutting force $K\,h(t)$", 10.0, 6.05, "left"))
    turn, old, cut = "left one turn ago,\n" + r"$x(t-\tau)$", TIP - 1.55 * WAVE, TIP + 2.3 * WAVE
    sketch.write(turn, 0.5, 5.0, "left", (old, surface(old, 1)), color=DISTURBED)
    sketch.words(("being cut, $x(t)$", 11.4, 0.85, "left", (cut, surface(cut, 0))))
    sketch.words(("workpiece", 0.8, 0.85, "left"), ("chip", TIP + 3.7, CUT + 0.57))
    return ax


def surface(x: ArrayLike, turns_ago: int) -> np.ndarray:
    """Height left now (0), rising as the tool moves to the left, or a turn ago (1), at a crest."""
    phase = 2 * np.pi * (np.asarray(x) - TIP) / WAVE + (1 - turns_ago) * LAG
    return CUT + turns_ago * CHIP + CREST * np.cos(phase)


def _draw_marks(sketch: Sketch) -> None:
    """Workpiece, both surfaces, the layer between them that is gone, its lengths, and the feed."""
    ahead, behind = np.linspace(LEFT, TIP, 400), np.linspace(TIP, RIGHT, 600)
    sides = (ahead, 1), (behind, 0), (behind, 1)
    old, cut, gone = (np.column_stack([x, surface(x, turn)]) for x, turn in sides)
    sketch.area([*cut, *gone[::-1]], FOCUS, 0)
    sketch.area([(LEFT, BOTTOM), *old, *cut, (RIGHT, BOTTOM)], PLANT)
    sketch.line(old, BOLD, DISTURBED)
    sketch.line(gone, BOLD, DISTURBED, linestyle=DASHED)
    sketch.line(cut, BOLD)
    sketch.arrow((3.4, 0.85), (5.3, 0.85))

    low, high, at, mean = surface(TIP, 0), surface(TIP, 1), TIP - 1.15, RIGHT + 0.15
    sketch.span((at, low), (at, high), [(TIP, low), (TIP, high)])
    for height in (CUT, CUT + CHIP):
        sketch.reference([(TIP + 1.6, height), (RIGHT + 0.3, height)])
    sketch.span((mean, CUT), (mean, CUT + CHIP))
    old, cut = TIP + WAVE, TIP + WAVE * (1 - LAG / (2 * np.pi))
    sketch.span((cut, 4.3), (old, 4.3), [(cut, surface(cut, 0)), (old, surface(old, 1))])
    sketch.words(("phase shift", (old + cut) / 2 - 0.35, 4.78, "left"))
    sketch.words(("$h(t)$", TIP - 0.55, CUT + 0.72), ("$h_0$", RIGHT + 0.3, CUT + 0.575, "left"))


def _draw_tool(sketch: Sketch) -> None:
    """Tool and mass on spring and damper, the frame that holds them, and the sense of x."""
    (x, y), tip = MASS, surface(TIP, 0)
    low, high = y - 0.575, y + 0.575
    sketch.area([(TIP, tip), (TIP + 0.1, low), (TIP + 1.1, low), (TIP + 0.95, tip + 0.75)], TOOL)
    sketch.box(x - 1.5, ROOF, 3.0, 0.35, hatch="////")
    side, at = x - 0.6 + 0.2 * np.array([0, 0, *np.resize([1, -1], 12), 0, 0]), x + 0.6
    share = np.array([0, *np.linspace(0.18, 0.82, 14), 1])
    sketch.line(np.column_stack([side, high + (ROOF - high) * share]))
    floor, piston, rim = high + (ROOF - high) * np.array([0.3, 0.5, 0.68])
    cup = [(at - 0.24, rim), (at - 0.24, floor), (at + 0.24, floor), (at + 0.24, rim)]
    for line in ([(at, high), (at, floor)], cup, [(at, piston), (at, ROOF)]):
        sketch.line(line)
    sketch.line([(at - 0.18, piston), (at + 0.18, piston)], BOLD)
    sketch.line([(x - 1.9, y), (x - 1.3, y)], THIN)
    sketch.words(("tool", TIP + 1.25, 4.1, "left"), ("$x$", x - 1.9, y + 0.35, "right"))
    sketch.words(("$k$", x - 1.0, high + 0.85, "right"), ("$c$", x + 1.05, high + 0.85, "left"))
    sketch.arrow((x - 1.6, y), (x - 1.6, y + 1.0), LINE)
    add_blocks(sketch, [Block("mass", "mass $m$", MASS, width=2.3, height=1.15)], [])
