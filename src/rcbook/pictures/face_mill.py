"""Face milling seen along the spindle axis, and plots of its runs, its teeth and its chips."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from rcbook.machines import face_mill
from rcbook.machines.face_mill import TSAO_PONG1991, FaceMill, Run
from rcbook.pictures.results import AXES, GREY, bare_polar
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

    A tooth enters at the top and leaves at the bottom; feed and runout are exaggerated alike.
    """
    sketch, cutter = Sketch(ax), Cutter(mill)
    _draw_blank(sketch, cutter)
    _draw_cutter(sketch, cutter)
    chip, end = "chip thickness\n" + r"$f_t\,\sin\theta_i+\Delta_i$", cutter.chip_ends()[1]
    words = "cutter centre,\noff by the runout"
    sketch.write(words, 7.0, 0.62, "left", cutter.centre, color=DISTURBED)
    sketch.words(("spindle axis", 0.8, 2.05, "left", AXIS), (chip, 12.35, 3.9, "left", end))
    sketch.words(("entry, 0°", AXIS[0], 7.95), ("exit, 180°", AXIS[0], 0.62))
    sketch.words(
        (r"speed $\Omega$", 2.2, 7.35), ("feed $v_f$", 13.05, 2.3), ("workpiece", 10.2, 6.2)
    )
    return ax


class Cutter:
    """The inserts of a face mill as drawn, with its runout in true proportion to its tooth feed.

    Inserts are numbered from 1 against the rotation; numbers below are those of the turn before.
    """

    def __init__(self, mill: FaceMill) -> None:
        radius = np.cumsum(mill.runout)
        self.mill, self.longest = mill, int(np.argmax(radius)) + 1  # reaches out most
        self.radii = RADIUS + TOOTH_FEED / mill.tooth_feed * (radius - radius.mean())
        turn = self.angle(np.arange(1, mill.teeth + 1))
        self.centre = AXIS + 2 * np.mean(about((0, 0), self.radii, turn), axis=0)

    def angle(self, number: ArrayLike) -> ArrayLike:
        """Where an insert stands now, in rad clockwise from the top."""
        return STANDS - (number - self.longest) * self.mill.pitch

    def path(self, number: int, angle: ArrayLike) -> np.ndarray:
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
        sketch.line(cut).set_clip_path(whole)
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
    sketch.turn(AXIS, 3.2, np.radians([-48.0, -10.0]))

    (x, y), tip = AXIS, cutter.path(cutter.longest, STANDS)
    for line in ([AXIS, (x, y + 3.4)], [(x, y - RADIUS), (x, y - 3.2)], [AXIS, tip]):
        sketch.line(line, THIN)
    sketch.turn(AXIS, 1.2, (0.0, STANDS))
    sketch.span(*cutter.chip_ends())
    sketch.arrow(tip, about(tip, 1.6, STANDS - np.pi / 2))  # against the way the insert moves
    ends = cutter.angle(cutter.longest + np.array([4, 3]))
    for end in ends:
        sketch.line(about(AXIS, [2.5, 3.55], end), THIN)
        sketch.turn(AXIS, 3.3, (ends.mean(), end), THIN)
    sketch.words((r"$\Delta\theta$", *about(AXIS, 3.75, ends.mean())))
    sketch.words((r"$\theta_i$", *about(AXIS, 0.8, STANDS / 2)), ("$F_i$", 8.30, 5.80))


def draw_cut(axes: Sequence[Axes], run: Run) -> None:
    """Plot force, torque, current and speed of a run over revolutions, each on an axes of its own.

    A thin line marks where the controller sets in.
    """
    for ax, name in zip(axes, ("force", "torque", "current", "speed"), strict=True):
        ax.plot(run.turns, getattr(run, name), linewidth=0.9, linestyle="-")
        ax.axvline(run.experiment.controlled - 1, color=GREY, linewidth=0.8, linestyle=":")
        ax.set_ylabel(AXES[name])
        ax.margins(x=0)
    axes[-1].set_xlabel(f"{AXES['turns']} of the cutter")


def draw_teeth(
    ax: Axes, values: ArrayLike, reference: float, label: str = "", outlined: bool = False
) -> Axes:
    """Draw one bar per tooth from the hub of a cutter (`ax` is polar), and the reference dashed, N.

    Tooth 1 is at the top, the others follow anticlockwise.  Bars are broad and grey, or narrow and
    `outlined` to go over the broad ones.
    """
    angle, turn = np.arange(len(values)) / len(values) * 2 * np.pi, np.linspace(0, 2 * np.pi, 361)
    style = {"color": "0.80", "zorder": 2}
    if outlined:
        style = {"fill": False, "edgecolor": "black", "linewidth": 1.4, "zorder": 3}
    ax.bar(angle, values, (0.5 if outlined else 0.84) * angle[1], label=label or None, **style)
    ax.plot(turn, 0 * turn, color="0.3", linewidth=1.0, linestyle="-", zorder=3)
    circle = {"color": "C1", "linewidth": 1.3, "linestyle": (0, (4, 2)), "zorder": 4}
    named = None if outlined else f"nominal, {reference:.3g} N"
    ax.plot(turn, 0 * turn + reference, label=named, **circle)
    ax.set_theta_zero_location("N")
    bare_polar(ax, {f"{i + 1}": at for i, at in enumerate(angle)})
    ax.xaxis.grid(False)
    ax.set_rmin(0)
    ax.set_rorigin(-0.4 * reference)  # a hub, so that the bars do not crowd in the middle
    return ax


def draw_cuts(axes: np.ndarray, runs: Mapping[str, Run]) -> None:
    """Plot runs side by side, each as `draw_cut` has it on a column of four axes under its name.

    Raises ValueError when there is not a column for each run.
    """
    for column, (name, run) in zip(axes.T, runs.items(), strict=True):
        draw_cut(column, run)
        column[0].set_title(name)
    for ax in axes[:, 1:].ravel():
        ax.set_ylabel("")


def draw_moments(
    axes: Sequence[Axes], run: Run, turn: int, moments: Sequence[float], magnified: float
) -> None:
    """Draw the chips, as `draw_cutter_chips` has them, at moments in parts of a turn.

    Titles are the largest tooth force then.
    """
    mill, forces = run.experiment.mill, face_mill.tooth_forces(run)
    stiffness = mill.cutting_coefficient * mill.depth
    for ax, moment in zip(axes, moments, strict=True):
        now = run.during(turn).start + round(moment * run.experiment.steps_per_turn)
        angles = 2 * np.pi * (run.turns[now] - np.arange(mill.teeth) / mill.teeth)
        chips = forces[now] / stiffness
        draw_cutter_chips(ax, angles, chips, mill.diameter / 2, magnified, mill.tooth_feed)
        ax.set_title(f"{forces[now].max():.0f} N", loc="center")


def draw_cutter_chips(
    ax: Axes, angle: ArrayLike, thickness: ArrayLike, radius: float, magnified: float, feed: float
) -> Axes:
    """Draw the chips of all teeth outside of a cutter that turns clockwise, `magnified`; all in m.

    Angles in rad run clockwise from the top, where a tooth enters.  A dashed line shows what the
    `feed` per tooth would give without runout; drawings with the same feed share their scale.
    """
    arc, tall = np.linspace(0, np.pi, 181), magnified * feed
    nominal, dashes = about((0, 0), radius + tall * np.sin(arc), arc), (0, (4, 2))
    ax.plot(*nominal.T, color="0.35", linewidth=1.0, linestyle=dashes)
    words = {"ha": "center", "va": "center", "fontsize": "small", "zorder": 5}
    ax.text(0, 0, f"{magnified:g}×", **words)
    half = min(0.13, 0.35 * np.pi / len(angle))
    for i, (at, chip) in enumerate(zip(angle, thickness, strict=True)):
        across = np.linspace(at - half, at + half, 9)
        inner, outer = (about((0, 0), r, across) for r in (radius, radius + magnified * chip))
        if chip > 0:
            sliver = [*inner, *outer[::-1]]
            ax.add_patch(Polygon(sliver, facecolor="C0", edgecolor="black", zorder=2))
        edge = about((0, 0), [0.86 * radius, radius], at)
        ax.plot(*edge.T, color="black", linestyle="-", zorder=4)
        ax.text(*about((0, 0), 0.68 * radius, at), f"{i + 1}", **words)
    body = {"facecolor": "0.88", "edgecolor": "0.3", "linewidth": 1.0, "zorder": 3}
    ax.add_patch(Circle((0, 0), radius, **body))
    high = radius + 0.8 * tall
    ax.set(xlim=(-1.05 * radius, radius + 1.35 * tall), ylim=(-high, high))
    ax.set_aspect("equal")
    ax.set_axis_off()
    return ax
