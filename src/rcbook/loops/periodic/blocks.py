"""The recursion in blocks of samples, as dense matrices: many runs at once, each where it lives."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse.linalg import splu

from rcbook.loops.periodic.recursion import Recursion

_BLOCK = 32  # samples; the matrices are small and their products large enough to be worth it
_AT_ONCE = 40  # columns; larger products are threaded, which takes longer than they do


@dataclass(frozen=True, eq=False)
class Blocks:
    """Timeline [state | w, u and, if asked for, v of a block, the x after it | ..].

    What is below `dropped` of the largest of its kind counts as nothing, column by column.
    """

    parts: list[tuple[np.ndarray, slice, np.ndarray]]  # where it reads, where it writes, matrix
    last: np.ndarray  # where in the timeline the next state stands
    w: np.ndarray  # where w and v stand, a row a sample
    v: np.ndarray  # -1 where it is left out
    past_u: np.ndarray  # where u(k-L) stands
    kind: np.ndarray  # of a row of the timeline: 0 for w, u and v, else which of the x
    order: int

    def run(self, timeline: np.ndarray, state: np.ndarray, dropped: float) -> None:
        """Fill in the timeline of one period without inputs; columns are runs of their own."""
        largest = np.abs(state).max(axis=1)
        floor = dropped * np.append(largest[self.order :].max(), largest[: self.order])
        timeline[: len(state)] = state
        for reads, writes, matrix in self.parts:
            read = timeline[reads]
            live = np.flatnonzero((np.abs(read) > floor[self.kind[reads], None]).any(axis=0))
            timeline[writes] = 0.0
            for i in range(0, live.size, _AT_ONCE):
                some = live[i : i + _AT_ONCE]
                timeline[writes, some] = matrix @ read[:, some]


def blocks(once: Recursion, command: bool = False) -> Blocks:
    """The blocks of a recursion, solved for from the same sparse matrix; with v if asked for."""
    n, step, size, order = once.plant.period, once.step, once.size, once.plant.order
    edges = [*range(0, n, _BLOCK), n]
    sample, row = np.divmod(np.arange(n * step), step)
    ends = (row > 2) & np.isin(sample + 1, edges)
    kept = np.append(np.arange(size), size + np.flatnonzero((row < 2 + command) | ends))
    place = np.full(size + n * step, -1)
    place[kept] = np.arange(kept.size)
    kind = np.zeros(kept.size, dtype=int)
    kind[:order] = 1 + np.arange(order)
    kind[size:] = np.maximum(row[kept[size:] - size] - 2, 0)
    parts = []
    for first, after in pairwise(edges):
        start, stop = size + first * step, size + after * step
        rows = once.matrix[first * step : after * step]
        reads = np.unique(rows[:, :start].indices)
        own = splu(rows[:, start:stop].tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0)
        answer = own.solve(-rows[:, reads].toarray())
        written = place[start:stop] >= 0
        at = place[start:stop][written]
        parts.append((place[reads], slice(at[0], at[-1] + 1), answer[written]))
    w, u, v = (place[size + step * np.arange(n) + i] for i in range(3))
    past_u = np.concatenate([order + once.reach + np.arange(-once.advanced, 0), u])[:n]
    return Blocks(parts, place[once.last], w, v, past_u, kind, order)
