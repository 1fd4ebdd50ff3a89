"""What a turn makes of a wave in the surface, and the limit that follows where speeds average out.

A wave with n waves in a turn is met at the frequency n times the speed, and the tool answers with
that frequency: the new surface has n waves in a turn again, K/(m s^2 + c s + k + K) times as high.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.optimize
from numpy.typing import ArrayLike

from rcbook.machines.chatter.constant_speed import least_limit
from rcbook.machines.chatter.cut import Cut, Mode, between, clock

_ANGLES = 256  # of a period of the speed, over which is averaged
_WAVES = 600  # numbers of waves that are tried


def surface_factor(mode: Mode, cutting_stiffness: ArrayLike, frequency: ArrayLike) -> np.ndarray:
    """K/(m s^2 + c s + k + K) at s = j w: the new wave over the one a turn ago, complex.

    `cutting_stiffness` K in N/m and `frequency` w in rad/s broadcast.
    Raises ValueError for a stiffness or frequency that is not positive.
    """
    stiffness = between(cutting_stiffness, "cutting_stiffness", 0.0, np.inf)
    s = 1j * between(frequency, "frequency", 0.0, np.inf)
    return stiffness / (mode.mass * s**2 + mode.damping * s + mode.stiffness + stiffness)


def averaged_limit(cut: Cut) -> np.ndarray:
    """Cutting stiffness (N/m) up to which no wave grows in the mean over a period of the speed.

    The mean is that of log|surface_factor| over equal angles, as if every place of the surface met
    all speeds in turn.  It does not depend on the mean speed nor on rvf, nor on the stiffness that
    the cut has now; the shape is that of the cut.
    """
    each = [_limit(replace(cut.take([i]), rvf=1.0)) for i in range(cut.speed.size)]
    return np.array(each).reshape(cut.shape)


def _limit(cut: Cut) -> float:
    mode, least, rva = cut.mode, least_limit(cut.mode), abs(float(cut.rva[0]))
    angle = 2 * np.pi * (np.arange(_ANGLES) + 0.5) / _ANGLES
    speeds = clock(cut, angle)[1][0] / cut.speed[0]

    def growth(ratio: float) -> float:
        highest = np.sqrt(1 + ratio * least / mode.stiffness) / (1 - rva)
        waves = mode.natural_frequency * np.geomspace(1 / (1 + rva), highest, _WAVES)
        factors = surface_factor(mode, ratio * least, waves[:, None] * speeds)
        return float(np.log(np.abs(factors)).mean(axis=1).max())

    high = 2.0
    while growth(high) < 0:
        high *= 2
    return least * scipy.optimize.brentq(growth, 0.5, high, xtol=1e-6)
