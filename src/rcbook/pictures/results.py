"""Drawings of results: every function takes an axes, draws and returns it, and never shows."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from rcbook.loops.run import Run
from rcbook.machines import face_mill
from rcbook.machines.peripheral_mill import PeripheralMill
from rcbook.zdomain import Plant

LABELS = {
    "reference": "reference",
    "disturbance": "runout",
    "output": "force",
    "command": "feed command",
    "repetitive": "repetitive command",
    "error": "error",
    "measured_error": "error seen by the repetitive controller",
}
GREY = "0.55"


def use_style() -> None:
    """Switch Matplotlib to the style of the book."""
    plt.style.use(resources.files("rcbook.pictures").joinpath("rcbook.mplstyle"))


def draw_signal(ax: Axes, run: Run, name: str = "output", label: str | None = None, **line) -> Axes:
    """One signal of a run against time in s; commands are drawn held, as a machine gets them."""
    held = {"drawstyle": "steps-post"} if name in ("command", "repetitive", "disturbance") else {}
    ax.plot(run.time, getattr(run, name), label=label or LABELS[name], **{**held, **line})
    ax.set_xlabel("time (s)")
    ax.margins(x=0)
    return ax


def draw_band(ax: Axes, target: float, band: float, label: str = "") -> Axes:
    """A settling band round a target, and the target as a thin line."""
    ax.axhspan(target - band, target + band, color="0.88", zorder=0, label=label or None)
    ax.axhline(target, color=GREY, linewidth=0.8, linestyle="-", zorder=1)
    return ax


def mark_revolutions(ax: Axes, frequency: float) -> Axes:
    """A second axis on top that counts revolutions at a spindle frequency in Hz."""
    top = ax.secondary_xaxis("top", functions=(lambda t: t * frequency, lambda m: m / frequency))
    top.set_xlabel("revolutions")
    return ax


def draw_cut(axes: Sequence[Axes], run: face_mill.Run, label: str | None = None, **line) -> None:
    """Largest tooth force, torque, current and speed of a milling run on four axes, one for each.

    Revolutions are counted from 0; a thin line marks where the controller sets in.
    """
    quantities = ((run.force, "force (N)"), (run.torque, "torque (N m)"))
    quantities += ((run.current, "current (A)"), (run.speed, "speed (rad/s)"))
    for ax, (values, name) in zip(axes, quantities, strict=True):
        ax.plot(run.turns, values, label=label, **{"linewidth": 0.9, "linestyle": "-", **line})
        ax.axvline(run.experiment.controlled - 1, color=GREY, linewidth=0.8, linestyle=":")
        ax.set_ylabel(name)
        ax.margins(x=0)
    axes[-1].set_xlabel("revolutions of the cutter")


def draw_waviness(ax: Axes, mill: PeripheralMill, eccentricity: float, turns: int = 3) -> Axes:
    """Plot the profile that the teeth of a cutter leave when it runs out by `eccentricity` in m.

    Each tooth leaves an arc of its own radius, `radius + eccentricity cos(2 pi i / flutes)`, and
    the deepest arc remains; feed is drawn in mm, height in micrometres.

    Raises ValueError when the arcs are too short for the length drawn.
    """
    radius, flutes = mill.cutter_diameter / 2, mill.flutes
    feed_per_turn = mill.feed_speed / mill.spindle_frequency
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


def draw_unit_circle(ax: Axes) -> Axes:
    """The unit circle of the z plane with its axes, equal scales."""
    angle = np.linspace(0, 2 * np.pi, 361)
    ax.plot(np.cos(angle), np.sin(angle), color=GREY, linewidth=1, linestyle="-")
    return _complex_plane(ax, " of $z$")


def draw_poles_zeros(ax: Axes, plant: Plant, label: str = "", color: str = "black") -> Axes:
    """Poles as crosses and zeros as open circles in the z plane."""
    for roots, marker, what in ((plant.poles, "x", "poles"), (plant.zeros, "o", "zeros")):
        roots = np.asarray(roots, dtype=complex)
        ax.plot(
            roots.real, roots.imag, marker, color=color, fillstyle="none", label=f"{label} {what}"
        )
    return ax


def draw_locus(ax: Axes, loci: ArrayLike, label: str = "") -> Axes:
    """Root loci in the z plane: one row of `loci` per gain, one column per branch."""
    loci = np.array([np.asarray(roots, dtype=complex) for roots in loci])
    ax.plot(loci.real.ravel(), loci.imag.ravel(), ".", markersize=2, label=label)
    return ax


def draw_unit_disc(ax: Axes) -> Axes:
    """The disc of radius one about 1, inside which G H must lie for passes to contract."""
    ax.add_patch(plt.Circle((1, 0), 1, facecolor="0.93", edgecolor=GREY, zorder=0))
    return _complex_plane(ax)


def _complex_plane(ax: Axes, of: str = "") -> Axes:
    ax.axhline(0, color="0.8", linewidth=0.8, linestyle="-", zorder=0)
    ax.axvline(0, color="0.8", linewidth=0.8, linestyle="-", zorder=0)
    ax.set_aspect("equal")
    ax.set_xlabel(f"real part{of}")
    ax.set_ylabel(f"imaginary part{of}")
    return ax


def draw_section(
    ax: Axes, angle: ArrayLike, radius: ArrayLike, error: ArrayLike, magnified: float, label: str
) -> Axes:
    """One turn of a section in polar form (`ax` is polar), its error magnified along the radius."""
    angle, drawn = np.asarray(angle), np.asarray(radius) - magnified * np.asarray(error)
    ax.plot(np.append(angle, angle[0]), np.append(drawn, drawn[0]), label=label)
    ax.set_xticks([])
    ax.set_yticks([])
    ax.grid(False)
    ax.spines["polar"].set_visible(False)
    return ax


def draw_teeth(
    ax: Axes, values: ArrayLike, reference: float, label: str = "", outlined: bool = False
) -> Axes:
    """One bar per tooth, from the hub of a cutter (`ax` is polar), and the reference dashed.

    Tooth 1 is at the top and the others follow anticlockwise, as they pass on a cutter that turns
    clockwise.  Bars are broad and grey, or narrow and `outlined` to go over the broad ones.
    """
    values = np.asarray(values, dtype=float)
    angle = 2 * np.pi * np.arange(values.size) / values.size
    broad = {"color": "0.80", "width": 0.84, "zorder": 2}
    narrow = {"fill": False, "edgecolor": "black", "linewidth": 1.4, "width": 0.5, "zorder": 3}
    style = narrow if outlined else broad
    ax.bar(angle, values, label=label or None, **{**style, "width": style["width"] * angle[1]})
    turn = np.linspace(0, 2 * np.pi, 361)
    ax.plot(turn, 0 * turn, color="0.3", linewidth=1.0, linestyle="-", zorder=3)
    circle = {"color": "C1", "linewidth": 1.3, "linestyle": (0, (4, 2)), "zorder": 4}
    named = None if outlined else f"nominal, {reference:.3g} N"
    ax.plot(turn, 0 * turn + reference, label=named, **circle)
    ax.set_theta_zero_location("N")
    ax.set_xticks(angle, [f"{i + 1}" for i in range(values.size)])
    ax.set_yticks([])
    ax.set_rmin(0)
    ax.set_rorigin(-0.4 * reference)  # a hub, so that the bars do not crowd in the middle
    ax.xaxis.grid(False)
    ax.spines["polar"].set_visible(False)
    return ax


def draw_cutter_chips(
    ax: Axes,
    angle: ArrayLike,
    thickness: ArrayLike,
    radius: float,
    magnified: float,
    feed: float | None = None,
    numbered: bool = True,
) -> Axes:
    """The chips of all teeth now, as slivers outside of a cutter that turns clockwise; all in m.

    Their thickness is `magnified`, which the cutter says in its middle.  Angles in rad run
    clockwise from the top, where a tooth enters.  A dashed line shows `feed` times the sine of the
    angle, what the feed per tooth would give without runout; with it, drawings share their scale.
    """
    angle, thickness = np.asarray(angle, dtype=float), np.asarray(thickness, dtype=float)
    cutting = np.linspace(0, np.pi, 181)
    if feed is not None:
        nominal = radius + magnified * feed * np.sin(cutting)
        style = {"linewidth": 1.0, "linestyle": (0, (4, 2))}
        ax.plot(*_clock(nominal, cutting), color="0.35", **style)
        tall = radius + 0.8 * magnified * feed
        ax.set(xlim=(-1.05 * radius, radius + 1.35 * magnified * feed), ylim=(-tall, tall))
    words = {"ha": "center", "va": "center", "fontsize": "small", "zorder": 5}
    ax.text(0, 0, f"{magnified:g}×", **words)
    half = min(0.13, 0.35 * np.pi / angle.size)
    for i, (at, chip) in enumerate(zip(angle, thickness, strict=True)):
        across = np.linspace(at - half, at + half, 9)
        sliver = [*_clock(radius, across).T, *_clock(radius + magnified * chip, across[::-1]).T]
        if chip > 0:
            ax.add_patch(plt.Polygon(sliver, facecolor="C0", edgecolor="black", zorder=2))
        ax.plot(*_clock(np.array([0.86, 1.0]) * radius, at), color="black", linestyle="-", zorder=4)
        if numbered:
            ax.text(*_clock(0.68 * radius, at), f"{i + 1}", **words)
    body = {"facecolor": "0.88", "edgecolor": "0.3", "linewidth": 1.0, "zorder": 3}
    ax.add_patch(plt.Circle((0, 0), radius, **body))
    ax.set_aspect("equal")
    ax.set_axis_off()
    return ax


def _clock(radius: ArrayLike, angle: ArrayLike) -> np.ndarray:
    """Points at angles clockwise from the top, coordinates on the first axis."""
    return np.stack(np.broadcast_arrays(radius * np.sin(angle), radius * np.cos(angle)))


def draw_bore(
    ax: Axes,
    angle: ArrayLike,
    desired: ArrayLike,
    error: ArrayLike,
    magnified: float = 1.0,
    label: str = "",
    reach: float | None = None,
    **line,
) -> Axes:
    """The wall of a bore about its nominal circle (`ax` is polar), as a roundness chart shows it.

    `desired` is the deviation from the dashed circle, `error` what the cut lacks of it, magnified
    once more; all in m, drawn in µm.  Angles in rad run anticlockwise from the top, over one turn
    or several.  Drawings with the same `reach`, the largest deviation with room, share their scale.
    """
    angle, desired = np.asarray(angle, dtype=float), 1e6 * np.asarray(desired, dtype=float)
    cut = desired - magnified * 1e6 * np.asarray(error, dtype=float)
    largest = 1.2 * np.abs([desired, cut]).max() if reach is None else 1e6 * reach
    if ax.lines:  # another cut of the same bore
        largest = max(largest, ax.get_rmax())
    else:
        ring = max(s * 10.0**n for n in range(-4, 5) for s in (1, 2, 5) if s * 10.0**n < largest)
        _draw_bore_frame(ax, ring, magnified)
        broad = {"color": "0.75", "linewidth": 4.5, "linestyle": "-", "zorder": 2}
        ax.plot(_closed(angle), _closed(desired), label="desired", **broad)
        ax.set_prop_cycle(None)  # so that the cut has the first colour
    ax.plot(_closed(angle), _closed(cut), label=label or None, **{"linewidth": 1.1, **line})
    ax.set_rlim(-largest, largest)
    ax.set_rorigin(-3 * largest)  # the bore itself is far larger
    return ax


def _draw_bore_frame(ax: Axes, ring: float, magnified: float) -> None:
    """Nominal circle, a ring on either side of it, and in the middle how far these are, in µm."""
    turn = np.linspace(0, 2 * np.pi, 361)
    ax.plot(turn, 0 * turn, color="0.35", linewidth=0.9, linestyle=(0, (4, 3)), zorder=1.5)
    words = f"rings\n±{ring:g} µm" + (f"\nerror {magnified:g}×" if magnified != 1 else "")
    ax.text(0.5, 0.5, words, ha="center", va="center", transform=ax.transAxes)
    ax.set_theta_zero_location("N")
    ax.set_xticks(np.pi / 2 * np.arange(4), ["0°", "90°", "180°", "270°"])
    ax.set_yticks([-ring, ring], [])
    ax.spines["polar"].set_visible(False)
    ax.spines["inner"].set_linewidth(0)  # drawing makes it visible again


def _closed(values: np.ndarray) -> np.ndarray:
    """The values and the first one again."""
    return np.append(values, values[0])
