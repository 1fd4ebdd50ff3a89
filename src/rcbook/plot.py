"""Drawings of results: every function takes an axes, draws and returns it, and never shows."""

from __future__ import annotations

from importlib import resources

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from rcbook.repetitive import Run
from rcbook.zdomain import Plant

LABELS = {
    "reference": "reference",
    "disturbance": "runout",
    "output": "force",
    "command": "feed command",
    "repetitive": "repetitive command",
    "error": "error seen by the repetitive controller",
    "inner_error": "error seen by the PI controller",
}
GREY = "0.55"


def use_style() -> None:
    """Switch Matplotlib to the style of the book."""
    plt.style.use(resources.files("rcbook").joinpath("rcbook.mplstyle"))


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


def draw_unit_circle(ax: Axes) -> Axes:
    """The unit circle of the z plane with its axes, equal scales."""
    angle = np.linspace(0, 2 * np.pi, 361)
    ax.plot(np.cos(angle), np.sin(angle), color=GREY, linewidth=1, linestyle="-")
    ax.axhline(0, color="0.8", linewidth=0.8, linestyle="-", zorder=0)
    ax.axvline(0, color="0.8", linewidth=0.8, linestyle="-", zorder=0)
    ax.set_aspect("equal")
    ax.set_xlabel("real part of $z$")
    ax.set_ylabel("imaginary part of $z$")
    return ax


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
    ax.axhline(0, color="0.8", linewidth=0.8, linestyle="-", zorder=0)
    ax.axvline(0, color="0.8", linewidth=0.8, linestyle="-", zorder=0)
    ax.set_aspect("equal")
    ax.set_xlabel("real part")
    ax.set_ylabel("imaginary part")
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
