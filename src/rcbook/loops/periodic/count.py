"""Multipliers beyond a circle, counted by the argument principle in O(N) work.

A multiplier m of the loop has a solution that repeats N samples later m times as large, so
(m - K) u = 0 on such sequences: a problem of the small order of the window, not of N.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rcbook import zdomain
from rcbook.loops.periodic.loop import PeriodicLoop
from rcbook.loops.periodic.window import Window

_RUN_IN = 400  # samples before the period in which the elimination settles
_CHANGE = 0.1  # of a factor, relative, that is tolerated when the data change by 1e-10
_STEP = 0.5  # of a factor from one point of the circle to the next, rad or relative
_AT_ONCE = 16  # points; larger products are threaded, which takes longer than they do
_NEAR = 1e-3  # relative distance of the points that give a slope; closer, rounding drowns it


def _factors(window: Window, points: np.ndarray) -> np.ndarray:
    """Factors (N + 1, points) whose product is +-det(point - M)/point^states, M the one-period map.

    Block elimination of (point - K) u = 0 with the twist u(k+N) = point u(k): unknown u(t-p) is
    taken out by the row that holds point u(t-p), for t = 0 .. N-1.  The last factor closes the
    circle.
    """
    parts = [_swept(window, points[i : i + _AT_ONCE]) for i in range(0, points.size, _AT_ONCE)]
    return np.concatenate(parts, axis=1)


def _swept(window: Window, points: np.ndarray) -> np.ndarray:
    n, ahead, states, number = window.order, window.ahead, window.states, points.size
    rest, ages = np.r_[0:n, n + ahead : states], np.arange(ahead)
    start = _run_in(window, points)[rest]
    basis = np.zeros((states + ahead, ahead + rest.size, number), dtype=complex)
    basis[n + ahead - 1 - ages, ages] = 1.0
    basis[states + ages, ages] = 1.0  # u(-p) .. u(-1), to close the circle with
    basis[rest, :ahead] = start
    basis[rest, ahead + np.arange(rest.size)] = 1.0
    factors = np.empty((window.period + 1, number), dtype=complex)
    for k in range(window.period):
        factors[k], basis = _eliminate(window, k, points, basis)
    closing = np.zeros((basis.shape[1],) * 2 + (number,), dtype=complex)
    closing[: rest.size] = -basis[rest]
    closing[: rest.size, :ahead] += start
    closing[np.arange(rest.size), ahead + np.arange(rest.size)] += points
    closing[rest.size :] = points * basis[states:]
    closing[rest.size + ages, ages] -= 1.0
    factors[-1] = np.linalg.det(np.moveaxis(closing, 2, 0)) / points**rest.size
    factors[:-1] /= points
    return factors


def _run_in(window: Window, points: np.ndarray) -> np.ndarray:
    """A state as combination of u(-p) .. u(-1) that the elimination has settled on.

    Any choice would do; this one spares the first factors a start from nothing, which is singular
    for q = 1 at 1.  It comes from further out, where the elimination is well posed.
    """
    n, ahead = window.order, window.ahead
    ages, length = np.arange(ahead), min(window.period, _RUN_IN)
    basis = np.zeros((window.states, ahead, points.size), dtype=complex)
    basis[n + ahead - 1 - ages, ages] = 1.0
    outside = points * (1 + 2 / np.abs(points))
    for k in range(-length, 0):
        basis = _eliminate(window, k, outside if 2 * k < -length else points, basis)[1]
    return basis


def _eliminate(
    window: Window, k: int, points: np.ndarray, basis: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Pivot and the next basis; columns are u(k-p) .. u(k-1) and then what else there is."""
    n, at_y, states = window.order, window.order + window.inputs, window.states
    last, k = window.ahead - 1, k % window.period
    found = _times(window.equations[k], basis[:states])
    equation = -found[n]
    equation[0] += points
    shifted = [np.zeros_like(found[:1]), basis[n : at_y - 1]]
    outputs = [found[n + 1 :], basis[at_y : states - 1]] if states > at_y else []
    later = np.concatenate([found[:n], *shifted, *outputs, basis[states:]])
    left = later[:, 1:] - later[:, :1] * (equation[1:] / equation[0])
    entered = np.zeros((len(basis), 1, points.size))
    entered[:states, 0] = window.entry[k, :, None]
    return equation[0], np.concatenate([left[:, :last], entered, left[:, last:]], axis=1)


def _times(matrix: np.ndarray, stack: np.ndarray) -> np.ndarray:
    """matrix @ stack over the first axis of a stack."""
    return (matrix @ stack.reshape(stack.shape[0], -1)).reshape(len(matrix), *stack.shape[1:])


@dataclass(frozen=True)
class Count:
    """Multipliers of magnitude above a radius, or None when the count is not certified.

    Certified means: from each point of the circle to the next no factor of the determinant turns,
    or would change at the slope it has at either end, by more than half a radian or half of
    itself; and changes of 1e-10 in plant, taps and q, a million roundings, change no factor by
    more than a tenth.  That is a check at points, not an interval proof.
    """

    radius: float
    outside: int | None
    points: int  # on the upper half of the circle
    largest_step: float  # of a factor from point to point, rad or relative
    largest_change: float  # of a factor, relative, for changes of 1e-10


def count_outside(loop: PeriodicLoop, radius: float = 1.0, most_points: int = 1000) -> Count:
    """Count the multipliers of magnitude above a radius by the argument principle: O(N) per point.

    The determinant of (point - one-period map) is followed round the circle factor by factor,
    each of which changes little, so that the points needed hardly grow with N.
    Raises ValueError for a radius that is not positive.
    """
    radius = zdomain.real_number(radius, "radius", positive=True)
    most_points = zdomain.whole_number(most_points, "most_points")
    angles = np.concatenate([[0.0], np.geomspace(1e-3, np.pi, 40)])
    with np.errstate(all="ignore"):
        factors, slopes = _follow(loop.window, radius, angles)
        change = _change(loop, radius * np.exp(1j * angles), factors)
        steps = _steps(angles, factors, slopes)
        while change <= _CHANGE and steps.max() > _STEP and angles.size < most_points:
            wide = np.flatnonzero(steps > _STEP)
            between = (angles[wide] + angles[wide + 1]) / 2
            found, inclined = _follow(loop.window, radius, between)
            factors = np.insert(factors, wide + 1, found, axis=1)
            slopes = np.insert(slopes, wide + 1, inclined)
            angles = np.insert(angles, wide + 1, between)
            steps = _steps(angles, factors, slopes)
        turns = -np.angle(factors[:, 1:] / factors[:, :-1]).sum() / np.pi
        whole = abs(turns - np.round(turns)) < 1e-3
    certified = change <= _CHANGE and steps.max() <= _STEP and whole
    outside = round(turns) if certified else None
    return Count(radius, outside, angles.size, float(steps.max()), change)


def _follow(window: Window, radius: float, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Factors on a circle, and at each point the largest relative slope of any of them."""
    points = radius * np.exp(1j * angles)
    near, far = _factors(window, points), _factors(window, points * (1 + _NEAR))
    return near, np.abs(far / near - 1).max(axis=0) / _NEAR


def _steps(angles: np.ndarray, factors: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Largest change of any factor from point to point, seen and foretold; infinite where lost."""
    turns = np.abs(np.angle(factors[:, 1:] / factors[:, :-1])).max(axis=0)
    steps = np.maximum(turns, np.diff(angles) * np.maximum(slopes[1:], slopes[:-1]))
    return np.where(np.isfinite(steps), steps, np.inf)


def _change(loop: PeriodicLoop, points: np.ndarray, factors: np.ndarray) -> float:
    """Largest relative change of a factor when the data change by up to 1e-10 of themselves."""
    rng = np.random.default_rng(0)

    def shaken(array: np.ndarray) -> np.ndarray:
        return array * (1 + 1e-10 * rng.uniform(-1, 1, array.shape))

    plant, compensator, memory = loop.plant, loop.compensator, loop.memory
    other = replace(
        loop,
        plant=replace(plant, a=shaken(plant.a), b=shaken(plant.b)),
        compensator=replace(compensator, taps=shaken(compensator.taps)),
        memory=replace(memory, taps=shaken(memory.taps)),
    )
    change = np.abs(_factors(other.window, points) / factors - 1).max()
    return float(change) if np.isfinite(change) else np.inf


def radius_bounds(loop: PeriodicLoop, width: float = 1e-3) -> tuple[float, float]:
    """Bounds of `spectral_radius`, from counts outside of circles.

    They are as close as `width` unless a circle between them could not be certified; then they
    are those of the circles that were, and may be 0 and infinity.
    """
    width = zdomain.real_number(width, "width", positive=True)
    low, high = 0.0, 1.0
    while (outside := count_outside(loop, high, 300).outside) != 0:
        if high > 1e3:
            return low, np.inf
        low, high = (high if outside else low), 2 * high
    while high - low > width:
        middle = (low + high) / 2
        outside = count_outside(loop, middle, 300).outside
        if outside is None:
            break
        low, high = (middle, high) if outside else (low, middle)
    return low, high
