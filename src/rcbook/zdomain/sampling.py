"""From continuous plants to sampled ones."""

from __future__ import annotations

import control
import numpy as np

from rcbook.zdomain.checks import real_number
from rcbook.zdomain.plant import Plant


def zero_order_hold(system: control.StateSpace | control.TransferFunction, dt: float) -> Plant:
    """Sample a continuous single-input single-output plant behind a zero-order hold.

    The numerator comes from the impulse response, which keeps the digits of small leading
    coefficients.
    Raises ValueError when the plant is not continuous, not proper, zero or has several inputs or
    outputs, or dt is not positive.
    """
    dt = real_number(dt, "sampling interval dt", positive=True)
    if not system.issiso():
        raise ValueError(f"{system.ninputs} inputs, {system.noutputs} outputs; pick one of each")
    if not system.isctime():
        raise ValueError(f"the plant is sampled at dt = {system.dt!r}; give a continuous one")
    if isinstance(system, control.TransferFunction):
        num, den = (np.trim_zeros(p[0][0], "f") for p in (system.num, system.den))
        if num.size > den.size:
            raise ValueError(f"numerator degree {num.size - 1} exceeds {den.size - 1}: improper")
    sampled = control.sample_system(control.ss(system), dt, method="zoh")
    a = np.atleast_1d(np.poly(sampled.A)) if sampled.nstates else np.ones(1)
    state, impulse = sampled.B, [sampled.D.item()]
    for _ in range(sampled.nstates):
        impulse.append((sampled.C @ state).item())
        state = sampled.A @ state
    return _from_impulse(np.array(impulse), a, dt)


def _from_impulse(impulse: np.ndarray, a: np.ndarray, dt: float) -> Plant:
    b = np.convolve(a, impulse)[: a.size]
    if not b.any():
        raise ValueError("the plant is zero: its output does not answer to its input")
    delay = int(np.flatnonzero(b)[0])
    return Plant(b[delay:], a, delay, dt)


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
