"""Plants sampled at intervals T(k) that repeat every N samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.signals import signal

if TYPE_CHECKING:  # what takes a second to import is imported where it is used
    import control


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
    import control

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
    if delay:
        return _sample_late(scaled, intervals, delay)
    distinct, which = np.unique(intervals, return_inverse=True)
    if distinct.size == intervals.size:  # in their own order, and without a copy
        distinct, which = intervals, slice(None)
    a, b = zdomain.hold_matrices(scaled.A, scaled.B[:, 0], distinct)
    return PeriodicPlant(a[which], b[which], scaled.C[0], intervals)


def _sample_late(system: control.StateSpace, intervals: np.ndarray, delay: float) -> PeriodicPlant:
    """States [x(k), v(k-1) .. v(k-D)]: within interval k, v(k-j) acts until v(k-j+1) arrives."""
    n, period = system.nstates, intervals.size
    arrival, ages = np.full(period, delay), [np.full(period, delay)]
    while arrival.max() > 0:
        arrival = arrival - np.roll(intervals, len(ages))
        ages.append(arrival)
    past = len(ages) - 1
    first = np.clip(ages, 0, intervals)
    last = np.vstack([intervals, first[:-1]])
    j, k = np.nonzero(last > first)
    durations = [intervals, (last - first)[j, k], (intervals - last)[j, k]]
    distinct, which = np.unique(np.concatenate(durations), return_inverse=True)
    moves, inputs = zdomain.hold_matrices(system.A, system.B[:, 0], distinct)
    whole, acting, rest = np.split(which, [period, period + k.size])
    acts = (moves[rest] @ inputs[acting, :, None])[:, :, 0]
    a, b = np.zeros((period, n + past, n + past)), np.zeros((period, n + past))
    a[:, :n, :n] = moves[whole]
    a[:, n + 1 :, n:-1] = np.eye(past - 1)
    b[:, n] = 1.0
    now = j == 0
    b[k[now], :n] = acts[now]
    a[k[~now], :n, n + j[~now] - 1] = acts[~now]
    return PeriodicPlant(a, b, np.append(system.C[0], np.zeros(past)), intervals)


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
    import control

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
