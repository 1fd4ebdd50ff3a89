"""One period of a periodic loop as one sparse system: the recursion that all questions ask.

Its rows are the equations of the loop, in the order in which a computer would take them::

    w(k) = u(k-L) + r(k) - y(k) - noise(k),    y(k) = C x(k)
    u(k) = h0 w(k-first+L) + h1 w(k-first+L-1) + ..              memory H = h0 z^-first + ..
    v(k) = gain sum_j c_j(k) u(k-j)
    x(k+1) = A(k) x(k) + B(k) (v(k) + disturbance(k))
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse
from scipy.sparse.linalg import SuperLU, splu

from rcbook.loops.memory import Memory
from rcbook.loops.periodic.plant import PeriodicPlant
from rcbook.loops.run import Limits

_AT_ONCE = 8  # columns of a solve; more of them leave the cache


@dataclass(frozen=True, eq=False)
class Recursion:
    """Unit lower triangular system of the timeline [state | w(0), u(0), v(0), x(1), w(1), ..].

    matrix @ timeline = what is added to each row, `right`; the state is
    [x(0), u(-reach) .. u(-1), w(-memory) .. w(-1)].
    """

    plant: PeriodicPlant
    matrix: scipy.sparse.csr_array  # (N step, size + N step)
    past: scipy.sparse.csr_array  # its columns of the state
    solver: SuperLU
    last: np.ndarray  # where in the timeline the next state stands
    advanced: int  # L, samples
    reach: int
    memory: int

    @property
    def size(self) -> int:
        """Numbers of the state."""
        return self.plant.order + self.reach + self.memory

    @property
    def step(self) -> int:
        """Rows a sample: w, u, v and the next x."""
        return self.plant.order + 3

    def right(self, error: np.ndarray, disturbance: np.ndarray) -> np.ndarray:
        """What one period (or one column a signal) adds to the rows of w and x."""
        added = np.zeros((self.plant.period, self.step, *error.shape[1:]))
        added[:, 0] = error
        added[:, 3:] = np.einsum("ki,k...->ki...", self.plant.b, disturbance)
        return added.reshape(-1, *error.shape[1:])

    def run(self, state: np.ndarray, right: np.ndarray | float = 0.0) -> np.ndarray:
        """Timeline from a state and what is added to the rows; columns are runs of their own."""
        now = self.solver.solve(right - self.past @ state)
        return np.concatenate([state, now])

    def limited(
        self, kept: np.ndarray, sent: np.ndarray, right: np.ndarray, limits: Limits
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Two timelines, row by row, and how often a period u and v met their limits.

        `kept` has the u that the memory goes on from and the v that was asked for, `sent` the u
        that is filtered and the v that the plant gets.
        """
        kept, sent = (np.concatenate([s, np.zeros(right.size)]) for s in (kept, sent))
        most = {1: limits.repetitive, 2: limits.command}
        clipped, starts = np.zeros((2, self.plant.period), dtype=bool), self.matrix.indptr
        for row, added in enumerate(right):
            part, at = slice(starts[row], starts[row + 1] - 1), self.size + row
            k, kind = divmod(row, self.step)
            seen = kept if kind == 0 else sent
            value = added - self.matrix.data[part] @ seen[self.matrix.indices[part]]
            kept[at] = sent[at] = value
            if limit := most.get(kind):
                sent[at] = np.clip(value, -limit.value, limit.value)
                clipped[kind - 1, k] = abs(value) > limit.value
                kept[at] = sent[at] if kind == 1 and limit.remember_clipped else value
        return kept, sent, clipped

    def units(self) -> Iterator[np.ndarray]:
        """All unit signals of one period, a few columns at once."""
        n = self.plant.period
        for i in range(0, n, _AT_ONCE):
            yield np.eye(n, min(_AT_ONCE, n - i), -i)

    def advance(self, state: np.ndarray) -> np.ndarray:
        """The next state, of one state or of each column."""
        if state.ndim == 1:
            return self.run(state)[self.last]
        parts = range(0, state.shape[1], _AT_ONCE)
        return np.hstack([self.run(state[:, i : i + _AT_ONCE])[self.last] for i in parts])

    def transposed(self, state: np.ndarray) -> np.ndarray:
        """The transpose of `advance`."""
        spread = np.zeros((self.matrix.shape[1], *state.shape[1:]))
        spread[self.last] = state
        back = self.solver.solve(spread[self.size :], trans="T")
        return spread[: self.size] - self.past.T @ back

    def closed(self, factor: complex) -> scipy.sparse.csc_array:
        """The system of a period that ends in `factor` times its state, less what is added."""
        length = self.matrix.shape[1]
        begins = scipy.sparse.eye_array(self.size, length) * factor
        ended = (np.ones(self.size), (np.arange(self.size), self.last))
        ends = scipy.sparse.coo_array(ended, shape=(self.size, length))
        return scipy.sparse.vstack([begins - ends, self.matrix]).tocsc()

    def signals(self, timeline: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """y and v of one period, a row a sample."""
        now = timeline[self.size :].reshape(self.plant.period, self.step, *timeline.shape[1:])
        x = np.concatenate([timeline[None, : self.plant.order], now[:-1, 3:]])
        return np.einsum("i,ki...->k...", self.plant.c, x), now[:, 2]


def recursion(plant: PeriodicPlant, taps: np.ndarray, advance: int, memory: Memory) -> Recursion:
    """The recursion of a loop; taps (N, m) of the compensator, gain included, and its advance L."""
    n, order, delay = plant.period, plant.order, memory.first - advance
    reach, remembered = max(advance, taps.shape[1] - 1), delay + memory.taps.size - 1
    head, step, k = order + reach + remembered, order + 3, np.arange(n)

    def w(j):
        return np.where(j < 0, head + j, head + step * j)

    def u(j):
        return np.where(j < 0, order + reach + j, head + step * j + 1)

    def x(j):
        first = np.where(j == 0, 0, head + step * (j - 1) + 3)
        return first[..., None] + np.arange(order)

    rows, cols, values = [], [], []

    def put(row, col, value):
        row, col, value = np.broadcast_arrays(row, col, value)
        rows.append(row.ravel()), cols.append(col.ravel()), values.append(value.ravel())

    at_x = step * k[:, None] + 3 + np.arange(order)
    put(np.arange(n * step), head + np.arange(n * step), 1.0)
    put(step * k, u(k - advance), -1.0)
    put(step * k[:, None], x(k), plant.c)
    for i, tap in enumerate(memory.taps):
        put(step * k + 1, w(k - delay - i), -tap)
    for j in range(taps.shape[1]):
        put(step * k + 2, u(k - j), -taps[:, j])
    put(at_x, head + step * k[:, None] + 2, -plant.b)
    put(at_x[:, :, None], x(k)[:, None, :], -plant.a)
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(cols)))
    matrix = scipy.sparse.coo_array(entries, shape=(n * step, head + n * step)).tocsr()
    matrix.sort_indices()
    solver = splu(matrix[:, head:].tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0)
    last = [x(np.array(n)), u(np.arange(n - reach, n)), w(np.arange(n - remembered, n))]
    return Recursion(
        plant, matrix, matrix[:, :head], solver, np.concatenate(last), advance, reach, remembered
    )
