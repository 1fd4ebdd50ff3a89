"""Polynomials in z^-1 and points of the unit circle.

Polynomials are 1-D arrays, lowest power first: ``[1, -0.5]`` is 1 - 0.5 z^-1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike


def shift(p: np.ndarray, delay: int) -> np.ndarray:
    """z^-delay p(z^-1)."""
    return np.concatenate([np.zeros(delay), p])


def add(*terms: np.ndarray) -> np.ndarray:
    """Sum of polynomials of any lengths."""
    total = np.zeros(max(p.size for p in terms))
    for p in terms:
        total[: p.size] += p
    return total


def multiply(*factors: np.ndarray) -> np.ndarray:
    """Product of polynomials."""
    product = np.ones(1)
    for p in factors:
        product = np.convolve(product, p)
    return product


def evaluate(p: np.ndarray, z: ArrayLike) -> np.ndarray:
    """p(z^-1) at the points z."""
    return np.polynomial.polynomial.polyval(1 / np.asarray(z), p)


def rms_gain(numerator: np.ndarray, denominator: np.ndarray, largest_root: float) -> float:
    """Root of the mean of |numerator/denominator|^2 over the unit circle: what white noise becomes.

    The mean over n points is exact but for terms of the size largest_root^n, the largest root of
    the denominator, and n is chosen to bring these below rounding.
    Raises ValueError for a root so near the circle that the sum would not end.
    """
    root = max(largest_root, 0.5)
    n = int(np.ceil(np.log(1e-17) / np.log(root))) + max(numerator.size, denominator.size)
    if n > 5_000_000:
        raise ValueError(
            f"largest root {root:.9g} is too near 1 to sum the response; raise the gain"
        )
    return float(
        np.sqrt(np.mean(np.abs(np.fft.fft(numerator, n) / np.fft.fft(denominator, n)) ** 2))
    )


def sorted_roots(p: np.ndarray) -> np.ndarray:
    """Roots in z of p(z^-1) away from the origin, by decreasing magnitude; real if all are."""
    roots = np.roots(np.trim_zeros(p, "b"))
    roots = roots[np.argsort(-np.abs(roots), kind="stable")]
    return roots.real if np.all(roots.imag == 0) else roots


def unit_circle(n: int, first: float = 0.0) -> np.ndarray:
    """n points e^(j 2 pi (i + first)/n) round the whole unit circle, by default from z = 1 on."""
    return np.exp(2j * np.pi * (np.arange(n) + first) / n)


def at_frequency(frequency: ArrayLike, dt: float) -> np.ndarray:
    """Points e^(j 2 pi f dt) of the unit circle for frequencies f in Hz."""
    return np.exp(2j * np.pi * np.asarray(frequency, dtype=float) * dt)


def turns_round_origin(
    curve: Callable[[np.ndarray], np.ndarray], start: float, stop: float, n: int
) -> float:
    """How often a curve turns round the origin, anticlockwise, as its parameter runs.

    The grid, n points first, is refined until no step turns by more than 1 rad.
    Raises ValueError when the curve holds NaN, or passes the origin too close to tell.
    """
    at = np.linspace(start, stop, n)
    value = curve(at)
    for _ in range(40):
        if value.shape != at.shape or not np.all(np.isfinite(value)):
            raise ValueError("the curve holds NaN or infinity, or not one value for each point")
        turned = np.angle(value[1:] / value[:-1])
        coarse = np.flatnonzero(np.abs(turned) > 1)
        if not coarse.size:
            return float(turned.sum() / (2 * np.pi))
        between = (at[coarse] + at[coarse + 1]) / 2
        at, value = (
            np.insert(old, coarse + 1, new) for old, new in ((at, between), (value, curve(between)))
        )
    raise ValueError(f"the curve passes the origin near {between[0]:.9g}, too close to count")
