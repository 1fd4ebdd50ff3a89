"""The growth over one period of the speed, by semi-discretisation."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from rcbook.machines.chatter.cut import Cut, clock, modal, steps_needed
from rcbook.spread import spread
from rcbook.zdomain import real_number, whole_number

_TINY = np.finfo(float).tiny
_LARGEST_EXPONENT = 300.0  # e^300 and its inverse are far from overflow
_RATIO_ERROR = 1e-5  # how well rvf is met by a ratio of whole numbers of steps
_LONGEST = 2_000_000  # steps of one speed period that still fit into memory
_CHUNK = 20_000  # steps that are held at once, of all cuts of one batch together


class Floquet(NamedTuple):
    """The dominant Floquet multiplier and what follows from it, each of the cut's shape."""

    multiplier: np.ndarray  # complex; of a conjugate pair the one with imaginary part >= 0
    turns: np.ndarray  # spindle turns that it spans: 1/rvf, or a multiple that makes one or more
    growth: np.ndarray  # 1/s: log|multiplier| over the time of these turns
    residual: np.ndarray  # of the eigenvalue iteration, relative to the multiplier


class _Period(NamedTuple):
    """One speed period of a batch of cuts: what each step adds, per unit of old and new surface."""

    per_turn: int
    block: int  # steps that are summed at once
    old: np.ndarray  # coefficients of y and its conjugate, one turn ago, at the start of a step
    old_conjugate: np.ndarray
    new: np.ndarray  # the same at its end
    new_conjugate: np.ndarray
    decay: np.ndarray  # free response from the start of the block to the end of a step


def floquet(
    cut: Cut,
    per_cycle: int = 10,
    tolerance: float = 1e-6,
    most: int = 60,
    executor: Executor | None = None,
) -> Floquet:
    """Dominant multiplier of the cut over its speed period, by semi-discretisation.

    The surface of the last turn is a cubic in every step (value and slope at the nodes) and the
    response of the mode to it is exact, so errors fall with the fourth power of the step: with
    `per_cycle` steps per cycle of the mode, at the lowest speed, about 2/per_cycle^4 of the
    cutting stiffness.  The eigenvalue comes from at most `most` Arnoldi steps, fewer where the
    residual falls below `tolerance`.  The ratio rvf is held by whole numbers of steps, to 1e-5.
    The workers of an `executor` share batches of cuts, with the same result.
    Raises ValueError for fewer than 4 steps per cycle, a tolerance that is not positive, or a
    speed period too long for memory or for the range of floating-point numbers.
    """
    per_cycle = whole_number(per_cycle, "per_cycle", 4)
    most = whole_number(most, "most", 2)
    tolerance = real_number(tolerance, "tolerance", positive=True)
    places, *grids = zip(*_batches(cut, per_cycle), strict=True)
    batches = zip(map(cut.take, places), *grids, strict=True)
    answers = spread(partial(_floquet, tolerance=tolerance, most=most), batches, executor)
    back = np.argsort(np.concatenate(places))
    return Floquet(
        *(np.concatenate(a)[back].reshape(cut.shape) for a in zip(*answers, strict=True))
    )


def _floquet(batch: tuple[Cut, int, int], tolerance: float, most: int) -> Floquet:
    """Of a row of cuts that share a grid of so many steps per turn and per speed period."""
    cut, per_turn, per_period = batch
    cut = replace(cut, rvf=per_turn / per_period)
    repeats = -(-per_turn // per_period)
    period = _period(cut, per_turn, repeats * per_period)
    with np.errstate(over="ignore", invalid="ignore"):
        multiplier, residual = _dominant(period, tolerance, most)
    turns = repeats / cut.rvf
    growth = np.log(np.maximum(np.abs(multiplier), _TINY)) / (2 * np.pi * turns / cut.mean_speed)
    return Floquet(multiplier, turns, growth, residual)


def _batches(cut: Cut, per_cycle: int) -> Iterator[tuple[np.ndarray, int, int]]:
    """Places of cuts that share a grid, with its steps per turn and per speed period."""
    needed, rvf = steps_needed(cut, per_cycle).ravel(), cut.rvf.ravel()
    for ratio in np.unique(rvf):
        places = np.flatnonzero(rvf == ratio)
        places = places[np.argsort(-needed[places], kind="stable")]
        while places.size:
            per_turn, per_period = _grid(ratio, int(needed[places[0]]))
            if max(per_turn, per_period) > _LONGEST:
                raise ValueError(
                    f"speed = {cut.speed.ravel()[places[0]]:.4g} rad/s with rvf = {ratio:.4g} "
                    f"needs {max(per_turn, per_period)} steps a period; choose a higher one"
                )
            most = max(1, _CHUNK // max(per_turn, per_period))
            yield places[:most], per_turn, per_period
            places = places[most:]


def _grid(rvf: float, least: int) -> tuple[int, int]:
    """Whole numbers of steps per turn, `least` or somewhat more, and per speed period."""
    per_turn = np.arange(least, least + least // 4 + 1)
    per_period = np.rint(per_turn / rvf)
    error = np.abs(per_period * rvf / per_turn - 1)
    best = np.argmax(error <= max(_RATIO_ERROR, error.min()))  # the first that is good enough
    return int(per_turn[best]), int(per_period[best])


def _period(cut: Cut, per_turn: int, steps: int) -> _Period:
    """The steps of one period; y' = s y + force and x = Im y/(m w_d) carry the mode in contact."""
    root, gain = modal(cut.mode, cut.cutting_stiffness)
    time, speed = _clocks(cut, 2 * np.pi / per_turn * np.arange(steps + 1))
    dt = np.diff(time, axis=-1)
    free, *values = _cubic_integrals(root[:, None] * dt)
    block = max(1, min(per_turn, int(_LARGEST_EXPONENT / np.max(-root.real[:, None] * dt))))
    decay = np.empty_like(free)
    for a in range(0, steps, block):
        np.cumprod(free[:, a : a + block], axis=1, out=decay[:, a : a + block])
    unit = (cut.cutting_stiffness * gain / 2j)[:, None] * dt / decay
    # the old surface was cut at another speed: its slope in time is rescaled
    scale = speed / speed[:, (np.arange(steps + 1) - per_turn) % steps]
    old, new = unit * values[0], unit * values[2]
    old_slope, new_slope = (
        unit * values[1] * (dt * scale[:, :-1]),
        unit * values[3] * (dt * scale[:, 1:]),
    )
    s = root[:, None]
    return _Period(
        per_turn,
        block,
        old + s * old_slope,
        -old - s.conj() * old_slope,
        new + s * new_slope,
        -new - s.conj() * new_slope,
        decay,
    )


def _clocks(cut: Cut, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Time and speed of cuts of one rvf; those of one rva share a clock, but for its unit."""
    rva, which = np.unique(cut.rva, return_inverse=True)
    unit = replace(cut, cutting_stiffness=1.0, speed=1.0, rva=rva, rvf=cut.rvf[0])
    time, speed = clock(unit, angle)
    return time[which] / cut.speed[:, None], speed[which] * cut.speed[:, None]


def _cubic_integrals(z: np.ndarray) -> tuple[np.ndarray, ...]:
    """e^z, and the integrals over w from 0 to 1 of e^(z (1 - w)) times the four Hermite cubics.

    They belong to value and slope at w = 0, then value and slope at w = 1.
    """
    phi, inverse = [np.exp(z)], 1 / z
    for factorial in (1, 1, 2, 6):
        phi.append((phi[-1] - 1 / factorial) * inverse)
    one, w, w2, w3 = phi[1], phi[2], 2 * phi[3], 6 * phi[4]
    return phi[0], one - 3 * w2 + 2 * w3, w - 2 * w2 + w3, 3 * w2 - 2 * w3, w3 - w2


def _advance(period: _Period, history: np.ndarray) -> np.ndarray:
    """The last turn of y, shape (cuts, per_turn + 1), one period later."""
    turn, steps = period.per_turn, period.decay.shape[1]
    y = np.empty((len(history), turn + 1 + steps), dtype=complex)
    y[:, : turn + 1] = history
    for a in range(0, steps, period.block):
        b = min(a + period.block, steps)
        past, span = y[:, a : b + 1], slice(a, b)
        back = past.conj()
        added = period.old[:, span] * past[:, :-1]
        added += period.old_conjugate[:, span] * back[:, :-1]
        added += period.new[:, span] * past[:, 1:]
        added += period.new_conjugate[:, span] * back[:, 1:]
        np.cumsum(added, axis=1, out=added)
        added += y[:, turn + a, None]
        np.multiply(added, period.decay[:, span], out=y[:, turn + a + 1 : turn + b + 1])
    return y[:, steps:]


def _dominant(period: _Period, tolerance: float, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Dominant eigenvalue of the period map and its relative residual, by Arnoldi's method."""
    cuts, n = len(period.decay), 2 * (period.per_turn + 1)
    basis, projected = np.empty((cuts, most + 1, n)), np.zeros((cuts, most + 1, most))
    basis[:, 0] = np.random.default_rng(1).standard_normal(n)
    basis[:, 0] /= np.linalg.norm(basis[:, 0], axis=-1, keepdims=True)
    slowest, look = 0, 3  # the cut to look at, and when: all of them only when it has converged
    for k in range(most):
        now = np.ascontiguousarray(basis[:, k]).view(complex)
        image = np.ascontiguousarray(_advance(period, now)).view(float)
        known = basis[:, : k + 1]
        for _ in range(2):  # twice is enough to keep the basis orthogonal
            parts = known @ image[:, :, None]
            image = image - (parts.transpose(0, 2, 1) @ known)[:, 0]
            projected[:, : k + 1, k] += parts[:, :, 0]
        size = np.linalg.norm(image, axis=-1)
        if not np.all(np.isfinite(size)):
            raise ValueError("chatter outgrows all numbers in one period; choose a larger rvf")
        projected[:, k + 1, k] = size
        basis[:, k + 1] = image / np.maximum(size, _TINY)[:, None]
        if k + 1 in (look, most):
            look += max(3, look // 4)
            hessenberg = projected[:, : k + 2, : k + 1]
            if k + 1 < most and _ritz(hessenberg[slowest, None])[1] >= tolerance:
                continue
            value, residual = _ritz(hessenberg)
            slowest = np.argmax(residual)
            if residual[slowest] < tolerance:
                break
    return value, residual


def _ritz(projected: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    values, vectors = np.linalg.eig(projected[:, :-1])
    values = values.astype(complex)
    best = np.argmax(np.abs(values), axis=1)[:, None]
    value = np.take_along_axis(values, best, 1)[:, 0]
    last = np.take_along_axis(np.abs(vectors[:, -1]), best, 1)[:, 0]
    residual = projected[:, -1, -1] * last / np.maximum(np.abs(value), _TINY)
    return value.real + 1j * np.abs(value.imag), residual
