"""Plants sampled at intervals T(k) that repeat every N samples."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.signals import signal


@dataclass(frozen=True, eq=False)
class PeriodicPlant:
    """Strictly proper plant x(k+1) = a[k] x(k) + b[k] v(k), y(k) = c x(k) that repeats every N.

    The state is the same for all k.  Shapes: a (N, n, n), b (N, n), c (n,), intervals (N,).
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    intervals: np.ndarray  # s, T(k) from sample k to k+1

    def __post_init__(self) -> None:
        n, order = np.size(self.intervals), np.size(self.c)
        shapes = {"a": (n, order, order), "b": (n, order), "c": (order,), "intervals": (n,)}
        for name, shape in shapes.items():
            array = np.array(getattr(self, name), dtype=float)
            if array.shape != shape:
                raise ValueError(f"{name} has shape {array.shape}; {shape} fits the others")
            if not np.all(np.isfinite(array)):
                raise ValueError(f"{name} holds NaN or infinity; give finite numbers")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if not np.all(self.intervals > 0):
            raise ValueError(f"intervals down to {self.intervals.min()} s; they must be positive")

    @property
    def period(self) -> int:
        """N, samples per period."""
        return self.intervals.size

    @property
    def order(self) -> int:
        """n, states of the plant."""
        return self.c.size


def sample(
    system: control.StateSpace | control.TransferFunction,
    intervals: ArrayLike,
    delay: float = 0.0,
) -> PeriodicPlant:
    """Sample a continuous plant behind a zero-order hold at one period of intervals T(k) in s.

    The continuous state is balanced once and kept for all k.  What is held reaches the plant
    `delay` s late, whatever the interval; earlier inputs that still matter are further states.
    Source: Hanson and Tsao (2000), eq. 2.
    Raises ValueError for a plant that is not continuous, has a direct path or several inputs or
    outputs, for intervals that are not positive, and for a delay below 0 or beyond one period.
    """
    intervals = positive_intervals(intervals)
    if isinstance(system, control.TransferFunction):
        system = control.ss(system)
    if not system.issiso() or not system.isctime() or np.any(system.D):
        raise ValueError(
            f"{system.ninputs} inputs, {system.noutputs} outputs, dt = {system.dt!r}, D = "
            f"{system.D.tolist()}; give a continuous strictly proper plant with one of each"
        )
    if not 0 <= zdomain.real_number(delay, "delay") <= intervals.sum():
        raise ValueError(f"delay = {delay!r} s must lie between 0 and one period")
    scaled = balanced(system)
    n = scaled.nstates
    joint = np.zeros((n + 1, n + 1))
    joint[:n, :n], joint[:n, n] = scaled.A, scaled.B[:, 0]
    if delay:
        return _sample_late(joint, scaled.C[0], intervals, delay)
    distinct, which = np.unique(intervals, return_inverse=True)
    held = scipy.linalg.expm(joint * distinct[:, None, None])[which]
    return PeriodicPlant(held[:, :n, :n], held[:, :n, n], scaled.C[0], intervals)


def _sample_late(
    joint: np.ndarray, c: np.ndarray, intervals: np.ndarray, delay: float
) -> PeriodicPlant:
    """States [x(k), v(k-1) .. v(k-D)]: within interval k, v(k-j) acts until v(k-j+1) arrives."""
    n, period = c.size, intervals.size
    arrival, ages = np.full(period, delay), [np.full(period, delay)]
    while arrival.max() > 0:
        arrival = arrival - np.roll(intervals, len(ages))
        ages.append(arrival)
    past = len(ages) - 1
    a, b = np.zeros((period, n + past, n + past)), np.zeros((period, n + past))
    a[:, :n, :n] = scipy.linalg.expm(joint * intervals[:, None, None])[:, :n, :n]
    a[:, n + 1 :, n:-1] = np.eye(past - 1)
    b[:, n] = 1.0
    for j, age in enumerate(ages):
        first = np.clip(age, 0, intervals)
        last = np.clip(ages[j - 1], 0, intervals) if j else intervals
        held = scipy.linalg.expm(joint * (last - first)[:, None, None])[:, :n, n]
        rest = scipy.linalg.expm(joint * (intervals - last)[:, None, None])[:, :n, :n]
        acts = (rest @ held[:, :, None])[:, :, 0]
        if j:
            a[:, :n, n + j - 1] = acts
        else:
            b[:, :n] = acts
    return PeriodicPlant(a, b, np.append(c, np.zeros(past)), intervals)


def between_samples(
    system: control.StateSpace,
    intervals: ArrayLike,
    command: ArrayLike,
    parts: int,
    delay: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Times in s and outputs at `parts` instants of every interval, the first at the sample.

    It is the periodic answer to a command that repeats with the intervals and is held in each,
    and that arrives `delay` s late.
    Raises ValueError as `sample` does, and when command and intervals differ in length.
    """
    intervals = positive_intervals(intervals)
    command = signal(command, "command", intervals.size)
    pieces = np.repeat(intervals / zdomain.whole_number(parts, "parts"), parts)
    plant = sample(system, pieces, delay)
    order = plant.order
    rows = np.empty((pieces.size, order + 1))
    state = np.eye(order, order + 1)  # of every unit state, and of the command from rest
    for k in range(pieces.size):
        rows[k] = plant.c @ state
        state = plant.a[k] @ state
        state[:, -1] += plant.b[k] * command[k // parts]
    start = np.linalg.solve(np.eye(order) - state[:, :-1], state[:, -1])
    return np.cumsum(pieces) - pieces, rows[:, :-1] @ start + rows[:, -1]


def balanced(system: control.StateSpace) -> control.StateSpace:
    """The same plant in states scaled by powers of 2, so that nothing is rounded."""
    n = system.nstates
    rate = np.abs(np.linalg.eigvals(system.A)).max(initial=0.0) or 1.0
    joint = np.block([[system.A, system.B], [rate * system.C, np.zeros((1, 1))]])
    scale = np.diag(scipy.linalg.matrix_balance(joint, permute=False)[1])
    scale = scale[:n] / scale[n]
    a = system.A * scale / scale[:, None]
    return control.StateSpace(a, system.B / scale[:, None], system.C * scale, system.D)


def positive_intervals(intervals: ArrayLike) -> np.ndarray:
    """Coerce to a row of intervals in s; raises ValueError unless all are positive."""
    intervals = signal(intervals, "intervals")
    if not np.all(intervals > 0):
        raise ValueError(f"intervals down to {intervals.min()} s; they must be positive")
    return intervals
