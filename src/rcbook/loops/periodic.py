"""Repetitive loops that repeat every N samples: plants sampled at T(k), compensators to match.

Signals, with the symbols used throughout::

    e(k) = r(k) - y(k) - noise(k)
    w(k) = u(k-L) + e(k),    u(k) = sum_i q_i(k) w(k-N+L+i)      memory of one period
    v(k) = gain sum_j c_j(k) u(k-j)                              compensator, N-periodic taps
    x(k+1) = A(k) x(k) + B(k) v(k),    y(k) = C x(k)             plant sampled at T(k)

With K for the N-periodic operator q (1 - z^L G_c G_p), which looks a few samples ahead and
forgets soon, the loop is u = z^-N K u: K acts once per period.  A multiplier m of the loop has a
solution that repeats N samples later m times as large, so (m - K) u = 0 on such sequences.  That
is a problem of the small order of plant, compensator and q, not of N; three ways to judge
stability follow from it:

=============== ===================================================== =========================
method          answers                                               certificate
=============== ===================================================== =========================
`energy_gain`   stable, when K shrinks the energy of every sequence   sufficient; a storage
                                                                      function was computed
`count_outside` stable or unstable: multipliers beyond a circle       steps and rounding are
                                                                      checked, else undecided
`multipliers`   all of them, from the dense one-period matrix         none: rounding grows with
                                                                      the growth of its powers
=============== ===================================================== =========================

Source: Hanson and Tsao (2000), eqs 1-13 and appendix.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import control
import numpy as np
import scipy.linalg
import scipy.sparse
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.sparse.linalg import LinearOperator, splu

from rcbook import zdomain
from rcbook.signals import signal

_ALL_ZEROS = 1e-9  # a radius below which no sampled zero is cancelled
_RUN_IN = 400  # samples before the period in which the elimination settles
_CHANGE = 0.1  # of a factor, relative, that is tolerated when the data change by 1e-10
_STEP = 0.5  # of a factor from one point of the circle to the next, rad or relative
_AT_ONCE = 16  # points; larger products are threaded, which takes longer than they do
_NEAR = 1e-3  # relative distance of the points that give a slope; closer, rounding drowns it


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
    intervals = _intervals(intervals)
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
    intervals = _intervals(intervals)
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


def _intervals(intervals: ArrayLike) -> np.ndarray:
    intervals = signal(intervals, "intervals")
    if not np.all(intervals > 0):
        raise ValueError(f"intervals down to {intervals.min()} s; they must be positive")
    return intervals


# ---- compensators ----


@dataclass(frozen=True, eq=False)
class Compensator:
    """Taps of an N-periodic filter and the advance L it is meant for.

    taps[k, j], shape (N, m), multiplies the input of j samples ago at the output time k.
    """

    taps: np.ndarray
    advance: int  # L, samples

    def __post_init__(self) -> None:
        taps = np.array(self.taps, dtype=float)
        if taps.ndim != 2 or taps.size == 0 or not np.all(np.isfinite(taps)):
            raise ValueError(f"taps of shape {taps.shape}; give a finite row per sample")
        taps.setflags(write=False)
        object.__setattr__(self, "taps", taps)
        object.__setattr__(self, "advance", zdomain.whole_number(self.advance, "advance L", 1))

    def shifted(self, by: int) -> Compensator:
        """The taps of sample k + by, used at k."""
        by = (1 if by >= 0 else -1) * zdomain.whole_number(abs(by), "by", 0)
        return Compensator(np.roll(self.taps, -by, axis=0), self.advance)

    def by_input_time(self) -> Compensator:
        """Row k, used for the input of sample k at all later times, instead of at output time k."""
        rows = np.arange(len(self.taps))[:, None] - np.arange(self.taps.shape[1])
        return Compensator(
            np.take_along_axis(self.taps, rows % len(self.taps), axis=0), self.advance
        )


def zero_phase(system: control.StateSpace, intervals: ArrayLike) -> Compensator:
    """Zero-phase inverse for each interval: row k inverts the plant as sampled at T(k) throughout.

    All zeros are kept, so the filter is finite: A(z^-1) z^-m B(z) / (sum |b_i|)^2, L = d + m.
    With the nominal interval N times this is the design on the nominal model.
    Source: Hanson and Tsao (2000), eqs 11-13.
    Raises ValueError for intervals that are not positive, and as `zdomain.zero_order_hold` does.
    """
    scaled = balanced(system)
    distinct, which = np.unique(_intervals(intervals), return_inverse=True)
    inverses = [
        zdomain.zero_phase_inverse(
            zdomain.zero_order_hold(scaled, interval), _ALL_ZEROS, normalisation="l1"
        )
        for interval in distinct
    ]
    advances = {inverse.advance for inverse in inverses}
    if len(advances) > 1:
        raise ValueError(f"L = {sorted(advances)} differs between intervals; choose others")
    taps = np.array([inverse.b / inverse.a[0] for inverse in inverses])
    return Compensator(taps[which], advances.pop())


def least_squares(
    plant: PeriodicPlant,
    taps: int,
    advance: int,
    horizon: int = 400,
    frozen: bool = False,
    at_output: bool = False,
) -> Compensator:
    """Taps d_j(k) for an impulse that enters at k, so that the plant answers best by 1 at k + L.

    The taps of an entry minimise sum_l (delta(l-L) - h(k+l, k))^2 over l = 0 .. horizon, on their
    own; the j-th of them is used at k + j.  Two variants that are other designs: `at_output` uses
    all taps of k at the output time k, and `frozen` sees the plant of T(k) at all times.
    Source: Omata, Hara and Nakano (1985); Hanson and Tsao (2000), eq. 5.
    Raises ValueError for a horizon below L or the number of taps.
    """
    taps, advance = zdomain.whole_number(taps, "taps"), zdomain.whole_number(advance, "advance L")
    horizon = zdomain.whole_number(horizon, "horizon", max(taps, advance), "look further")
    table = _impulse_table(plant, horizon, frozen)
    answers = np.zeros((plant.period, horizon + 1, taps))
    for j in range(taps):
        entered = table if frozen else np.roll(table, -j, axis=1)
        answers[:, j:, j] = entered[: horizon + 1 - j].T
    rows = Compensator(np.linalg.pinv(answers, rcond=1e-14)[:, :, advance], advance)
    return rows if at_output else rows.by_input_time()


def _impulse_table(plant: PeriodicPlant, horizon: int, frozen: bool) -> np.ndarray:
    """Output at k + l after an impulse that enters at k: row l, column k."""
    table = np.zeros((horizon + 1, plant.period))
    state = plant.b
    for lag in range(1, horizon + 1):
        table[lag] = state @ plant.c
        a = plant.a if frozen else np.roll(plant.a, -lag, axis=0)
        state = (a @ state[:, :, None])[:, :, 0]
    return table


# ---- the loop ----


@dataclass(frozen=True, eq=False)
class PeriodicLoop:
    """A periodic plant with a repetitive controller of the same period round it.

    q holds the 2 h + 1 taps of a filter that looks h samples to either side, the one for the
    earliest sample first: one row of them for all samples, or (N, 2 h + 1), one for each.
    Raises ValueError when the periods differ, q has no middle tap, or what looks ahead does not
    fit into the period: N > L + h.
    """

    plant: PeriodicPlant
    compensator: Compensator
    q: np.ndarray = field(default_factory=lambda: np.ones(1))
    gain: float = 1.0

    def __post_init__(self) -> None:
        n, q = self.period, np.array(self.q, dtype=float)
        object.__setattr__(self, "gain", zdomain.real_number(self.gain, "gain"))
        if len(self.compensator.taps) != n:
            raise ValueError(
                f"the compensator has {len(self.compensator.taps)} rows of taps and the plant "
                f"repeats every {n} samples; design both for the same intervals"
            )
        fits = q.ndim in (1, 2) and q.shape[-1] % 2 == 1 and (q.ndim == 1 or len(q) == n)
        if not fits or not np.all(np.isfinite(q)):
            raise ValueError(f"q of shape {q.shape}: give an odd number of taps, or {n} such rows")
        q = np.broadcast_to(q, (n, q.shape[-1]))
        object.__setattr__(self, "q", q)
        if n <= self.advance + self.half:
            raise ValueError(
                f"the loop looks {self.advance + self.half} samples ahead, which a period of {n} "
                "cannot hold; sample faster"
            )

    @property
    def period(self) -> int:
        """N, samples per period."""
        return self.plant.period

    @property
    def advance(self) -> int:
        """L, samples of look-ahead of the compensator."""
        return self.compensator.advance

    @property
    def half(self) -> int:
        """h, samples of look-ahead of q."""
        return self.q.shape[1] // 2

    @property
    def taps(self) -> np.ndarray:
        """(N, m) taps of the compensator, the gain included."""
        return self.gain * self.compensator.taps


@dataclass(frozen=True, eq=False)
class _Period:
    """One period of the recursion as a unit lower triangular sparse system.

    timeline = [state | u(0), w(0), v(0), x(1), u(1), ...]; lower @ now + past @ state = input.
    The state is [x(0), u(-reach) .. u(-1), w(-memory) .. w(-1)].
    """

    solver: object
    past: scipy.sparse.csr_array
    last: np.ndarray  # where in the timeline the next state stands
    order: int
    reach: int
    memory: int
    step: int
    length: int

    @property
    def size(self) -> int:
        return self.order + self.reach + self.memory

    def run(self, state: np.ndarray, drive: np.ndarray | None = None) -> np.ndarray:
        """Timeline (size + N step, columns) from a state and what is added to w."""
        right = -(self.past @ state)
        if drive is not None:
            right[1 :: self.step] += drive
        return np.concatenate([state, self.solver.solve(right)])

    def transposed(self, state: np.ndarray) -> np.ndarray:
        """The transpose of state -> next state."""
        spread = np.zeros((self.size + self.length, *state.shape[1:]))
        spread[self.last] = state
        back = self.solver.solve(spread[self.size :], trans="T")
        return spread[: self.size] - self.past.T @ back


def _one_period(loop: PeriodicLoop) -> _Period:
    n, size = loop.period, loop.plant.order
    reach = max(loop.advance, loop.taps.shape[1] - 1)
    memory = n - loop.advance + loop.half
    head, step, k = size + reach + memory, size + 3, np.arange(n)

    def u(j):
        return np.where(j < 0, size + reach + j, head + step * j)

    def w(j):
        return np.where(j < 0, head + j, head + step * j + 1)

    def x(j):
        first = np.where(j == 0, 0, head + step * (j - 1) + 3)
        return first[..., None] + np.arange(size)

    rows, cols, values = [], [], []

    def put(row, col, value):
        row, col, value = np.broadcast_arrays(row, col, value)
        rows.append(row.ravel()), cols.append(col.ravel()), values.append(value.ravel())

    at_x = step * k[:, None] + 3 + np.arange(size)
    put(np.arange(n * step), head + np.arange(n * step), 1.0)
    for i in range(-loop.half, loop.half + 1):
        put(step * k, w(k - n + loop.advance + i), -loop.q[:, loop.half + i])
    put(step * k + 1, u(k - loop.advance), -1.0)
    put(step * k[:, None] + 1, x(k), loop.plant.c)
    for j in range(loop.taps.shape[1]):
        put(step * k + 2, u(k - j), -loop.taps[:, j])
    put(at_x, head + step * k[:, None] + 2, -loop.plant.b)
    put(at_x[:, :, None], x(k)[:, None, :], -loop.plant.a)
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(cols)))
    whole = scipy.sparse.coo_array(entries, shape=(n * step, head + n * step)).tocsc()
    solver = splu(whole[:, head:], permc_spec="NATURAL", diag_pivot_thresh=0.0)
    last = [x(np.array(n)), u(np.arange(n - reach, n)), w(np.arange(n - memory, n))]
    return _Period(
        solver, whole[:, :head].tocsr(), np.concatenate(last), size, reach, memory, step, n * step
    )


def one_period_map(loop: PeriodicLoop) -> LinearOperator:
    """State at sample 0 to state at sample N, without input; O(N) work, transpose included.

    The state is [x(0), u(-reach) .. u(-1), w(-memory) .. w(-1)], with reach = max(L, m - 1) and
    memory = N - L + h: what the loop remembers, each number once.
    """
    once = _one_period(loop)

    def forward(state: np.ndarray) -> np.ndarray:
        return once.run(state)[once.last]

    return LinearOperator(
        (once.size, once.size),
        matvec=forward,
        matmat=forward,
        rmatvec=once.transposed,
        rmatmat=once.transposed,
        dtype=float,
    )


@dataclass(frozen=True, eq=False)
class PeriodicRun:
    """Signals of a simulation of one sample after the other; cut where it left all bounds."""

    intervals: np.ndarray  # s
    reference: np.ndarray
    output: np.ndarray
    repetitive: np.ndarray  # u, what the compensator filters
    command: np.ndarray  # v, what the plant gets
    error: np.ndarray  # reference minus output, without measurement noise
    unbounded: bool

    @property
    def time(self) -> np.ndarray:
        """Sampling instants in s."""
        return np.concatenate([[0.0], np.cumsum(self.intervals)[:-1]])


def simulate(
    loop: PeriodicLoop,
    reference: ArrayLike,
    noise: ArrayLike | None = None,
    bound: float = 1e9,
) -> PeriodicRun:
    """Run the loop from rest; it stops when a signal exceeds `bound` times the largest input.

    reference and noise, on the measured output, hold whole periods.
    Raises ValueError when they do not, or differ in length.
    """
    r = signal(reference, "reference")
    noise = np.zeros(r.size) if noise is None else signal(noise, "noise", r.size)
    if r.size % loop.period:
        raise ValueError(f"{r.size} samples are not whole periods of {loop.period}; add some")
    once = _one_period(loop)
    limit = zdomain.real_number(bound, "bound", positive=True) * np.abs([r, noise]).max()
    state, rows, n = np.zeros(once.size), [], loop.period
    for drive in (r - noise).reshape(-1, n):
        timeline = once.run(state, drive)
        now, before = timeline[once.size :].reshape(n, once.step), timeline[: once.order]
        x = np.concatenate([before[None], now[:-1, 3:]])
        rows.append(np.column_stack([now[:, 0], now[:, 2], x @ loop.plant.c]))
        state = timeline[once.last]
        if not np.abs(rows[-1]).max() <= limit:
            break
    u, v, y = np.concatenate(rows).T
    inside = np.abs([u, v, y]).max(axis=0) <= limit
    end = u.size if inside.all() else int(np.argmin(inside))
    r = r[:end]
    intervals = np.resize(loop.plant.intervals, end)
    return PeriodicRun(intervals, r, y[:end], u[:end], v[:end], r - y[:end], end < u.size)


# ---- lifted matrices ----


def closed_loop_matrix(loop: PeriodicLoop, k: int) -> np.ndarray:
    """State matrix of sample k with every delay written out, states [G_NL, G_L, G_c, G_p].

    It has N + h rows for the two parts of the generator, m - 1 for the compensator and n for the
    plant.  Source: Hanson and Tsao (2000), eqs 6-8; with q as described in their section 4.
    """
    n, half, size = loop.period, loop.half, loop.plant.order
    long, short, filter = n - loop.advance + half, loop.advance, loop.taps.shape[1] - 1
    k = k % n
    q_long, taps = np.zeros(long), loop.taps[k]
    q_long[n - loop.advance - half - 1 :] = loop.q[k, ::-1]
    a, b, c = loop.plant.a[k], loop.plant.b[k], loop.plant.c
    at_long, at_short = slice(0, long), slice(long, long + short)
    at_filter = slice(long + short, long + short + filter)
    at_plant = slice(long + short + filter, None)
    matrix = np.zeros((long + short + filter + size,) * 2)
    for part in (at_long, at_short, at_filter):
        length = part.stop - part.start
        matrix[part, part] = np.eye(length, k=-1)
    matrix[0, at_short.stop - 1] = 1.0
    matrix[0, at_plant] = -c
    for first in (at_short.start, at_filter.start)[: 2 if filter else 1]:
        matrix[first, at_long] = q_long
    matrix[at_plant, at_long] = np.outer(taps[0] * b, q_long)
    matrix[at_plant, at_filter] = np.outer(b, taps[1:])
    matrix[at_plant, at_plant] = a
    return matrix


Multiply = Callable[[np.ndarray, np.ndarray], np.ndarray]


def multiplications(left: np.ndarray, right: np.ndarray) -> int:
    """Multiplications of numbers in the product of two full matrices."""
    return left.shape[0] * left.shape[1] * right.shape[1]


def product_of_matrices(loop: PeriodicLoop, multiply: Multiply = np.matmul) -> np.ndarray:
    """Product of the N closed-loop matrices, by brute force: O(N^4) work.

    `multiply` may count what it does.  Source: Hanson and Tsao (2000), eq. 10.
    """
    product = closed_loop_matrix(loop, 0)
    for k in range(1, loop.period):
        product = multiply(closed_loop_matrix(loop, k), product)
    return product


def lift(loop: PeriodicLoop) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A, B, C and D of compensator and plant over one period, states [G_c, G_p].

    Column j of B and D is the answer to a unit input of sample j, formed recursively in O(N^2).
    Source: Hanson and Tsao (2000), eqs 7 and A1-A7.
    """
    n, filter, size = loop.period, loop.taps.shape[1] - 1, loop.plant.order
    states = filter + size
    state = np.concatenate([np.eye(states), np.zeros((states, n))], axis=1)
    outputs = np.zeros((n, states + n))
    for k in range(n):
        plant = state[filter:]
        outputs[k] = loop.plant.c @ plant
        command = loop.taps[k, 1:] @ state[:filter]
        command[states + k] += loop.taps[k, 0]
        moved = loop.plant.a[k] @ plant + np.outer(loop.plant.b[k], command)
        entered = np.zeros((filter, states + n))
        entered[1:] = state[: max(filter - 1, 0)]
        if filter:
            entered[0, states + k] = 1.0
        state = np.concatenate([entered, moved])
    return state[:, :states], state[:, states:], outputs[:, :states], outputs[:, states:]


def lift_by_products(
    loop: PeriodicLoop, block: str, multiply: Multiply = np.matmul, carried: bool = False
) -> np.ndarray:
    """Block "A", "B", "C" or "D" of `lift`, as the paper forms it: from products of matrices.

    Each entry forms its own transition matrix, or, `carried`, prolongs that of the one before.
    `multiply` may count what it does.  Source: Hanson and Tsao (2000), eqs 7 and A3-A7.
    Raises ValueError for another block.
    """
    a, b, c, d = _compensated_plant(loop)
    n = loop.period
    if block == "A":
        return _products(a, multiply, carried=True)[-1]
    if block == "B":
        back = _products([each.T for each in a[:0:-1]], multiply, carried)
        return np.hstack([*(multiply(back[n - 2 - k].T, b[k]) for k in range(n - 1)), b[-1]])
    if block == "C":
        ahead = _products(a[:-1], multiply, carried)
        return np.vstack([c[0], *(multiply(c[k], ahead[k - 1]) for k in range(1, n))])
    if block != "D":
        raise ValueError(f"block {block!r} is none of A, B, C, D")
    answers = np.diag(d)
    for entered in range(n - 1):
        ahead = _products(a[entered + 1 : -1], multiply, carried)
        states = [b[entered], *(multiply(product, b[entered]) for product in ahead)]
        for k, state in enumerate(states, entered + 1):
            answers[k, entered] = multiply(c[k], state)[0, 0]
    return answers


def _products(matrices: list[np.ndarray], multiply: Multiply, carried: bool) -> list[np.ndarray]:
    """matrices[i] .. matrices[0] for each i."""
    found: list[np.ndarray] = []
    for i, newest in enumerate(matrices):
        if carried and found:
            found.append(multiply(newest, found[-1]))
            continue
        product = matrices[0]
        for following in matrices[1 : i + 1]:
            product = multiply(following, product)
        found.append(product)
    return found


def _compensated_plant(loop: PeriodicLoop) -> tuple[list, list, list, list]:
    """A2, B2, C2, D2 of eq. 7 at each sample, states [G_c, G_p]."""
    filter, size = loop.taps.shape[1] - 1, loop.plant.order
    parts: tuple[list, list, list, list] = ([], [], [], [])
    for k in range(loop.period):
        a = np.zeros((filter + size,) * 2)
        a[:filter, :filter] = np.eye(filter, k=-1)
        a[filter:, :filter] = np.outer(loop.plant.b[k], loop.taps[k, 1:])
        a[filter:, filter:] = loop.plant.a[k]
        b = np.concatenate([np.eye(filter)[:1].ravel(), loop.plant.b[k] * loop.taps[k, 0]])
        c = np.concatenate([np.zeros(filter), loop.plant.c])
        for part, value in zip(parts, (a, b[:, None], c[None], 0.0), strict=True):
            part.append(value)
    return parts


def lifted(
    loop: PeriodicLoop, multiply: Multiply = np.matmul, carried: bool | None = None
) -> np.ndarray:
    """One-period matrix of [G_c, G_p, u(0) .. u(N-1)] from the lifted blocks: O(N^3) work.

    The blocks are those of `lift`, or for a `carried` of True or False of `lift_by_products`.
    Source: Hanson and Tsao (2000), eqs A8-A16, with A2 and B2 in A14 and D2 in A15 and A16.
    Raises ValueError when the loop has a q other than 1, which the appendix does not treat.
    """
    if loop.half or not np.all(loop.q == 1):
        raise ValueError(f"q = {loop.q[0]}: the appendix has no q; use one_period_map")
    if carried is None:
        a, b, c, d = lift(loop)
    else:
        a, b, c, d = (lift_by_products(loop, block, multiply, carried) for block in "ABCD")
    ahead, late = loop.advance, loop.period - loop.advance

    def early(block: np.ndarray) -> np.ndarray:  # S^L: rows moved up
        return np.concatenate([block[ahead:], np.zeros_like(block[:ahead])])

    def delayed(block: np.ndarray) -> np.ndarray:  # D^(N-L): rows moved down
        return np.concatenate([np.zeros_like(block[:late]), block[:ahead]])

    m1 = -early(c) - delayed(multiply(c, a))
    m2 = np.eye(loop.period) - early(d) - delayed(multiply(c, b))
    lower, below = np.concatenate([m1, m2], axis=1), delayed(d)
    for k in range(late + 1, loop.period):  # the rows above stand alone
        lower[k] -= multiply(below[k : k + 1, :k], lower[:k])[0]
    return np.block([[a, b], [lower]])


def multipliers(loop: PeriodicLoop) -> np.ndarray:
    """All eigenvalues of the dense one-period matrix, by decreasing magnitude.

    Not certified: a change of the matrix by its rounding can move them by that times the growth
    of its powers; compare those of the transpose, and `transient_growth`.
    """
    values = np.linalg.eigvals(dense(loop))
    return values[np.argsort(-np.abs(values), kind="stable")]


def dense(loop: PeriodicLoop) -> np.ndarray:
    """The one-period map as a matrix, N applications of O(N) work."""
    operator = one_period_map(loop)
    return operator.matmat(np.eye(operator.shape[0]))


# ---- stability at any period ----


def _filters(loop: PeriodicLoop) -> tuple[int, int, int]:
    """p = L + h, what K looks ahead; m' inputs and 2 h outputs, what its causal form remembers."""
    ahead = loop.advance + loop.half
    return ahead, max(loop.taps.shape[1] - 1, ahead + loop.half), 2 * loop.half


def _causal(loop: PeriodicLoop) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """z^-p K, p = L + h, sample by sample: s(k+1) = matrix s + entry u(k), output row s.

    State s = [x(k), u(k-1) .. u(k-m'), y(k-1) .. y(k-2h)].
    """
    ahead, inputs, outputs = _filters(loop)
    plant, taps, half = loop.plant, loop.taps, loop.half
    n, period = plant.order, loop.period
    at_y = n + inputs
    shifts = np.eye(at_y + outputs, k=-1)
    shifts[n] = 0.0
    if outputs:
        shifts[at_y], shifts[at_y, :n] = 0.0, plant.c
    for k in range(period):
        matrix, entry, row = shifts.copy(), np.zeros(at_y + outputs), np.zeros(at_y + outputs)
        matrix[:n] = 0.0
        matrix[:n, :n] = plant.a[k]
        matrix[:n, n : n + taps.shape[1] - 1] = np.outer(plant.b[k], taps[k, 1:])
        entry[:n], entry[n] = plant.b[k] * taps[k, 0], 1.0
        q = loop.q[(k - ahead) % period]
        row[:n] = -q[-1] * plant.c
        row[n + loop.advance - 1 : n + ahead + half] = q[::-1]
        row[at_y:] = -q[:-1][::-1]
        yield matrix, entry, row


def _factors(loop: PeriodicLoop, points: np.ndarray) -> np.ndarray:
    """Factors (N + 1, points) whose product is +-det(point - M)/point^states, M the one-period map.

    Block elimination of (point - K) u = 0 with the twist u(k+N) = point u(k): unknown u(t-p) is
    taken out by the row that holds point u(t-p), for t = 0 .. N-1.  The last factor closes the
    circle.
    """
    sweep = _Sweep(loop)
    parts = [_swept(sweep, points[i : i + _AT_ONCE]) for i in range(0, points.size, _AT_ONCE)]
    return np.concatenate(parts, axis=1)


def _swept(sweep: _Sweep, points: np.ndarray) -> np.ndarray:
    n, ahead, states, number = sweep.order, sweep.ahead, sweep.states, points.size
    rest, window = np.r_[0:n, n + ahead : states], np.arange(ahead)
    start = _run_in(sweep, points)[rest]
    basis = np.zeros((states + ahead, ahead + rest.size, number), dtype=complex)
    basis[n + ahead - 1 - window, window] = 1.0
    basis[states + window, window] = 1.0  # u(-p) .. u(-1), to close the circle with
    basis[rest, :ahead] = start
    basis[rest, ahead + np.arange(rest.size)] = 1.0
    factors = np.empty((sweep.period + 1, number), dtype=complex)
    for k in range(sweep.period):
        factors[k], basis = sweep.eliminate(k, points, basis)
    closing = np.zeros((basis.shape[1],) * 2 + (number,), dtype=complex)
    closing[: rest.size] = -basis[rest]
    closing[: rest.size, :ahead] += start
    closing[np.arange(rest.size), ahead + np.arange(rest.size)] += points
    closing[rest.size :] = points * basis[states:]
    closing[rest.size + window, window] -= 1.0
    factors[-1] = np.linalg.det(np.moveaxis(closing, 2, 0)) / points**rest.size
    factors[:-1] /= points
    return factors


def _run_in(sweep: _Sweep, points: np.ndarray) -> np.ndarray:
    """A state as combination of u(-p) .. u(-1) that the elimination has settled on.

    Any choice would do; this one spares the first factors a start from nothing, which is singular
    for q = 1 at 1.  It comes from further out, where the elimination is well posed.
    """
    n, ahead = sweep.order, sweep.ahead
    window, length = np.arange(ahead), min(sweep.period, _RUN_IN)
    basis = np.zeros((sweep.states, ahead, points.size), dtype=complex)
    basis[n + ahead - 1 - window, window] = 1.0
    outside = points * (1 + 2 / np.abs(points))
    for k in range(-length, 0):
        basis = sweep.eliminate(k, outside if 2 * k < -length else points, basis)[1]
    return basis


class _Sweep:
    """Elimination of one unknown after the other, for many points at once."""

    def __init__(self, loop: PeriodicLoop) -> None:
        self.ahead, inputs, outputs = _filters(loop)
        self.order, self.period = loop.plant.order, loop.period
        self.at_y = self.order + inputs
        self.states = self.at_y + outputs
        # next x, the equation, and y where it is remembered, in one product
        y = [np.pad(loop.plant.c, (0, self.states - self.order))] * (outputs > 0)
        self.samples = [
            (np.array([*matrix[: self.order], row, *y]), entry)
            for matrix, entry, row in _causal(loop)
        ]

    def eliminate(
        self, k: int, points: np.ndarray, basis: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pivot and the next basis; columns are u(k-p) .. u(k-1) and then what else there is."""
        n, at_y, states, last = self.order, self.at_y, self.states, self.ahead - 1
        rows, entry = self.samples[k % self.period]
        found = _times(rows, basis[:states])
        equation = -found[n]
        equation[0] += points
        later = np.concatenate(
            [
                found[:n],
                np.zeros_like(found[:1]),
                basis[n : at_y - 1],
                found[n + 1 :],
                basis[at_y : states - 1],
                basis[states:],
            ]
        )
        left = later[:, 1:] - later[:, :1] * (equation[1:] / equation[0])
        entered = np.zeros((len(basis), 1, points.size))
        entered[:states, 0] = entry[:, None]
        return equation[0], np.concatenate([left[:, :last], entered, left[:, last:]], axis=1)


def _times(matrix: np.ndarray, stack: np.ndarray) -> np.ndarray:
    """matrix @ stack over the first axis of a stack."""
    flat = stack.reshape(stack.shape[0], -1)
    return (matrix.astype(complex) @ flat).reshape(len(matrix), *stack.shape[1:])


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
        factors, slopes = _follow(loop, radius, angles)
        change = _change(loop, radius * np.exp(1j * angles), factors)
        steps = _steps(angles, factors, slopes)
        while change <= _CHANGE and steps.max() > _STEP and angles.size < most_points:
            wide = np.flatnonzero(steps > _STEP)
            between = (angles[wide] + angles[wide + 1]) / 2
            found, inclined = _follow(loop, radius, between)
            factors = np.insert(factors, wide + 1, found, axis=1)
            slopes = np.insert(slopes, wide + 1, inclined)
            angles = np.insert(angles, wide + 1, between)
            steps = _steps(angles, factors, slopes)
        turns = -np.angle(factors[:, 1:] / factors[:, :-1]).sum() / np.pi
        whole = abs(turns - np.round(turns)) < 1e-3
    certified = change <= _CHANGE and steps.max() <= _STEP and whole
    outside = round(turns) if certified else None
    return Count(radius, outside, angles.size, float(steps.max()), change)


def _follow(loop: PeriodicLoop, radius: float, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Factors on a circle, and at each point the largest relative slope of any of them."""
    points = radius * np.exp(1j * angles)
    near, far = _factors(loop, points), _factors(loop, points * (1 + _NEAR))
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

    plant, compensator = loop.plant, loop.compensator
    other = PeriodicLoop(
        replace(plant, a=shaken(plant.a), b=shaken(plant.b)),
        replace(compensator, taps=shaken(compensator.taps)),
        shaken(loop.q),
        loop.gain,
    )
    change = np.abs(_factors(other, points) / factors - 1).max()
    return float(change) if np.isfinite(change) else np.inf


def spectral_radius(loop: PeriodicLoop, width: float = 1e-3) -> tuple[float, float]:
    """Bounds of the spectral radius of the one-period map, from counts outside of circles.

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


def energy_gain(loop: PeriodicLoop, width: float = 1e-3) -> float:
    """Upper bound, to `width`, of how K amplifies the root of the energy of any sequence.

    Below one the loop of a stable plant is stable, and the memory shrinks by it from period to
    period.  Infinite when it exceeds 16.
    """
    low, high = 0.0, 16.0
    if not _dissipates(loop, np.array([high]))[0]:
        return np.inf
    while high - low > width:
        levels = np.linspace(low, high, 10)[1:-1]
        below = levels[~_dissipates(loop, levels)]
        above = levels[levels > below.max(initial=0.0)]
        low, high = below.max(initial=low), above.min(initial=high)
    return float(high)


def _dissipates(loop: PeriodicLoop, levels: np.ndarray, samples: int = 5000) -> np.ndarray:
    """Whether a storage function shows K to amplify energy by less than levels^2.

    It is the limit of a Riccati recursion backward in time (bounded real lemma); a level whose
    recursion breaks down, or has not settled after so many samples, and ten periods, gets a no.
    """
    steps = list(_causal(loop))
    states = steps[0][1].size
    storage, good = np.zeros((levels.size, states, states)), np.ones(levels.size, dtype=bool)
    for _ in range(10 + samples // loop.period):
        before = storage
        for matrix, entry, row in reversed(steps):
            pulled = storage @ entry
            room = levels**2 - pulled @ entry
            good &= room > 0
            cross = pulled @ matrix
            share = cross / np.where(room > 0, room, np.inf)[:, None]
            storage = matrix.T @ storage @ matrix + row[:, None] * row
            storage += cross[:, :, None] * share[:, None, :]
        moved = np.linalg.norm(storage - before, axis=(1, 2))
        settled = moved <= 1e-9 * np.linalg.norm(storage, axis=(1, 2))
        if np.all(settled | ~good):
            break
    return good & settled


@dataclass(frozen=True)
class Verdict:
    """What is known about the stability of a loop, and on what grounds."""

    verdict: str  # "stable", "unstable" or "undecided"
    method: str
    certificate: str
    outside: int | None  # multipliers of magnitude above one, where known

    def __str__(self) -> str:
        return f"{self.verdict} ({self.method}: {self.certificate})"


def decide(loop: PeriodicLoop) -> Verdict:
    """Stable, unstable or undecided, at any period, in O(N) work.

    "stable" by `energy_gain` below one needs no multipliers; else they are counted on the unit
    circle.  "undecided" means that rounding in the data moves multipliers across it: the powers
    of the one-period map then grow far before they decay, if they do; see `transient_growth`.
    """
    if _plant_decays(loop.plant) and _dissipates(loop, np.array([1.0 - 1e-6]))[0]:
        grounds = "a storage function shows that every period shrinks the energy of u"
        return Verdict("stable", "energy", grounds, 0)
    found = count_outside(loop)
    grounds = (
        f"{found.points} points of the half circle, largest step {found.largest_step:.2g}, "
        f"largest change {found.largest_change:.1g} for data changed by 1e-10"
    )
    if found.outside is None:
        return Verdict("undecided", "count", grounds, None)
    return Verdict("unstable" if found.outside else "stable", "count", grounds, found.outside)


def _plant_decays(plant: PeriodicPlant) -> bool:
    """Whether the plant by itself forgets its state, seen at the output or not."""
    product = np.eye(plant.order)
    with np.errstate(over="ignore", invalid="ignore"):
        for a in plant.a:
            product = a @ product
    return bool(np.all(np.isfinite(product)) and np.abs(np.linalg.eigvals(product)).max() < 1)


def first_crossing(
    function: Callable[[float], float], edges: Sequence[float], precision: float = 1e-7
) -> float:
    """Where `function` first reaches zero from below: searched from edge to edge, then a root.

    It is the first edge where the function is not below zero there, and infinite where it stays
    below at all of them; what happens between two edges can be missed.
    Raises ValueError for fewer than two edges or edges that do not ascend.
    """
    if len(edges) < 2 or not np.all(np.diff(edges) > 0):
        raise ValueError(f"edges = {list(edges)}: give two or more, in ascending order")
    if function(edges[0]) >= 0:
        return float(edges[0])
    for low, high in pairwise(edges):
        if function(high) >= 0:
            return float(brentq(function, low, high, xtol=precision))
    return np.inf


# ---- companions of a verdict ----


def transient_growth(loop: PeriodicLoop, periods: ArrayLike, iterations: int = 12) -> np.ndarray:
    """How far the content of the memory can grow in j periods, for each j of `periods`.

    Largest ||w after|| / ||w before|| from a plant at rest: the norm of the w rows and columns of
    the j-th power of the one-period map, by power iteration on it times its transpose.  Every
    value is attained by a signal that was run, hence a lower bound; iterations bring it up.
    """
    once, iterations = _one_period(loop), zdomain.whole_number(iterations, "iterations")
    memory, growth = slice(once.order + once.reach, None), []
    for j in np.ravel(periods):
        j = zdomain.whole_number(float(j), "periods")
        state = np.zeros(once.size)
        state[memory] = np.random.default_rng(0).standard_normal(once.memory)
        best = 0.0
        for _ in range(iterations):
            state /= np.linalg.norm(state)
            for _ in range(j):
                state = once.run(state)[once.last]
            state[: memory.start] = 0.0
            best = max(best, float(np.linalg.norm(state)))
            if not 0 < best < 1e100:
                break
            for _ in range(j):
                state = once.transposed(state)
            state[: memory.start] = 0.0
        growth.append(best)
    return np.array(growth)


def noise_gain(loop: PeriodicLoop, output: str = "output") -> float:
    """Stationary standard deviation per unit of white measurement noise, rms over the period.

    `output` is "output", "repetitive" (u) or "measured_error", which holds the noise itself: the
    output of a sample knows nothing yet of the noise of that sample, so their variances add.
    The covariance of the state is summed by doubling, with dense matrices, until what is added
    is below 1e-11 of it: up to some two thousand samples per period.
    Raises ValueError when the sum does not settle, and for a longer period.
    """
    if output not in ("output", "repetitive", "measured_error"):
        raise ValueError(f"output {output!r}: choose 'output', 'measured_error' or 'repetitive'")
    if loop.period > 2500:
        raise ValueError(f"period {loop.period}: too long for dense matrices; simulate with noise")
    ends, seen = _answers(loop, repetitive=output == "repetitive")
    states = len(ends)
    power, entry = ends[:, :states], ends[:, states:]
    covariance = entry @ entry.T
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(60):
            added = power @ covariance @ power.T
            covariance = covariance + added
            if not np.all(np.isfinite(covariance)):
                break
            if np.trace(added) <= 1e-11 * np.trace(covariance):
                free, driven = seen[:, :states], seen[:, states:]
                variance = np.sum((free @ covariance) * free) + np.sum(driven**2)
                return float(np.sqrt(variance / loop.period + (output == "measured_error")))
            power = power @ power
    raise ValueError("the response to noise does not settle: the loop is not stable")


def _answers(loop: PeriodicLoop, repetitive: bool) -> tuple[np.ndarray, np.ndarray]:
    """One period from every unit state, then from a unit of noise at every sample.

    Returns the states at its end, as those of `one_period_map`, and the outputs (or u) on the way.
    """
    n, order, advance, half = loop.period, loop.plant.order, loop.advance, loop.half
    reach, memory = max(advance, loop.taps.shape[1] - 1), n - advance + half
    states = order + reach + memory
    x, u, w = np.split(np.zeros((states + 2 * n, states + n)), [order, order + reach + n])
    x[:, :order] = np.eye(order)
    u[:reach, order : order + reach] = np.eye(reach)
    w[:memory, order + reach : states] = np.eye(memory)
    seen = np.empty((n, states + n))
    for k in range(n):
        now, long = reach + k, memory + k - n + advance
        u[now] = loop.q[k] @ w[long - half : long + half + 1]
        y = loop.plant.c @ x
        w[memory + k] = u[now - advance] - y
        w[memory + k, states + k] -= 1.0
        command = loop.taps[k, ::-1] @ u[now - loop.taps.shape[1] + 1 : now + 1]
        x = loop.plant.a[k] @ x + np.outer(loop.plant.b[k], command)
        seen[k] = u[now] if repetitive else y
    return np.concatenate([x, u[-reach:], w[-memory:]]), seen


def frozen_symbol(loop: PeriodicLoop, z: ArrayLike) -> np.ndarray:
    """q (1 - z^L G_c G_p) of each sample as if it lasted, (N, points), on the unit circle.

    Where no row exceeds one in magnitude a slow enough variation is stable.  Where a row winds
    round a point outside the unit circle, the powers of the one-period map grow exponentially
    with N before they decay, wherever the multipliers are.
    """
    z = np.ravel(np.asarray(z, dtype=complex))
    plant, half = loop.plant, loop.half
    resolvent = np.linalg.inv(z[:, None, None] * np.eye(plant.order) - plant.a[:, None])
    through = np.einsum("i,kzij,kj->kz", plant.c, resolvent, plant.b)
    filtered = zdomain.evaluate(loop.taps.T, z)
    q = zdomain.evaluate(loop.q.T, z) * z**half
    return q * (1 - z**loop.advance * filtered * through)


def absolute_gain(loop: PeriodicLoop) -> float:
    """Largest sum over the input times of |impulse response| of K: below one is sufficient.

    Responses are followed until they have fallen by 1e-14.
    Source: Omata, Hara and Nakano (1985); Hanson and Tsao (2000), eqs 3-4, with q in series.
    Raises ValueError when they have not after 100 000 samples.
    """
    matrix, state, row = (np.array(part) for part in zip(*_causal(loop), strict=True))
    total, k = np.zeros(loop.period), np.arange(loop.period)
    small = 1e-14 * np.abs(state).max()
    for lag in range(1, 100_000):
        at = (k + lag) % loop.period
        total[at] += np.abs(np.sum(row[at] * state, axis=1))
        state = (matrix[at] @ state[:, :, None])[:, :, 0]
        if np.abs(state).max() <= small:
            return float(total.max())
    raise ValueError("impulse responses do not die out: the plant is not stable")


def steady_state(loop: PeriodicLoop, reference: ArrayLike) -> PeriodicRun:
    """One period of the periodic solution under a periodic reference, from one sparse solve.

    It is what a stable loop tends to, and means nothing for an unstable one, which is not checked;
    the reference holds one period.
    """
    r = signal(reference, "one period of the reference", loop.period)
    n, order, taps = loop.period, loop.plant.order, loop.taps
    k, step = np.arange(n), order + 1
    rows, cols, values = [], [], []

    def put(row, col, value):
        row, col, value = np.broadcast_arrays(row, col, value)
        rows.append(row.ravel()), cols.append(col.ravel()), values.append(value.ravel())

    at_x = step * k[:, None] + 1 + np.arange(order)
    put(step * k, step * k, 1.0)
    for i in range(-loop.half, loop.half + 1):
        q = loop.q[:, loop.half + i]
        put(step * k, step * ((k + i) % n), -q)
        put(step * k[:, None], at_x[(k + loop.advance + i) % n], q[:, None] * loop.plant.c)
    put(at_x[(k + 1) % n], at_x[(k + 1) % n], 1.0)
    put(at_x[(k + 1) % n][:, :, None], at_x[:, None, :], -loop.plant.a)
    for j in range(taps.shape[1]):
        put(at_x[(k + 1) % n], step * ((k - j) % n)[:, None], -loop.plant.b * taps[:, j, None])
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(cols)))
    matrix = scipy.sparse.coo_array(entries, shape=(n * step, n * step)).tocsc()
    right = np.zeros(n * step)
    offsets = np.arange(-loop.half, loop.half + 1)
    right[step * k] = np.sum(loop.q * r[(k[:, None] + loop.advance + offsets) % n], axis=1)
    solution = splu(matrix).solve(right).reshape(n, step)
    u, y = solution[:, 0], solution[:, 1:] @ loop.plant.c
    v = sum(taps[:, j] * np.roll(u, j) for j in range(taps.shape[1]))
    return PeriodicRun(loop.plant.intervals, r, y, u, v, r - y, False)
