"""Face milling seen along the spindle axis: inserts, what they cut, runout and force."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from scipy.interpolate import PchipInterpolator

from rcbook.machines.face_mill import TSAO_PONG1991, FaceMill
from rcbook.pictures.sketch import DISTURBED, FOCUS, PLANT, STEEL, THIN, TOOL, Sketch, about

AXIS = (5.3, 4.2)  # of the spindle
RADIUS, TOOTH_FEED = 2.6, 0.6  # of the cutter, and feed per tooth, which is far too large
STANDS = np.radians(80.0)  # where the insert stands that reaches out most
BLANK = (0.5, 11.9)  # left and right end of the workpiece
MEASURED = np.radians(106.0)  # where the chip's thickness is shown
CHIP = "#7fb4dd"  # fill of this chip, darker than FOCUS
INSERT = ((0.0, 0.0), (-0.08, -0.62), (-0.5, -0.58), (-0.42, -0.14))  # along, outward
BODY = np.radians([-2, 0, 6, 14, 22, 43]), (2.3, 1.85, 1.8, 1.95, 2.3, 2.3)  # from insert to insert


def draw_face_mill_setup(ax: Axes, mill: FaceMill = TSAO_PONG1991) -> Axes:
    """Draw face milling of a full slot along the spindle axis: inserts, chips, runout and force.

    A tooth enters the workpiece at the top, at 0 degrees, and leaves at the bottom.  Made for a
    figure of about 7.5 by 3.9 inches; feed and runout are exaggerated, alike and about 200 times.
    """
    sketch, cutter = Sketch(ax), Cutter(mill)
    _draw_blank(sketch, cutter)
    _draw_cutter(sketch, cutter)
    chip, end = "chip thickness\n" + r"$f_t\,\sin\theta_i+\Delta_i$", cutter.chip_ends()[1]
    words = "cutter centre,\noff by the runout"
    sketch.write(words, 7.0, 0.62, "left", cutter.centre, color=DISTURBED)
    sketch.words(("spindle axis", 0.8, 2.05, "left", AXIS), (chip, 12.35, 3.9, "left", end))
    sketch.words(("entry, 0°", AXIS[0], 7.95), ("exit, 180°", AXIS[0], 0.62))
    sketch.words(("speed $w$", 2.2, 7.35), ("feed $v_0$", 13.05, 2.3), ("workpiece", 10.2, 6.2))
    return ax


class Cutter:
    """The inserts of a face mill as drawn, with its runout in true proportion to its tooth feed.

    Inserts are numbered from 1 against the rotation; numbers below are those of the turn before.
    """

    def __init__(self, mill: FaceMill) -> None:
        radius = np.cumsum(mill.runout)
        self.mill, self.longest = (
            mill,
            int(np.argmax(radius)) + 1,
        )  # the insert that reaches out most
        self.radii = RADIUS + TOOTH_FEED / mill.tooth_feed * (radius - radius.mean())
        turn = self.angle(np.arange(1, mill.teeth + 1))
        self.centre = AXIS + 2 * np.mean(about((0, 0), self.radii, turn), axis=0)

    def angle(self, number: float | np.ndarray) -> float | np.ndarray:
        """Where an insert stands now, in rad clockwise from the top."""
        return STANDS - (number - self.longest) * self.mill.pitch

    def path(self, number: int, angle: float | np.ndarray) -> np.ndarray:
        """Where an insert is on the workpiece at an angle (rad): its circle and the feed."""
        fed = TOOTH_FEED * (np.asarray(angle) - self.angle(number)) / self.mill.pitch
        circle = about(AXIS, self.radii[(number - 1) % self.mill.teeth], angle)
        return circle + np.multiply.outer(fed, (1.0, 0.0))

    def chip_ends(self) -> np.ndarray:
        """Inner and outer end of the measured chip, on a line from the spindle axis."""
        paths = (self.path(n, np.linspace(0, np.pi, 999)) for n in (self.longest - 1, self.longest))
        polar = ((np.arctan2(x, y), np.hypot(x, y)) for x, y in ((p - AXIS).T for p in paths))
        return about(AXIS, [np.interp(MEASURED, *path) for path in polar], MEASURED)


def _draw_blank(sketch: Sketch, cutter: Cutter) -> None:
    """Workpiece with the layers that the inserts will cut, what they have cut, and the feed."""
    (left, right), y, up, down = BLANK, AXIS[1], AXIS[1] + 4.0, AXIS[1] - 4.0
    place, near = (left, y - RADIUS, right - left, 2 * RADIUS), cutter.longest + np.arange(-3, 2)
    whole = sketch.box(*place, PLANT)
    for number in near[:0:-1]:
        path = cutter.path(number, np.linspace(0.0, np.pi, 400))
        behind = [(path[-1, 0], down), (left, down), (left, up), (path[0, 0], up)]
        fill = CHIP if number == cutter.longest else FOCUS
        sketch.area([*path, *behind], fill, THIN).set_clip_path(whole)
    for number in near:
        path = cutter.path(number, np.linspace(0.0, min(cutter.angle(number), np.pi), 400))
        gone = cutter.angle(number) > np.pi  # it has just left
        behind = [(path[-1, 0], down), (left, down)] if gone else [AXIS, (left, y)]
        cut = [(path[0, 0], up), *path]
        sketch.area([*cut, *behind, (left, up)], pen=0).set_clip_path(whole)
        sketch.line(cut, clip_path=whole)
    sketch.box(*place, "none")
    sketch.arrow((13.9, 1.8), (12.3, 1.8))


def _draw_cutter(sketch: Sketch, cutter: Cutter) -> None:
    """Body with a pocket ahead of every insert, inserts, runout; angles, chip, force and pitch."""
    teeth, fine = cutter.mill.teeth, np.linspace(BODY[0][0], BODY[0][-1], 60)
    turn = np.concatenate([fine + cutter.angle(n) for n in range(teeth, 0, -1)])
    sketch.area(about(cutter.centre, np.tile(PchipInterpolator(*BODY)(fine), teeth), turn), STEEL)
    for number in range(1, teeth + 1):
        outward, along = about((0, 0), 1.0, cutter.angle(number) + np.array([0.0, np.pi / 2]))
        tip = cutter.path(number, cutter.angle(number))
        fill = DISTURBED if number == cutter.longest else TOOL
        sketch.area([tip + r * outward + t * along for t, r in INSERT], fill)
        sketch.write(str(number), *(tip - outward - 0.27 * along))
    sketch.runout(AXIS, cutter.centre, RADIUS)
    sketch.turn(AXIS, 3.2, -48.0, -10.0)

    (x, y), tip = AXIS, cutter.path(cutter.longest, STANDS)
    for line in ([AXIS, (x, y + 3.4)], [(x, y - RADIUS), (x, y - 3.2)], [AXIS, tip]):
        sketch.line(line, THIN)
    sketch.turn(AXIS, 1.2, 0.0, np.degrees(STANDS))
    sketch.arrow(*cutter.chip_ends(), THIN, both=True)
    sketch.arrow(tip, about(tip, 1.6, STANDS - np.pi / 2))  # against the way the insert moves
    ends = cutter.angle(cutter.longest + np.array([4, 3]))
    for end in ends:
        sketch.line(about(AXIS, [2.5, 3.55], end), THIN)
        sketch.turn(AXIS, 3.3, np.degrees(ends.mean()), np.degrees(end), THIN)
    sketch.words((r"$\Delta\theta$", *about(AXIS, 3.75, ends.mean())))
    sketch.words((r"$\theta_i$", *about(AXIS, 0.8, STANDS / 2)), ("$F_t$", 8.30, 5.80))
