"""Multipliers beyond a circle, counted by the argument principle in O(N) work.

A multiplier m of the loop has a solution that repeats N samples later m times as large, so
(m - K) u = 0 on such sequences: a problem of the small order of the window, not of N.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from rcbook import zdomain
from rcbook.loops.periodic.loop import PeriodicLoop
from rcbook.loops.periodic.window import Window

_RUN_IN = 400  # samples before the period in which the elimination settles
_FORGOTTEN = 1e-8  # of a start, after a period, that no factor shows
_CHANGE = 0.1  # of a factor, relative, that is tolerated when the data change by 1e-10
_STEP = 0.5  # of a factor from one point of the circle to the next, rad or relative
_FIRST = 15  # points of the half circle, closer to 1, which is where most that is slow happens
_PARTS = 3  # of a step that is too large, at most
_AT_ONCE = 21  # points; larger products are threaded, which takes longer than they do
_NEAR, _FAR = 1e-6, 1e-3  # relative distances of the points that give a slope


def _factors(windows: Sequence[Window], points: np.ndarray) -> np.ndarray:
    """Factors (N + 1, windows, points) whose product is +-det(point - M)/point^states.

    M is the one-period map of a window, each of which has its row of points.  Block elimination
    of (point - K) u = 0 with the twist u(k+N) = point u(k): unknown u(t-p) is taken out by the row
    that holds point u(t-p), for t = 0 .. N-1.  The last factor closes the circle.
    """
    parts = [points[:, i : i + _AT_ONCE] for i in range(0, points.shape[1], _AT_ONCE)]
    return np.concatenate([_swept(windows, part) for part in parts], axis=2)


def _swept(windows: Sequence[Window], points: np.ndarray) -> np.ndarray:
    """The factors; the last is 1 where all that it could hold is seen to die out in a period.

    What is off at the start is followed for one choice of it, at random, and so is one mixture
    of u(-p) .. u(-1); only where they live on is it done for all.
    """
    start, ahead, kept = _run_in(windows, points), windows[0].ahead, windows[0].kept.size
    rng = np.random.default_rng(0)
    mixture, off = rng.normal(size=(1, ahead)), rng.normal(size=(kept, 1))
    pivots, left, ends = _period(windows, points, start, mixture, off)
    again = left[:, :, 1:] - start[:, :kept]
    parts = left[:, :, :1] / points[:, None, None], again, ends[:, :, 1:]
    dead = np.max([np.abs(part).max(axis=(0, 1, 2)) for part in parts], axis=0) < _FORGOTTEN
    closing, alive = np.ones_like(pivots[:1]), np.flatnonzero(~dead)
    if alive.size:
        points, start = points[:, alive], start[..., alive]
        pivots[..., alive], *ends = _period(windows, points, start, np.eye(ahead), np.eye(kept))
        closing[..., alive] = _closing(points, start[:, :kept], *ends)
    return np.concatenate([pivots, closing])


def _closing(
    points: np.ndarray, start: np.ndarray, left: np.ndarray, ends: np.ndarray
) -> np.ndarray:
    """Determinant of the conditions that one period later all is `point` times as large."""
    kept, ahead, twist = left.shape[1], ends.shape[1], points[:, None, None]
    state, past = -left, -twist * ends
    state[:, :, kept:] += start
    state[:, :, :kept] += twist * np.eye(kept)[:, :, None]
    past[:, :, kept:] += np.eye(ahead)[:, :, None]
    conditions = np.moveaxis(np.concatenate([state, past], axis=1), 3, 1)
    return np.linalg.det(conditions) / points**kept


def _run_in(windows: Sequence[Window], points: np.ndarray) -> np.ndarray:
    """A state as combination of u(-p) .. u(-1) that the elimination has settled on.

    Any choice would do; this one spares the first factors a start from nothing, which is singular
    for q = 1 at 1.  It comes from further out, where the elimination is well posed.
    """
    period, ahead = windows[0].period, windows[0].ahead
    basis = np.zeros((len(windows), windows[0].states, ahead, points.shape[1]), dtype=complex)
    basis[:, -ahead:] = np.eye(ahead)[:, :, None]
    samples = np.arange(-min(period, _RUN_IN), 0)
    early, late = np.array_split(samples % period, 2)
    _eliminate(windows, early, points * (1 + 2 / np.abs(points)), basis)
    _eliminate(windows, late, points, basis)
    return basis


def _period(
    windows: Sequence[Window],
    points: np.ndarray,
    start: np.ndarray,
    mixtures: np.ndarray,
    off: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Factors of a period, the kept state at its end, and mixtures of u(-p) .. u(-1).

    Columns: ways in which the kept state is `off` at the start, then the last p of u.
    """
    extra, others, ahead = len(mixtures), off.shape[1], windows[0].ahead
    rows = extra + windows[0].kept.size
    shape = (len(windows), rows + ahead, others + ahead, points.shape[1])
    basis = np.zeros(shape, dtype=complex)
    basis[:, :extra, others:] = mixtures[:, :, None]
    basis[:, extra:rows, :others] = off[:, :, None]
    basis[:, extra:, others:] = start
    pivots = _eliminate(windows, range(windows[0].period), points, basis)
    return pivots / points, basis[:, extra:rows], basis[:, :extra]


def _eliminate(
    windows: Sequence[Window], samples: Sequence[int], points: np.ndarray, basis: np.ndarray
) -> np.ndarray:
    """Pivots (samples, windows, points); the basis is brought from before to after, in place.

    Rows of the basis: some that are carried along, the kept state, and u(k-p) .. u(k-1).
    Columns: some others, and u(k-p) .. u(k-1) again.
    """
    ahead, states = windows[0].ahead, windows[0].states
    extra, at = basis.shape[1] - states, basis.shape[2] - ahead
    found = np.empty_like(basis, shape=(len(basis), basis.shape[1] - ahead + 1, *basis.shape[2:]))
    products = [  # real matrices times complex numbers as pairs
        (window.equations, *(s[extra:].view(float).reshape(len(s) - extra, -1) for s in seen))
        for window, *seen in zip(windows, basis, found, strict=True)
    ]
    entry = np.stack([window.entry[:, window.kept] for window in windows], axis=1)
    entry = np.pad(entry, ((0, 0), (0, 0), (extra, 0)))[..., None]
    rows, equation = found[:, :-1], found[:, -1:]
    first, later, others = rows[:, :, at : at + 1], rows[:, :, at + 1 :], rows[:, :, :at]
    kept = basis[:, :-ahead]
    pivots = np.empty((len(samples), *points.shape), dtype=complex)
    for i, k in enumerate(samples):
        for equations, before, after in products:
            np.matmul(equations[k], before, out=after)
        found[:, :extra] = basis[:, :extra]
        pivots[i] = points - equation[:, 0, at]
        first *= (1 / pivots[i])[:, None, None]
        np.multiply(first, equation[:, :, at + 1 :], out=kept[:, :, at:-1])
        kept[:, :, at:-1] += later
        np.multiply(first, equation[:, :, :at], out=kept[:, :, :at])
        kept[:, :, :at] += others
        kept[:, :, -1] = entry[k]
    return pivots


@dataclass(frozen=True)
class Count:
    """Multipliers of magnitude above a radius, or None when the count is not certified.

    Certified means: from each point of the circle to the next no factor of the determinant turns,
    or would change at the slope it has at either end, by more than half a radian or half of
    itself; the logarithm of the determinant changes, to within one, by the integral of its slope;
    and changes of 1e-10 in plant, taps and q, a million roundings, change no factor by more than a
    tenth.  That is a check at points, not an interval proof.
    """

    radius: float
    outside: int | None
    points: int  # on the upper half of the circle
    largest_step: float  # of a factor from point to point, rad or relative
    largest_change: float  # of a factor, relative, for changes of 1e-10


@dataclass(frozen=True, eq=False)
class _Followed:
    """Points of a circle; the last axis of all arrays."""

    angles: np.ndarray  # rad
    factors: np.ndarray
    steepest: np.ndarray  # largest relative slope of a factor
    slope: np.ndarray  # of the logarithm of the determinant: z F'(z)/F(z)
    change: np.ndarray  # of a factor, relative, when the data change by 1e-10

    def inserted(self, at: np.ndarray, other: _Followed) -> _Followed:
        """With other points before those at `at`."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return _Followed(*(np.insert(ours, at, theirs, axis=-1) for ours, theirs in pairs))


def count_outside(loop: PeriodicLoop, radius: float = 1.0, most_points: int = 1000) -> Count:
    """Count the multipliers of magnitude above a radius by the argument principle: O(N) per point.

    The determinant of (point - one-period map) is followed round the circle factor by factor,
    each of which changes little, so that the points needed hardly grow with N.
    Raises ValueError for a radius that is not positive.
    """
    radius = zdomain.real_number(radius, "radius", positive=True)
    most_points = zdomain.whole_number(most_points, "most_points")
    windows = loop.window, loop.window, _shaken(loop).window
    with np.errstate(all="ignore"):
        seen = _follow(windows, radius, np.pi * np.linspace(0, 1, _FIRST) ** 2)
        steps, lost = _steps(seen)
        while seen.change.max() <= _CHANGE and lost.any() and seen.angles.size < most_points:
            at, between = _between(seen, steps, lost)
            seen = seen.inserted(at, _follow(windows, radius, between))
            steps, lost = _steps(seen)
        turns = -np.angle(seen.factors[:, 1:] / seen.factors[:, :-1]).sum() / np.pi
    change, step = float(seen.change.max()), float(steps.max())
    certified = change <= _CHANGE and not lost.any() and abs(turns - np.round(turns)) < 1e-3
    return Count(radius, round(turns) if certified else None, seen.angles.size, step, change)


def _follow(windows: Sequence[Window], radius: float, angles: np.ndarray) -> _Followed:
    """Factors of a loop on a circle, just outside of it, and with changed data.

    Where rounding may drown the slope it is taken from further outside.
    """
    points = radius * np.exp(1j * angles)
    factors = _factors(windows, np.array([points, points * (1 + _NEAR), points]))
    near, further, changed = np.moveaxis(factors, 1, 0)
    change = np.nan_to_num(np.abs(changed / near - 1).max(axis=0), nan=np.inf)
    seen = np.abs(further / near - 1).max(axis=0)
    blurred = (change > _NEAR) & (change <= _CHANGE) & (seen < 10 * change)
    distance = np.where(blurred, _FAR, _NEAR)
    if blurred.any():
        further[:, blurred] = _factors(windows[:1], points[None, blurred] * (1 + _FAR))[:, 0]
    slopes = (further / near - 1) / distance
    return _Followed(angles, near, np.abs(slopes).max(axis=0), slopes.sum(axis=0), change)


def _steps(seen: _Followed) -> tuple[np.ndarray, np.ndarray]:
    """Largest change of any factor from point to point, seen and foretold, and what is lost.

    A multiplier that passes from factor to factor hides from each of them, not from their product:
    there the slope is integrated, by a spline through the whole circle.
    """
    angles, ratios = seen.angles, seen.factors[:, 1:] / seen.factors[:, :-1]
    turns = np.abs(np.angle(ratios)).max(axis=0)
    steps = np.maximum(turns, np.diff(angles) * np.maximum(seen.steepest[1:], seen.steepest[:-1]))
    steps = np.where(np.isfinite(steps), steps, np.inf)
    if not np.isfinite(steps).all():
        return steps, steps > _STEP
    circle = np.concatenate([-angles[:0:-1], angles, 2 * np.pi - angles[-2::-1]])
    slope = np.concatenate([seen.slope[:0:-1].conj(), seen.slope, seen.slope[-2::-1].conj()])
    foretold = np.diff(CubicSpline(circle, 1j * slope).antiderivative()(angles))
    return steps, (steps > _STEP) | (np.abs(np.log(ratios).sum(axis=0) - foretold) > 1)


def _between(seen: _Followed, steps: np.ndarray, lost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where to insert angles and which: closer together towards the end that is steeper."""
    parts = np.where(lost, np.clip(np.ceil(steps / _STEP), 2, _PARTS), 1).astype(int)
    at = np.repeat(np.arange(1, seen.angles.size), parts - 1)
    share = np.concatenate([np.arange(1, n) / n for n in parts])
    ratio = np.clip(np.abs(seen.slope[at] / seen.slope[at - 1]), 1e-3, 1e3) * (1 + 1e-9)
    share = np.log1p(share * (ratio - 1)) / np.log(ratio)
    share = np.where(np.isfinite(share), share, 0.5)
    return at, seen.angles[at - 1] + share * np.diff(seen.angles)[at - 1]


def _shaken(loop: PeriodicLoop) -> PeriodicLoop:
    """The loop with data changed by up to 1e-10 of themselves."""
    rng = np.random.default_rng(0)

    def shaken(array: np.ndarray) -> np.ndarray:
        return array * (1 + 1e-10 * rng.uniform(-1, 1, array.shape))

    plant, compensator, memory = loop.plant, loop.compensator, loop.memory
    return replace(
        loop,
        plant=replace(plant, a=shaken(plant.a), b=shaken(plant.b)),
        compensator=replace(compensator, taps=shaken(compensator.taps)),
        memory=replace(memory, taps=shaken(memory.taps)),
    )
