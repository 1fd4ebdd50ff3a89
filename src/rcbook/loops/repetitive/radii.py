"""Spectral radii at many gains: what one needs is the outermost root, and that there is no other.

Round a memory H = z^-L T the roots of 1 - H (1 - k C G) are those of L ln z = ln M(z) + 2 pi i j,
M = T (1 - k C G), one to an integer j and each by itself; what C cancels and the poles that are
left stand apart.  That none is missing is not believed but counted, on a circle inside of the
outermost, for all gains at once; where the count differs, all roots are computed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rcbook.loops.memory import RepetitiveController
from rcbook.loops.repetitive.loop import Loop
from rcbook.signals import signal
from rcbook.zdomain import evaluate, multiply, sorted_roots
from rcbook.zdomain.crossings import crossings, outside

SHORT = 60  # coefficients: all roots of as many are as quick
_TOGETHER = 4096  # roots: what they need stays in the cache


def spectral_radii(loop: Loop, gains: ArrayLike) -> np.ndarray:
    """Largest growth of a mode over one period at each repetitive gain, an array of their shape.

    Raises ValueError when the loop has no repetitive controller, and for gains not positive.
    """
    controller, shape = loop.require_controller(), np.shape(gains)
    gains = signal(np.ravel(gains), "gains")
    if not np.all(gains > 0):
        raise ValueError(f"gains hold {gains.min():g}; give positive ones")
    d, n = loop.with_gain(1.0).open_polynomials
    length = max(d.size, n.size)
    d, n = (np.pad(p, (0, length - p.size)) for p in (d, n))
    radii = np.full(gains.size, np.nan)
    one = isinstance(controller, RepetitiveController)
    if one and length > SHORT and controller.memory.taps.size < controller.memory.first:
        radii = _certain(d, n, gains, _candidates(loop, gains))
    for i in np.flatnonzero(np.isnan(radii)):
        radii[i] = np.abs(sorted_roots(d + gains[i] * n)).max(initial=0.0)
    with np.errstate(over="ignore"):
        return (radii**loop.period).reshape(shape)


def _candidates(loop: Loop, gains: np.ndarray) -> np.ndarray:
    """ln z of roots at each gain, (gains, candidates), none twice and none below the real axis."""
    path, controller = loop.process.command_path, loop.repetitive
    memory, comp = controller.memory, controller.compensator
    a, b = multiply(path.a, comp.a), multiply(path.numerator, comp.b)
    # As z goes round the upper half, the other factors turn by no more than so many halves.
    extra = (a.size + b.size + memory.taps.size) // 2
    turns = 2j * np.pi * np.arange(-extra, memory.first // 2 + extra + 1)
    at = (turns + 1e-3) / memory.first  # beside the circle, where a pole may be
    taps = evaluate(memory.taps, np.exp(at))
    compensated = np.exp(comp.advance * at) * evaluate(b, np.exp(at)) / evaluate(a, np.exp(at))
    poles = np.roots(np.trim_zeros(a, "b"))
    scale = evaluate(np.abs(b), np.abs(poles))
    poles = poles[np.abs(evaluate(b, poles)) < 1e-12 * scale]
    cancelled = np.log(poles[poles.imag >= 0].astype(complex))
    found = []
    for k in np.array_split(gains[:, None], -(-gains.size * at.size // _TOGETHER)):
        around = taps * (1 - k * compensated)
        start = np.log(np.maximum(np.abs(around), 1e-300)) + 1j * np.unwrap(np.angle(around))
        start = (turns + start) / memory.first
        upper = np.abs(start.imag - np.pi / 2) < np.pi / 2 + 6 / memory.first
        roots = np.full(start.shape, complex(np.nan, np.nan))
        each = np.broadcast_to(k, start.shape)[upper]
        roots[upper] = _newton((a, b, memory.taps), comp.advance, memory.first, each, start[upper])
        roots = np.hstack([roots, np.broadcast_to(cancelled, (k.size, cancelled.size))])
        found.append(_distinct(roots, 1e-6 / memory.first))
    return np.concatenate(found)


def _newton(
    polynomials: Sequence[np.ndarray], advance: int, first: int, k: np.ndarray, s: np.ndarray
) -> np.ndarray:
    """Roots z = e^s of a = z^-first taps (a - k z^advance b), NaN where there is none near."""
    with np.errstate(all="ignore"):
        for _ in range(4):
            (a, b, taps), slopes = zip(*(_along(p, np.exp(-s)) for p in polynomials), strict=True)
            ahead = k * np.exp(advance * s)
            rest = a - ahead * b
            rest_slope = slopes[0] - ahead * (advance * b + slopes[1])
            off = np.log(np.exp(-first * s) * taps * rest / a)
            move = off / (slopes[2] / taps + rest_slope / rest - slopes[0] / a - first)
            s = s - move
        return np.where(np.abs(move) < 1e-11, s, np.nan)


def _along(p: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """p at x = e^-s, and its derivative by s, for a short p."""
    value, slope = np.full((2, *x.shape), p[-1] + 0j)
    slope *= p.size - 1
    for lag in range(p.size - 2, -1, -1):
        value = value * x + p[lag]
        slope = slope * x + lag * p[lag]
    return value, -slope


def _distinct(s: np.ndarray, apart: float) -> np.ndarray:
    angle = np.abs(np.angle(np.exp(1j * s.imag)))
    s = np.sort(angle + 1j * s.real, axis=1)  # by angle; NaN last
    s = s.imag + 1j * s.real
    for step in (1, 2, 3):
        s[:, step:][np.abs(s[:, step:] - s[:, :-step]) < apart] = np.nan
    return s


def _certain(d: np.ndarray, n: np.ndarray, gains: np.ndarray, roots: np.ndarray) -> np.ndarray:
    """Largest magnitudes, NaN where more roots lie outside of a circle than were found."""
    size = np.fmax.reduce(roots.real, axis=1, initial=-np.inf)
    weight = np.where((roots.imag < 1e-9) | (roots.imag > np.pi - 1e-9), 1, 2)
    radii = np.full(gains.size, np.nan)
    for groups in (1, 3, 9)[: gains.size]:
        left = np.flatnonzero(np.isnan(radii) & np.isfinite(size))
        if not left.size:
            break
        for some in np.array_split(left[np.argsort(size[left])], min(groups, left.size)):
            level = size[some[0]] - 1e-4 / d.size
            found = np.sum(weight[some] * (roots[some].real > level), axis=1)
            right = some[found == _outside(d, n, level, gains[some])]
            radii[right] = np.exp(size[right])
    return radii


def _outside(d: np.ndarray, n: np.ndarray, level: float, gains: np.ndarray) -> np.ndarray:
    """How many roots lie outside of the circle of radius e^level at each gain; -1 if on it."""
    powers = np.arange(d.size) - (d.size if level < 0 else 0)  # so none overflows
    d, n = (p * np.exp(-level * powers) for p in (d, n))
    edges, more = crossings(d, n, 8)
    ends = np.concatenate([[0.0], edges[(edges > 0) & (edges < gains.max())], [2 * gains.max()]])
    widest = np.argmax(np.diff(ends))
    known = ends[widest : widest + 2].mean()
    total = np.append(0, np.cumsum(more))
    try:
        total += outside(d + known * n, 1.0) - total[np.searchsorted(edges, known)]
    except ZeroDivisionError:
        return np.full(gains.size, -1)
    return total[np.searchsorted(edges, gains)]
