"""Where a condition on a loop is first met."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, minimize_scalar

from rcbook import zdomain
from rcbook.loops.periodic.loop import PeriodicLoop, factor
from rcbook.loops.periodic.plant import balanced, positive_intervals


def first_crossing(
    function: Callable[[float], float], edges: Sequence[float], precision: float = 1e-7
) -> float:
    """Where `function` first reaches zero from below: searched from edge to edge, then a root.

    It is the first edge where the function is not below zero there, and infinite where it stays
    below at all of them; what happens between two edges can be missed.
    Raises ValueError for fewer than two edges or edges that do not ascend.
    """
    if len(edges) < 2 or not np.all(np.diff(edges) > 0):
        raise ValueError(f"edges = {list(edges)}: give two or more, in ascending order")
    if function(edges[0]) >= 0:
        return float(edges[0])
    for low, high in pairwise(edges):
        if function(high) >= 0:
            return float(brentq(function, low, high, xtol=precision))
    return np.inf


def gain_limit(loop: PeriodicLoop) -> float:
    """Largest gain k with |1 - k g| <= 1 on the unit circle, for the compensated plant g frozen.

    At constant intervals and without q a loop below it is stable whatever its period.  It is 0
    where the real part of g is not positive at some frequency.
    """
    unit, angles = replace(loop, gain=1.0, memory=None), np.linspace(0, np.pi, 721)

    def bearable(angle: ArrayLike) -> np.ndarray:
        g = 1 - factor(unit, np.exp(1j * np.atleast_1d(angle)))
        return (2 * g.real / np.abs(g) ** 2).min(axis=0)

    coarse = bearable(angles)
    worst = angles[np.argmin(coarse)]
    bounds = (max(worst - angles[2], 0), min(worst + angles[2], np.pi))
    found = minimize_scalar(
        lambda angle: bearable(angle)[0], bounds=bounds, method="bounded", options={"xatol": 1e-12}
    )
    return float(max(min(found.fun, coarse.min()), 0.0))


def vanishing_intervals(system: control.StateSpace, intervals: ArrayLike) -> list[float]:
    """Intervals in s at which a zero of the sampled plant passes -1: no gain is left at Nyquist.

    Searched for between neighbours in a row of ascending intervals, as roots.
    Raises ValueError for intervals that are not positive.
    """
    intervals, scaled = positive_intervals(intervals), balanced(system)

    def at_nyquist(interval: float) -> float:
        b = zdomain.zero_order_hold(scaled, interval).b
        return float(zdomain.evaluate(b, -1.0).real / np.abs(b).sum())

    signs = np.sign([at_nyquist(interval) for interval in intervals])
    turns = np.flatnonzero(np.diff(signs))
    return [float(brentq(at_nyquist, *intervals[i : i + 2])) for i in turns]
