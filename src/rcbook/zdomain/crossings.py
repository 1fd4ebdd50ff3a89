"""At which gains roots of d + k n cross the unit circle, and how many lie outside of it.

d and n are polynomials in z^-1, as long as the period and for the most part zero, and k > 0 is the
gain.  A root lies at z for the gain -d(z)/n(z), so the circle is crossed where that is real.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize.elementwise import find_root

_POINTS = 8  # on the upper half of the circle, times the degree: 16 in a turn of the longest delay


def along(p: np.ndarray, exponent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """p(z^-1) at z = e^exponent, and its derivative by the exponent."""
    value, slope = np.zeros((2, *exponent.shape), dtype=complex)
    for lag in np.flatnonzero(p):
        term = p[lag] * np.exp(-lag * exponent)
        value += term
        slope -= lag * term
    return value, slope


def outside(polynomial: np.ndarray, radius: float) -> int:
    """Roots of p(z^-1) outside of a circle, from its turns along the upper half.

    A step is halved until the logarithmic derivative says that it turns by less than 1 rad: an
    angle alone would not tell the whole turn next to a double root from none.
    Raises ZeroDivisionError where p is nothing but rounding.
    """
    # as far as z^-lag is known, whose angle is rounded
    floor = np.finfo(float).eps * np.abs(polynomial) @ (8 + np.arange(polynomial.size))

    def curve(angle: np.ndarray) -> np.ndarray:
        value, slope = along(polynomial, np.log(radius) + 1j * angle)
        if np.abs(value).min() <= floor:
            raise ZeroDivisionError("the polynomial vanishes on the circle")
        return np.array([value, np.abs(slope / value)])

    at = np.linspace(0, np.pi, _POINTS * polynomial.size)
    found = curve(at)
    while True:
        speed = found[1].real
        coarse = np.flatnonzero(np.maximum(speed[1:], speed[:-1]) * np.diff(at) > 1)
        if not coarse.size:
            break
        between = (at[coarse] + at[coarse + 1]) / 2
        at = np.insert(at, coarse + 1, between)
        found = np.insert(found, coarse + 1, curve(between), axis=1)
    value = found[0]
    return -round(np.angle(value[1:] / value[:-1]).sum() / np.pi)


def crossings(d: np.ndarray, n: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Gains, of any size and sign, at which roots are on the circle, and how many get outside.

    On the upper half Im(d conj(n)) changes its sign there; where it only touches zero, none gets
    outside.  At z = 1 and z = -1 the root is a single one.
    """
    steps = points * d.size
    # No point of the grid is a harmonic, where d may be zero and its sign that of rounding.
    grid = np.concatenate([[1e-3], np.arange(steps) + 0.381966, [steps - 1e-3]])
    at, value, touched = _resolved(d, n, np.pi / steps * grid)
    sign = np.where(value < 0, -1, 1)
    i = np.flatnonzero(sign[1:] != sign[:-1])
    found = find_root(lambda angle: _imaginary(d, n, angle)[0], (at[i], at[i + 1]))
    angle = np.concatenate([found.x, touched])
    more = np.concatenate([sign[i] - sign[i + 1], np.zeros(touched.size), [-sign[0], sign[-1]]])
    ends = np.array([[1.0], [-1.0]]) ** np.arange(d.size)
    d_there, n_there = (np.append(along(p, 1j * angle)[0], ends @ p) for p in (d, n))
    with np.errstate(divide="ignore", invalid="ignore"):
        gains = -(d_there / n_there).real
    order = np.argsort(gains)
    return gains[order], more[order]


def _resolved(
    d: np.ndarray, n: np.ndarray, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles close enough to see every change of sign of Im(d conj(n)), and where it touches 0."""
    value, slope = _imaginary(d, n, at)
    for _ in range(40):
        step, rise = np.diff(at), np.abs(np.diff(value))
        low = np.minimum(np.abs(value[1:]), np.abs(value[:-1]))
        most = step * np.maximum(np.abs(slope[1:]), np.abs(slope[:-1]))
        # A minimum between two points may have been beyond zero; a bent change may be three.
        toward = (value * slope < 0)[:-1] & (value * slope > 0)[1:] & (low < most)
        changes = value[1:] * value[:-1] <= 0
        between = np.flatnonzero(np.where(changes, most > 2 * rise, toward))
        if not between.size:
            break
        middle = (at[between] + at[between + 1]) / 2
        at = np.insert(at, between + 1, middle)
        curve = _imaginary(d, n, middle)
        value, slope = np.insert([value, slope], between + 1, curve, axis=1)
    return at, value, at[between[~changes[between]]]


def _imaginary(d: np.ndarray, n: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Im(d conj(n)) on the unit circle, and its derivative by the angle."""
    (d, d_slope), (n, n_slope) = (along(p, 1j * angle) for p in (d, n))
    return (d * n.conj()).imag, (d_slope * n.conj() - d * n_slope.conj()).real
