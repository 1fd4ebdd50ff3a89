"""What questions about a repetitive loop cost, beside python-control, a filter and a few lines."""

from __future__ import annotations

import control
import numpy as np
import pytest
import scipy.signal

from rcbook.loops import repetitive
from rcbook.loops.repetitive import Limit, Limits, Loop
from rcbook.zdomain import Plant, binomial_q

PLANTS = {
    2: Plant([0.4, 0.2], [1, -1.2, 0.5], 1, 1e-3),
    6: Plant(
        0.2 * np.poly([1.3, 0.6, 0.4, -0.3, -0.5]),
        np.poly([0.9, 0.7, 0.5, 0.3, -0.2, -0.4]),
        1,
        1e-3,
    ),
}
LIMITS = Limits(Limit(1.3), Limit(1.4))


def loop_of(order: int, period: int, gain: float = 0.7) -> Loop:
    """A plant by itself under a repetitive controller with a q of three taps, plugged in."""
    return repetitive.design(
        PLANTS[order], repetitive.plain(period, binomial_q(1)), gain, form="plug-in"
    )


def signals(period: int) -> tuple[np.ndarray, np.ndarray]:
    """Reference and disturbance, periodic, some 4000 samples."""
    n = max(10000 // period, 4) * period
    t = 2 * np.pi * np.arange(n) / period
    return np.sin(t) + 0.5 * np.sin(2 * t), 0.3 * np.sin(3 * t)


def by_hand(loop: Loop, r: np.ndarray, w: np.ndarray, limits: Limits) -> list[float]:
    """The recursion as one would write it: on lists, and only coefficients that are not 0."""
    plant, rc = loop.process.plant, loop.repetitive
    b, a, num, den = (
        [(i, c) for i, c in enumerate(p.tolist()) if c]
        for p in (plant.numerator, plant.a, rc.numerator, rc.denominator)
    )
    most_u, most_v, before = (
        limits.repetitive.value,
        limits.command.value,
        rc.denominator.size + rc.numerator.size,
    )
    r, w = [0.0] * before + r.tolist(), [0.0] * before + w.tolist()
    y, e, u, x = ([0.0] * len(r) for _ in range(4))
    for k in range(before, len(r)):
        y[k] = sum([c * x[k - i] for i, c in b]) - sum([c * y[k - i] for i, c in a[1:]])
        e[k] = r[k] - y[k]
        asked = sum([c * e[k - i] for i, c in num]) + sum(
            [c * (r[k - i] - u[k - i]) for i, c in den]
        )
        u[k] = max(-most_u, min(most_u, asked / den[0][1]))
        x[k] = max(-most_v, min(most_v, u[k])) + w[k]
    return y[before:]
