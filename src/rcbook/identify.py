"""Models from records: least squares and an input that excites everything."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # its signal is loaded when asked for, and takes half a second
from numpy.typing import ArrayLike

from rcbook.signals import signal
from rcbook.zdomain import Plant, real_number, whole_number


@dataclass(frozen=True, eq=False)
class ArxFit:
    """Least-squares estimate of a(q^-1) y = q^-delay b(q^-1) u + e and its uncertainty."""

    theta: np.ndarray  # [a1 .. a_na, b0 .. b_(nb-1)]
    standard_error: np.ndarray  # of theta, right for white equation error
    residual: np.ndarray
    na: int
    delay: int

    def plant(self, dt: float) -> Plant:
        """The estimate as a plant sampled every dt s."""
        a, b = np.concatenate([[1.0], self.theta[: self.na]]), self.theta[self.na :]
        return Plant(b, a, self.delay, dt)


def regressors(u: np.ndarray, y: np.ndarray, na: int, nb: int, delay: int) -> np.ndarray:
    """Rows [-y(k-1) .. -y(k-na), u(k-delay) .. u(k-delay-nb+1)] from the first full k on.

    The minus signs belong to a model with a1 .. a_na on the left (Horng 1989, eq. 1; eq. 3
    prints them as plus).
    """
    first = max(na, delay + nb - 1)
    past_y = [-y[first - i : y.size - i] for i in range(1, na + 1)]
    past_u = [u[first - i : u.size - i] for i in range(delay, delay + nb)]
    return np.column_stack(past_y + past_u)


def arx(u: ArrayLike, y: ArrayLike, na: int, nb: int, delay: int = 1) -> ArxFit:
    """Fit a(q^-1) y = q^-delay b(q^-1) u by least squares, `na` poles and `nb` numerator terms.

    Sums start at the first sample with a full regressor.  Source: Horng (1989), eqs 1-5 with the
    signs of eq. 3 and the right-hand side of eq. 5 corrected.
    Raises ValueError when u and y differ in length, hold NaN, are too short, or do not excite all
    parameters.
    """
    na, nb = whole_number(na, "na", 0), whole_number(nb, "nb")
    delay = whole_number(delay, "delay", 0)
    y = signal(y, "output y")
    u = signal(u, "input u", length=y.size)
    first = max(na, delay + nb - 1)
    if y.size - first <= na + nb:
        raise ValueError(f"{y.size} samples cannot fit {na + nb} parameters; take a longer record")
    phi = regressors(u, y, na, nb, delay)
    target = y[first:]
    scale = np.linalg.norm(phi, axis=0)  # columns have units of their own
    scale[scale == 0] = 1.0
    theta, _, rank, _ = np.linalg.lstsq(phi / scale, target)
    if rank < na + nb:
        raise ValueError(
            f"the record excites {rank} of {na + nb} parameters; use a richer input or lower orders"
        )
    residual = target - phi @ (theta / scale)
    variance = residual @ residual / (target.size - theta.size)
    root = np.linalg.inv(np.linalg.qr(phi / scale, mode="r"))  # of the inverse normal matrix
    error = np.sqrt(variance * np.sum(root**2, axis=1))
    return ArxFit(theta / scale, error / scale, residual, na, delay)


def prbs(bits: int, amplitude: float = 1.0, seed: int = 0) -> np.ndarray:
    """One period, 2^bits - 1 samples of +-amplitude, of a maximal-length binary sequence.

    The seed chooses the start of the shift register, that is, where the period begins.
    Raises ValueError for register lengths outside 2..32.
    """
    amplitude, bits = real_number(amplitude, "amplitude"), whole_number(bits, "bits", 0)
    if not 2 <= bits <= 32:
        raise ValueError(f"bits = {bits} is outside the table of maximal registers, 2 to 32")
    state = np.zeros(bits, dtype=np.int8)
    while not state.any():
        state = np.random.default_rng(seed).integers(0, 2, bits, dtype=np.int8)
        seed += 1
    sequence, _ = scipy.signal.max_len_seq(bits, state=state)
    return amplitude * (2.0 * sequence - 1.0)
