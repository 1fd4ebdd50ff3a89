"""How much later, stronger or longer things may be before a loop is lost.

A loop d + n = 0 with n/d its open loop is stable up to the first extra delay, or factor, at which
n/d meets -1.  Where a crossing lies on the unit circle is found on a grid and bisected; the grid
is fine near the poles of the controller, which are near the circle.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rcbook import zdomain
from rcbook.loops.learning import Scheme
from rcbook.loops.repetitive import Loop, transfer

_FINE = 64  # points of the half circle for each power of the open loop


def _crossings(function: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
    """Angles at which a function of the angle changes its sign, bisected to rounding."""
    sign = np.sign(function(at))
    turns = np.flatnonzero(sign[1:] * sign[:-1] < 0)
    low, high, left = at[turns], at[turns + 1], sign[turns]
    for _ in range(45):
        middle = (low + high) / 2
        same = np.sign(function(middle)) == left
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return (low + high) / 2


def _angles(loop: Loop) -> np.ndarray:
    """Angles of the upper half circle, dense near the poles of the open loop that lie near it."""
    d, n = loop.open_polynomials
    even = np.linspace(0, np.pi, _FINE * max(d.size, n.size) + 1)[1:]
    poles = np.roots(np.trim_zeros(loop.parts[1], "b"))
    near = np.angle(poles[(np.abs(poles) > 0.9) & (poles.imag >= 0)])
    away = np.geomspace(1e-6, 0.1, 60)
    close = (near[:, None] + np.concatenate([-away, away])).ravel()
    return np.unique(np.concatenate([even, close[(close > 0) & (close <= np.pi)]]))


def _open(loop: Loop, angle: np.ndarray) -> np.ndarray:
    d, n = loop.open_polynomials
    z = np.exp(1j * angle)
    return zdomain.evaluate(n, z) / zdomain.evaluate(d, z)


def is_stable(loop: Loop) -> bool:
    """Whether all roots of a loop lie inside the unit circle by more than 1e-9."""
    return bool(np.abs(loop.roots).max(initial=0.0) < 1 - 1e-9)


def noise_gain(loop: Loop) -> float:
    """`repetitive.noise_gain` from sensor to output, infinite for a loop that is not stable."""
    if not is_stable(loop):
        return np.inf
    largest = float(np.abs(loop.roots).max(initial=0.0))
    return zdomain.rms_gain(*transfer(loop, "noise", "output"), largest)


def delay_margin(loop: Loop) -> float:
    """Samples, whole or not, by which the controller may be later before the loop is lost.

    From the phase at every crossing of |open loop| = 1; exact where the margin is whole, and
    between the samples for a delay of e^(-j w) a sample.  0 for a loop that is not stable, and
    infinite without a crossing.
    """
    if not is_stable(loop):
        return 0.0
    d, n = loop.open_polynomials

    def excess(angle: np.ndarray) -> np.ndarray:
        z = np.exp(1j * angle)
        return np.abs(zdomain.evaluate(n, z)) - np.abs(zdomain.evaluate(d, z))

    at = _crossings(excess, _angles(loop))
    phase = np.mod(np.angle(_open(loop, at)) + np.pi, 2 * np.pi)
    return float((phase / at).min(initial=np.inf))


def gain_margin(loop: Loop) -> float:
    """Factor by which the open loop may grow before the loop is lost; infinite if by any.

    0 for a loop that is not stable.
    """
    if not is_stable(loop):
        return 0.0
    angles = _angles(loop)
    at = np.append(_crossings(lambda a: _open(loop, a).imag, angles), [0.0, np.pi])
    with np.errstate(divide="ignore", invalid="ignore"):
        value = _open(loop, at)
    # Between neighbours of the grid the sign of the imaginary part also changes at a pole.
    real = np.isfinite(value) & (np.abs(value.imag) < 1e-6 * np.abs(value))
    factors = -1 / value[real].real
    return float(factors[factors > 1].min(initial=np.inf))


def pass_delay_margin(scheme: Scheme) -> float:
    """Samples by which the plant may be later than its law thinks before passes diverge.

    Of passes that repeat for ever: |q (1 - G H e^(-j w delay))| < 1 at every harmonic.
    """
    z = zdomain.unit_circle(scheme.period)[1 : scheme.period // 2 + 1]
    q, g = _of_scheme(scheme, z)
    with np.errstate(divide="ignore"):
        cosine = (1 + np.abs(g) ** 2 - 1 / np.abs(q) ** 2) / (2 * np.abs(g))
    limited = cosine > -1
    phase = np.arccos(np.minimum(cosine[limited], 1)) + np.angle(g[limited])
    return float((np.maximum(phase, 0) / np.angle(z[limited])).min(initial=np.inf))


def pass_gain_margin(scheme: Scheme) -> float:
    """Factor by which the plant may be stronger before passes that repeat for ever diverge."""
    q, g = _of_scheme(scheme, zdomain.unit_circle(scheme.period)[: scheme.period // 2 + 1])
    with np.errstate(divide="ignore"):
        room = g.real**2 + np.abs(g) ** 2 * (1 / np.abs(q) ** 2 - 1)
    return float(((g.real + np.sqrt(np.maximum(room, 0))) / np.abs(g) ** 2).min())


def _of_scheme(scheme: Scheme, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """q and G H at points z; what is stopped altogether counts as almost stopped."""
    g = zdomain.response(scheme.plant, z) * zdomain.response(scheme.law.filter, z)
    q = scheme.controller.memory.gain(z)
    return np.where(np.abs(q) < 1e-12, 1e-12, q), np.where(np.abs(g) < 1e-12, 1e-12, g)
