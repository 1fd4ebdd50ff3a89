"""The spectral radius of a periodic loop: found by shift and invert, held by counts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigs, splu

from rcbook import zdomain
from rcbook.loops.memory import Memory
from rcbook.loops.periodic.compensator import Compensator
from rcbook.loops.periodic.count import count_outside
from rcbook.loops.periodic.growth import multipliers
from rcbook.loops.periodic.loop import PeriodicLoop, factor
from rcbook.loops.periodic.plant import PeriodicPlant

_SHORT = 300  # samples of a period up to which all multipliers are found sooner
_BEYOND, _HELD = 1e-7, 1e-4  # relative distances of the counts that hold the radius
_CLIMBS = 8  # shifts from which larger neighbours are looked for
_WITHIN = (1.0, 0.5, 0.2)  # of a distance: where one circle meets multipliers, another may not
_MOST = 400  # points of a count
_FROZEN = 200  # samples at which the loop is frozen to find a shift


def spectral_radius(loop: PeriodicLoop) -> float:
    """Largest magnitude of a multiplier, per period.

    Up to 300 samples, and with another memory than q z^-N, the largest of all `multipliers`, with
    the caution that is said there.  Beyond, one found by shift and invert and held by
    `count_outside`: none lies beyond 1 + 1e-7 of it, and some beyond 1 - 1e-4.
    Raises ValueError where the counts hold none that was found, as then rounding decides.
    """
    if loop.period <= _SHORT or not loop.has_window:
        return float(np.abs(multipliers(loop)[0]))
    for value in _candidates(loop):
        if _held(loop, value, value * _BEYOND, value * _HELD):
            return value
    raise ValueError(
        f"no multiplier of the loop of N = {loop.period} could be held as the largest by counts; "
        "ask `radius_bounds` how far they reach, and `transient_growth`"
    )


def radius_bounds(loop: PeriodicLoop, width: float = 1e-3) -> tuple[float, float]:
    """Bounds of `spectral_radius`, from counts outside of circles.

    They are as close as `width` unless a circle between them could not be certified; then they
    are those of the circles that were, and may be 0 and infinity.
    """
    width = zdomain.real_number(width, "width", positive=True)
    for value in _candidates(loop):
        if width < 2 * value and (held := _held(loop, value, width / 2, width / 2)):
            return held
    low, high = 0.0, 1.0
    while (outside := count_outside(loop, high, _MOST).outside) != 0:
        if high > 1e3:
            return low, np.inf
        low, high = (high if outside else low), 2 * high
    while high - low > width:
        middle = (low + high) / 2
        outside = count_outside(loop, middle, _MOST).outside
        if outside is None:
            break
        low, high = (middle, high) if outside else (low, middle)
    return low, high


def _held(
    loop: PeriodicLoop, value: float, beyond: float, within: float
) -> tuple[float, float] | None:
    """Bounds of the spectral radius that counts show to be so close to a value."""
    if count_outside(loop, value + beyond, _MOST).outside == 0:
        for part in _WITHIN:
            if count_outside(loop, value - part * within, _MOST).outside:
                return value - part * within, value + beyond
    return None


def _candidates(loop: PeriodicLoop) -> Iterator[float]:
    """Magnitudes of multipliers that may be the largest, the likeliest first."""
    if loop.period <= _SHORT:
        yield float(np.abs(multipliers(loop)[0]))
        return
    for shift in _shifts(loop):
        top, value = _largest(loop, 1.01 * shift, 1e-2), 0.0
        for _ in range(_CLIMBS):
            top = _largest(loop, top * (1 + 1e-6), 0.0)
            if abs(top) <= value * (1 + 1e-12):
                break
            value = abs(top)
            yield value


def _shifts(loop: PeriodicLoop) -> np.ndarray:
    """Where the factor of a frozen sample is largest, over the frequencies around."""
    n, half, plant = loop.period, loop.memory.taps.size // 2, loop.plant
    some = np.unique(np.linspace(0, n - 1, min(n, _FROZEN)).astype(int))
    frozen = PeriodicLoop(
        PeriodicPlant(plant.a[some], plant.b[some], plant.c, plant.intervals[some]),
        Compensator(loop.compensator.taps[some], loop.advance),
        Memory(loop.memory.taps, some.size - half, some.size),
        loop.gain,
    )
    values = factor(frozen, np.exp(1j * np.linspace(0, np.pi, 129)))
    values = values[np.abs(values).argmax(axis=0), np.arange(129)]
    sizes = np.pad(np.abs(values), 1)
    peaks = values[(sizes[1:-1] >= sizes[:-2]) & (sizes[1:-1] >= sizes[2:])]
    return peaks[np.argsort(-np.abs(peaks), kind="stable")]


def _largest(loop: PeriodicLoop, shift: complex, tolerance: float) -> complex:
    """Largest of some multipliers nearest to a shift, by Arnoldi's method on the inverse."""
    once = loop.recursion
    solver = splu(once.closed(shift))
    right = np.zeros(once.matrix.shape[1], dtype=complex)

    def inverse(state: np.ndarray) -> np.ndarray:
        right[: once.size] = np.ravel(state)
        return solver.solve(right)[: once.size]

    operator = LinearOperator((once.size, once.size), matvec=inverse, dtype=complex)
    begin = np.random.default_rng(0).standard_normal(once.size).astype(complex)
    found = shift - 1 / eigs(operator, 4, tol=tolerance, v0=begin, return_eigenvectors=False)
    return complex(found[np.abs(found).argmax()])
