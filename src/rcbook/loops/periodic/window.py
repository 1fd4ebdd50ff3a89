"""The operator K = q (1 - z^L G_c G_p) as a causal system: it looks ahead little and forgets soon.

With the memory q z^-N a periodic loop is u = z^-N K u: K acts once a period.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rcbook.loops.periodic.plant import PeriodicPlant


@dataclass(frozen=True, eq=False)
class Window:
    """z^-p K, sample by sample: s(k+1) = matrix[k] s(k) + entry[k] u(k), output row s(k).

    State s = [x(k), u(k-1) .. u(k-m'), y(k-1) .. y(k-2h)]; p = L + h is what K looks ahead.
    Shapes: matrix (N, s, s), entry (N, s), row (s,), the same for all samples.
    """

    matrix: np.ndarray
    entry: np.ndarray
    row: np.ndarray
    ahead: int  # p, samples
    order: int  # states of the plant
    inputs: int  # m', inputs that are remembered
    filter: int  # m - 1, those of them that the compensator needs

    @property
    def period(self) -> int:
        """N, samples."""
        return len(self.matrix)

    @property
    def states(self) -> int:
        """Numbers of the state s."""
        return self.row.size

    @cached_property
    def kept(self) -> np.ndarray:
        """Where in the state everything stands but u(k-p) .. u(k-1)."""
        return np.r_[: self.order, self.order + self.ahead : self.states]

    @cached_property
    def equations(self) -> np.ndarray:
        """What is kept at k+1, without u(k), and last K u(k-p), from what is kept and the rest.

        The rest is u(k-p) .. u(k-1), in this order.  Shape (N, kept + 1, s).
        """
        ahead = np.arange(self.order + self.ahead, self.order, -1) - 1
        row = np.broadcast_to(self.row, (self.period, 1, self.states))
        rows = np.concatenate([self.matrix[:, self.kept], row], axis=1)
        return np.ascontiguousarray(rows[:, :, np.append(self.kept, ahead)])


def window(plant: PeriodicPlant, taps: np.ndarray, advance: int, q: np.ndarray) -> Window:
    """The window of taps (N, m), gain included, with advance L and 2 h + 1 taps of q."""
    period, n, half, filter = plant.period, plant.order, q.size // 2, taps.shape[1] - 1
    ahead = advance + half
    inputs = max(filter, ahead + half)
    at_y = n + inputs
    states = at_y + 2 * half
    shifts = np.eye(states, k=-1)
    shifts[:n], shifts[n] = 0.0, 0.0
    if half:
        shifts[at_y], shifts[at_y, :n] = 0.0, plant.c
    matrix = np.repeat(shifts[None], period, axis=0)
    matrix[:, :n, :n] = plant.a
    matrix[:, :n, n : n + filter] = plant.b[:, :, None] * taps[:, None, 1:]
    entry, row = np.zeros((period, states)), np.zeros(states)
    entry[:, :n], entry[:, n] = plant.b * taps[:, :1], 1.0
    row[:n] = -q[0] * plant.c
    row[n + advance - 1 : n + ahead + half] = q
    row[at_y:] = -q[1:]
    return Window(matrix, entry, row, ahead, n, inputs, filter)
