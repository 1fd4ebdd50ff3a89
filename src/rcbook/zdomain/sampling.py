"""From continuous plants to sampled ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg

from rcbook.zdomain.checks import real_number
from rcbook.zdomain.plant import Plant

if TYPE_CHECKING:  # what takes a second to import is imported where it is used
    import control

_DIGIT = 256  # base in which the steps of a duration are counted, a power of 2
_BLOCK = 1024  # durations at a time, which stay in the cache


def zero_order_hold(system: control.StateSpace | control.TransferFunction, dt: float) -> Plant:
    """Sample a continuous single-input single-output plant behind a zero-order hold.

    The numerator comes from the impulse response, which keeps the digits of small leading
    coefficients.
    Raises ValueError when the plant is not continuous, not proper, zero or has several inputs or
    outputs, or dt is not positive.
    """
    dt = real_number(dt, "sampling interval dt", positive=True)
    b, a = hold_polynomials(system, np.array([dt]))
    delay = int(np.flatnonzero(b[0])[0])
    return Plant(b[0, delay:], a[0], delay, dt)


def hold_polynomials(
    system: control.StateSpace | control.TransferFunction, intervals: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Numerators and denominators in z^-1 of a plant held over each of the intervals in s.

    Shapes: both (N, n + 1); a numerator begins with as many zeros as the plant has delay.
    Raises ValueError as `zero_order_hold` does, but for intervals.
    """
    system = _single(system)
    n, c = system.nstates, system.C[0]
    matrices, state = hold_matrices(system.A, system.B[:, 0], intervals)
    a = np.zeros((n + 1, intervals.size), dtype=complex)  # a row a power: sums run along rows
    a[0] = 1
    for pole in np.linalg.eigvals(system.A):
        a[1:] -= np.exp(pole * intervals) * a[:-1]
    impulse = np.full((n + 1, intervals.size), system.D.item())
    for k in range(n):
        impulse[k + 1] = state @ c
        state = (matrices @ state[:, :, None])[:, :, 0]
    b = np.zeros_like(impulse)
    for k, coefficient in enumerate(a.real):
        b[k:] += coefficient * impulse[: n + 1 - k]
    if not np.all(b.any(axis=0)):
        raise ValueError("the plant is zero: its output does not answer to its input")
    return b.T, a.real.T


def _single(system: control.StateSpace | control.TransferFunction) -> control.StateSpace:
    """The plant in continuous state space with one input and one output, or ValueError."""
    import control

    if not system.issiso():
        raise ValueError(f"{system.ninputs} inputs, {system.noutputs} outputs; pick one of each")
    if not system.isctime():
        raise ValueError(f"the plant is sampled at dt = {system.dt!r}; give a continuous one")
    if not isinstance(system, control.TransferFunction):
        return system
    num, den = (np.trim_zeros(p[0][0], "f") for p in (system.num, system.den))
    if num.size > den.size:
        raise ValueError(f"numerator degree {num.size - 1} exceeds {den.size - 1}: improper")
    return control.ss(system)


def hold_matrices(a: np.ndarray, b: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """e^(a t), and what an input of one held over t adds to the state, at each time t in s.

    Shapes: a (n, n), b (n,), times (N,) to (N, n, n) and (N, n).  Good for any poles, since a
    Taylor series needs no eigenvectors.
    """
    n = b.size
    # States scaled by powers of 2 change no digit of a sum: it is enough to know their norm.
    norm = np.linalg.norm(scipy.linalg.matrix_balance(a, permute=False)[0], 1) if n else 0.0
    rate = np.ldexp(1.0, np.frexp(norm)[1])
    steps, moved = times * rate, np.empty((times.size, n, n + 1))
    with np.errstate(over="ignore", invalid="ignore"):  # multiples that are not needed may overflow
        series, tables = _series(np.column_stack([a, b]) / rate, steps.max(initial=0.0))
        for k in range(0, steps.size, _BLOCK):
            moved[k : k + _BLOCK] = _moved(series, tables, steps[k : k + _BLOCK])
    moved[:, range(n), range(n)] += 1.0
    return moved[:, :, :n], moved[:, :, n]


def _series(matrix: np.ndarray, longest: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Terms of e^matrix - 1, and tables of its multiples for each digit of so many steps.

    Less one, short holds keep their digits.  The matrix is [a b], a of norm 1 or less.
    """
    count = 17 + len(matrix)  # entries that begin with a high power keep their digits, too
    powers, tables = matrix[None], []
    while len(powers) < count:
        powers = np.concatenate([powers, powers[-1, :, :-1] @ powers])
    terms = powers[:count] / np.cumprod(np.arange(1.0, count + 1))[:, None, None]
    stride = terms.sum(axis=0)
    while longest >= 1:
        table = np.array([np.zeros_like(stride), stride])
        while len(table) < min(_DIGIT, longest + 1):
            table = np.concatenate([table, _after(table[1:], table[-1])])
        tables.append(table)
        stride, longest = table[-1], longest // _DIGIT
    return terms, tables


def _moved(series: np.ndarray, tables: list[np.ndarray], steps: np.ndarray) -> np.ndarray:
    """By series for the fraction of a step, then by tables for the whole ones, digit by digit."""
    whole = np.floor(steps)
    powers = (steps - whole)[:, None] ** np.arange(1, len(series) + 1)
    moved = np.tensordot(powers, series, axes=1)
    for table in tables:
        moved = _after(moved, table[np.fmod(whole, _DIGIT).astype(int)])
        whole = np.floor(whole / _DIGIT)
    return moved


def _after(first: np.ndarray, then: np.ndarray) -> np.ndarray:
    """One hold and then another, both less one."""
    return then[..., :-1] @ first + first + then


def interval_integral(system: control.StateSpace, dt: float) -> Plant:
    """From an input held over each interval to the integral of the output over that interval.

    The sum of the results is the integral since the start, so a plant behind an integrator and a
    difference (a moving average, the time that one pitch of a cutter takes) needs no pole at z = 1
    that would have to be cancelled afterwards.  Worked out mode by mode, which keeps the relative
    accuracy of coefficients however small fast poles make them.
    Raises ValueError as `modes` does, and for an output that does not answer.
    """
    dt = real_number(dt, "sampling interval dt", positive=True)
    poles, residues = modes(system)
    moved, area = dt * phi1(poles * dt), dt**2 * phi2(poles * dt)
    direct, decay = np.sum(residues * area), np.exp(poles * dt)
    others = [np.poly(np.delete(decay, j)) for j in range(poles.size)]
    through = (residues * moved**2) @ np.array(others)
    b, a = direct * np.poly(decay) + np.append(0, through), np.poly(decay)
    if not b[0]:
        raise ValueError("the plant is zero: its output does not answer to its input")
    return Plant(b.real, a.real, 1, dt)


def modes(system: control.StateSpace) -> tuple[np.ndarray, np.ndarray]:
    """Poles p and residues r of a continuous system, whose response is the sum of r/(s - p).

    Raises ValueError for several inputs or outputs, a sampled system, a direct path, and poles that
    repeat.
    """
    if not (system.issiso() and system.isctime()) or np.any(system.D):
        raise ValueError("give one input, one output, continuous time and no direct path")
    poles, vectors = np.linalg.eig(system.A)
    if not poles.size or np.linalg.cond(vectors) > 1e12:
        raise ValueError(f"poles {poles}: only distinct ones can be taken mode by mode")
    return poles, (system.C @ vectors)[0] * np.linalg.solve(vectors, system.B)[:, 0]


def phi1(x: np.ndarray) -> np.ndarray:
    """(e^x - 1)/x, and 1 at x = 0; the mean of e^(x t) over 0 <= t <= 1."""
    safe = np.where(x == 0, 1, x)
    return np.where(x == 0, 1, np.expm1(safe) / safe)


def phi2(x: np.ndarray) -> np.ndarray:
    """(e^x - 1 - x)/x^2, and 1/2 at x = 0; by its series where the difference loses digits."""
    safe = np.where(np.abs(x) < 1e-2, 1, x)
    series = (1 + x / 3 * (1 + x / 4 * (1 + x / 5 * (1 + x / 6)))) / 2
    return np.where(np.abs(x) < 1e-2, series, (np.expm1(safe) - safe) / safe**2)
