"""Where a condition on a loop is first met."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, minimize_scalar

from rcbook import zdomain
from rcbook.loops.memory import gain_bound
from rcbook.loops.periodic.loop import PeriodicLoop, factor
from rcbook.loops.periodic.plant import balanced, positive_intervals

if TYPE_CHECKING:  # what takes a second to import is imported where it is used
    import control


def frozen_gain_bound(loop: PeriodicLoop) -> float:
    """Largest gain k with |1 - k g| <= 1 on the unit circle, for the compensated plant g frozen.

    At constant intervals and without q a loop below it is stable whatever its period.  It is 0
    where the real part of g is not positive at some frequency.
    """
    unit, angles = replace(loop, gain=1.0, memory=None), np.linspace(0, np.pi, 721)

    def bearable(angle: ArrayLike) -> np.ndarray:
        return gain_bound(1 - factor(unit, np.exp(1j * np.atleast_1d(angle))))

    coarse = bearable(angles)
    worst = angles[np.argmin(coarse)]
    bounds = (max(worst - angles[2], 0), min(worst + angles[2], np.pi))
    found = minimize_scalar(
        lambda angle: bearable(angle)[0], bounds=bounds, method="bounded", options={"xatol": 1e-12}
    )
    return float(min(found.fun, coarse.min()))


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
