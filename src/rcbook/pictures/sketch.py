"""Three pens and the shapes they draw: what block diagrams and drawings of machines are made of.

Lengths are in drawing units, one of which is about the height of a block.  What is drawn later
covers what was drawn before; words lie on top.
"""

from functools import cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon, Rectangle
from matplotlib.textpath import TextPath
from numpy.typing import ArrayLike

INK, FAINT = "#1a1a1a", "#6a6a6a"  # FAINT: lines of reference
DISTURBED = "#9c3a00"  # a darkened Okabe-Ito vermilion: 7:1 on white
PAPER, PLANT, STEEL, TOOL = "#ffffff", "#ececec", "#c4c4c4", "#6e6e6e"  # fills
FOCUS = "#bad8f0"  # fill of what the picture is about; darker than PLANT in grey, too

THIN, LINE, BOLD = 0.8, 1.2, 2.0  # the pens: widths in points
DASHED = (0, (4, 2.5))
DOT = 0.07  # radius of a marked point
EM = 0.36  # font size of a block diagram in drawing units
HEAD = 0.24  # length of the head of an arrow, which grows with the pen
HEADS = {THIN: 0.8, LINE: 1.0, BOLD: 1.4}
_LARGEST_FONT = 16.0  # points; a drawing stops growing with its axes here

Point = tuple[float, float]


@cache
def text_size(text: str) -> Point:
    """Width and height of a text in the units of a block diagram."""
    lines = [TextPath((0, 0), line, size=EM).get_extents() for line in text.split("\n") if line]
    width, height = (max((getattr(b, s) for b in lines), default=0.0) for s in ("width", "height"))
    return width, height + 1.2 * EM * max(len(lines) - 1, 0)


def about(centre: ArrayLike, radius: ArrayLike, angle: ArrayLike) -> np.ndarray:
    """Points at a radius and an angle (rad) clockwise from the top; x and y on the last axis."""
    radius, angle = np.broadcast_arrays(radius, angle)
    return np.stack([radius * np.sin(angle), radius * np.cos(angle)], axis=-1) + centre


def turn_of(steps: int) -> np.ndarray:
    """Angles in rad of so many equal steps of a turn, from 0."""
    return 2 * np.pi * np.arange(steps) / steps


class Sketch:
    """Axes that show a box (left, bottom, right, top) in drawing units; `em` is the font size."""

    def __init__(self, ax: Axes, box: ArrayLike = (0, 0, 16, 8.4), em: float = 1.08 * EM) -> None:
        low, high = np.reshape(box, (2, 2))
        ax.set_axis_off()
        ax.set_aspect("equal")
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        figure = ax.get_figure(root=True)
        figure.draw_without_rendering()  # runs the layout, so that the scale below is the final one
        unit = np.ptp(ax.transData.transform([(0, 0), (1, 0)])[:, 0]) * 72 / figure.dpi
        shrink = max(1.0, unit * em / _LARGEST_FONT)
        middle, half = (low + high) / 2, shrink * (high - low) / 2
        (left, right), (bottom, top) = np.transpose([middle - half, middle + half])
        ax.set(xlim=(left, right), ylim=(bottom, top))
        self.ax, self.em, self.font = ax, em, unit * em / shrink

    def line(self, points: ArrayLike, pen: float = LINE, color: str = INK, **style) -> Line2D:
        """A line through points, one a row; `style` is Matplotlib's."""
        solid = {"linestyle": "-", "marker": "", "solid_capstyle": "butt", "zorder": 2}
        ink = {"color": color, "linewidth": pen, **solid, **style}
        return self.ax.plot(*np.transpose(points), **ink)[0]

    def reference(self, points: ArrayLike) -> None:
        """A thin chain line, as of an axis or of a mean."""
        self.line(points, THIN, FAINT, linestyle=(0, (7, 2.5, 1.5, 2.5)))

    def shape(self, shape: Patch, fill: str = PAPER, pen: float = LINE, **style) -> Patch:
        """A filled shape of Matplotlib's; without a pen (0) it has no outline."""
        shape.set(**{"fc": fill, "ec": INK, "linewidth": pen, "zorder": 2, **style})
        return self.ax.add_patch(shape)

    def area(self, points: ArrayLike, *ink, **style) -> Patch:
        """An area inside of points, one a row; `ink` and `style` as for a shape."""
        return self.shape(Polygon(points), *ink, **style)

    def box(self, left: float, bottom: float, width: float, height: float, *ink, **style) -> Patch:
        """A rectangle; `ink` and `style` as for a shape."""
        return self.shape(Rectangle((left, bottom), width, height), *ink, **style)

    def circle(self, centre: Point, radius: float, *ink, **style) -> Patch:
        """A circle; `ink` and `style` as for a shape."""
        return self.shape(Circle(tuple(centre), radius), *ink, **style)

    def dot(self, centre: Point, radius: float = DOT, color: str = INK) -> None:
        """A marked point."""
        self.circle(centre, radius, color, 0)

    def head(self, tip: Point, step: Point, scale: float = 1.0, color: str = INK, **style) -> None:
        """A filled arrow head whose tip is at `tip`; it points along the unit vector `step`."""
        along, across = scale * HEAD * np.array([step, (-step[1], step[0])], dtype=float)
        base = tip - along
        self.area([tip, base + 0.375 * across, base - 0.375 * across], color, 0, **style)

    def arrow(self, start: Point, end: Point, pen: float = BOLD) -> None:
        """A straight arrow, as of a movement."""
        step = np.subtract(end, start) / np.hypot(*np.subtract(end, start))
        self.line([start, end - 0.6 * HEADS[pen] * HEAD * step], pen)  # it stops inside the head
        self.head(end, step, HEADS[pen])

    def span(self, start: Point, end: Point, of: ArrayLike = (), pen: float = THIN) -> None:
        """A straight arrow with two heads, as of a length, and thin lines from what it measures."""
        for tip in (start, end):
            self.arrow(np.add(start, end) / 2, tip, pen)
        for tip, measured in zip((start, end), of, strict=False):
            away = np.subtract(tip, measured)
            self.line([measured, tip + 0.2 * away / np.hypot(*away)], THIN)

    def turn(self, centre: Point, radius: float, angles: Point, pen: float = BOLD) -> None:
        """An arc from one of two angles (rad clockwise from the top) to the other, with a head."""
        start, end = angles
        back = np.sign(end - start) * HEADS[pen] * HEAD / radius  # the angle that the head takes
        self.line(about(centre, radius, np.linspace(start, end - 0.6 * back, 60)), pen)
        step = about((0, 0), np.sign(back), end - back / 2 + np.pi / 2)
        self.head(about(centre, radius, end), step, HEADS[pen])

    def write(
        self, text: str, x: float, y: float, ha: str = "center", to: Point = (), **style
    ) -> None:
        """Words at a point, and a thin line from them to what they name, where `to` is given."""
        style = {"va": "center", "color": INK, "fontsize": self.font, "zorder": 3, **style}
        if len(to):
            half = self.em / EM * np.array(text_size(text)) / 2
            middle = np.array([x + {"left": 1, "center": 0, "right": -1}[ha] * half[0], y])
            nearest = np.clip(to, middle - half - 0.1, middle + half + 0.1)
            self.line([nearest, to], THIN, style["color"])
        self.ax.text(x, y, text, ha=ha, linespacing=1.15, **style)

    def words(self, *notes: tuple) -> None:
        """Several texts, each with the arguments of `write`."""
        for note in notes:
            self.write(*note)

    def chuck(self, centre: Point, radius: float, turned: float) -> None:
        """A chuck along its axis with three jaws, one at an angle (rad) clockwise from the top."""
        self.circle(centre, radius)
        for middle in turned + turn_of(3):
            outward, across = about((0, 0), radius, middle + np.array([0, np.pi / 2]))
            corners = np.array([(0.7, -0.15), (0.95, -0.15), (0.95, 0.15), (0.7, 0.15)])
            self.area(centre + corners @ [outward, across])

    def runout(self, spindle: Point, cutter: Point, swept: float) -> None:
        """A cross at the spindle axis, the circle swept about it, a dot at the cutter's axis."""
        self.circle(spindle, swept, "none", THIN, linestyle=DASHED)
        self.line([spindle, cutter], BOLD, DISTURBED)
        self.dot(cutter, color=DISTURBED)
        for reach in ((0.17, 0.0), (0.0, 0.17)):
            self.line([np.subtract(spindle, reach), np.add(spindle, reach)])
