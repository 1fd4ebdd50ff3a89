"""Plots of results: every function takes an axes, draws and returns it, and never shows."""

from collections.abc import Mapping, Sequence
from importlib import resources

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import ArrayLike
from pandas.io.formats.style import Styler

from rcbook.loops.run import Run
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
AXES = {
    "time": "time (s)",
    "turns": "revolutions",
    "force": "force (N)",
    "torque": "torque (N m)",
    "current": "current (A)",
    "speed": "speed (rad/s)",
    "along": "distance along the feed (mm)",
    "height": "height (µm)",
    "real": "real part",
    "imaginary": "imaginary part",
}
GREY = "0.55"
MILLI, MICRO = 1e3, 1e6  # from m to what is plotted


def use_style() -> None:
    """Switch Matplotlib to the style of the book."""
    plt.style.use(resources.files("rcbook.pictures").joinpath("rcbook.mplstyle"))


def draw_signal(ax: Axes, run: Run, name: str = "output", label: str | None = None, **line) -> Axes:
    """One signal of a run against time in s; commands are drawn held, as a machine gets them."""
    held = {"drawstyle": "steps-post"} if name in ("command", "repetitive", "disturbance") else {}
    ax.plot(run.time, getattr(run, name), label=label or LABELS[name], **{**held, **line})
    ax.set_xlabel(AXES["time"])
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
    top.set_xlabel(AXES["turns"])
    return ax


def draw_unit_circle(ax: Axes) -> Axes:
    """The unit circle of the z plane with its axes, equal scales."""
    angle = np.linspace(0, 2 * np.pi, 361)
    ax.plot(np.cos(angle), np.sin(angle), color=GREY, linewidth=1, linestyle="-")
    return _complex_plane(ax, " of $z$")


def draw_unit_disc(ax: Axes) -> Axes:
    """The disc of radius one about 1, inside which G H must lie for passes to contract."""
    ax.add_patch(plt.Circle((1, 0), 1, facecolor="0.93", edgecolor=GREY, zorder=0))
    return _complex_plane(ax)


def _complex_plane(ax: Axes, of: str = "") -> Axes:
    for draw_axis in (ax.axhline, ax.axvline):
        draw_axis(0, color="0.8", linewidth=0.8, linestyle="-", zorder=0)
    ax.set_aspect("equal")
    ax.set(xlabel=AXES["real"] + of, ylabel=AXES["imaginary"] + of)
    return ax


def draw_poles_zeros(ax: Axes, plant: Plant, label: str = "", color: str = "black") -> Axes:
    """Poles as crosses and zeros as open circles in the z plane."""
    style = {"color": color, "fillstyle": "none"}
    for roots, marker, what in ((plant.poles, "x", "poles"), (plant.zeros, "o", "zeros")):
        ax.plot(np.real(roots), np.imag(roots), marker, label=f"{label} {what}", **style)
    return ax


def draw_locus(ax: Axes, loci: Sequence[ArrayLike], label: str = "") -> Axes:
    """Root loci in the z plane: one row of `loci` per gain, one column per branch."""
    roots = np.ravel(loci)
    ax.plot(np.real(roots), np.imag(roots), ".", markersize=2, label=label)
    return ax


def bare_polar(ax: Axes, spokes: Mapping[str, float], rings: Sequence[float] = ()) -> None:
    """Leave of polar axes only named spokes at angles in rad, and rings without numbers."""
    ax.set_xticks(list(spokes.values()), list(spokes))
    ax.set_yticks(rings, [""] * len(rings))
    ax.spines["polar"].set_visible(False)
    ax.spines["inner"].set_linewidth(0)  # drawing makes it visible again


def draw_lines(ax: Axes, x: ArrayLike, lines: Mapping[str, ArrayLike], **settings) -> Axes:
    """Plot curves over the same x, each under its label; the settings are those of `Axes.set`."""
    for label, y in lines.items():
        ax.plot(x, y, label=label)
    ax.set(**settings)
    return ax


def table(rows: Mapping[str, Mapping], decimals: int = 1) -> Styler:
    """Named rows as a table with so many decimals, and a dash for what does not exist."""
    return pd.DataFrame(rows).T.style.format(precision=decimals, na_rep="–")
