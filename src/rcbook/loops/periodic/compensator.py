"""Compensators whose taps repeat every N samples: zero-phase inverses, and least squares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.loops.periodic.plant import PeriodicPlant, positive_intervals
from rcbook.zdomain import inverse

if TYPE_CHECKING:  # what takes a second to import is imported where it is used
    import control

_ALL_ZEROS = 1e-9  # a radius below which no sampled zero is cancelled


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
    distinct, which = np.unique(positive_intervals(intervals), return_inverse=True)
    # What can be inverted as sampled at the shortest interval can be at all others.
    shortest = zdomain.zero_order_hold(system, distinct[0])
    advance = inverse.zero_phase_inverse(shortest, _ALL_ZEROS, normalisation="l1").advance
    b, a = (rows.T for rows in zdomain.hold_polynomials(system, distinct))
    b = b[b.any(axis=1).argmax() :]
    taps = np.zeros((len(a) + len(b) - 1, distinct.size))
    for k, coefficient in enumerate(a):
        taps[k : k + len(b)] += coefficient * b[::-1]
    taps /= np.abs(b).sum(axis=0) ** 2
    return Compensator(taps.T[which], advance)


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
