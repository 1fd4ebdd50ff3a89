"""How much later, stronger or longer things may be before a loop is lost.

A loop d + n = 0 with n/d its open loop is stable up to the first extra delay at which n/d meets -1.
Where |n/d| crosses one is found on a grid that is fine near the poles of the controller, which are
near the circle.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize.elementwise import find_root

from rcbook import zdomain
from rcbook.loops import repetitive
from rcbook.loops.learning import Scheme
from rcbook.loops.repetitive import Loop
from rcbook.loops.verdict import MARGIN

_FINE = 64  # points of the half circle for each power of the open loop


def _crossings(function: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
    """Angles at which a function of the angle changes its sign between neighbours of a grid."""
    sign = np.sign(function(at))
    turns = np.flatnonzero(sign[1:] * sign[:-1] < 0)
    return find_root(function, (at[turns], at[turns + 1])).x


def _angles(loop: Loop) -> np.ndarray:
    """Angles of the upper half circle, dense near the poles of the open loop that lie near it."""
    d, n = loop.open_polynomials
    even = np.linspace(0, np.pi, _FINE * max(d.size, n.size) + 1)[1:]
    poles = np.roots(np.trim_zeros(loop.parts[1], "b"))
    near = np.angle(poles[(np.abs(poles) > 0.9) & (poles.imag >= 0)])
    away = np.geomspace(1e-6, 0.1, 60)
    close = (near[:, None] + np.concatenate([-away, away])).ravel()
    return np.unique(np.concatenate([even, close[(close > 0) & (close <= np.pi)]]))


def is_stable(loop: Loop) -> bool:
    """Whether all roots of a loop lie inside the unit circle, by more than rounding."""
    return bool(np.abs(loop.roots).max(initial=0.0) < 1 - MARGIN)


def noise_gain(loop: Loop) -> float:
    """`repetitive.noise_gain` from sensor to output, infinite for a loop that is not stable."""
    return repetitive.noise_gain(loop) if is_stable(loop) else np.inf


def delay_margin(loop: Loop) -> float:
    """Samples, whole or not, by which the controller may be later before the loop is lost.

    From the phase at every crossing of |open loop| = 1; exact where the margin is whole, and
    between the samples for a delay of e^(-j w) a sample.  0 for a loop that is not stable, and
    infinite without a crossing.
    """
    if not is_stable(loop):
        return 0.0

    def parts(angle: np.ndarray) -> list[np.ndarray]:
        return [zdomain.evaluate(p, np.exp(1j * angle)) for p in loop.open_polynomials]

    def deficit(angle: np.ndarray) -> np.ndarray:
        return np.subtract(*np.abs(parts(angle)))

    at = _crossings(deficit, _angles(loop))
    d, n = parts(at)
    phase = np.mod(np.angle(n / d) + np.pi, 2 * np.pi)
    return float((phase / at).min(initial=np.inf))


def gain_margin(loop: Loop, strongest: float = 100.0) -> float:
    """Factor by which the open loop may grow before the loop is lost; infinite beyond `strongest`.

    The end of the stable gains around that of the loop; 0 for a loop that is not stable.
    """
    gain = loop.require_controller().gain
    for low, high in repetitive.stable_gains(loop, strongest * gain):
        if low < gain < high:
            return high / gain if high < strongest * gain else np.inf
    return 0.0


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
