"""The one-period map: its matrix, its multipliers, and how far its powers grow."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.linalg import LinearOperator

from rcbook import zdomain
from rcbook.loops.periodic.loop import PeriodicLoop


def one_period_map(loop: PeriodicLoop) -> LinearOperator:
    """State at sample 0 to state at sample N, without input; O(N) work, transpose included.

    The state is [x(0), u(-reach) .. u(-1), w(-memory) .. w(-1)], with reach = max(L, m - 1) and
    for a plain memory N - L + h of w: what the loop remembers, each number once.
    """
    once = loop.recursion
    return LinearOperator(
        (once.size, once.size),
        matvec=once.advance,
        matmat=once.advance,
        rmatvec=once.transposed,
        rmatmat=once.transposed,
        dtype=float,
    )


def dense(loop: PeriodicLoop) -> np.ndarray:
    """The one-period map as a matrix, N applications of O(N) work."""
    return loop.recursion.advance(np.eye(loop.recursion.size))


def multipliers(loop: PeriodicLoop) -> np.ndarray:
    """All eigenvalues of the dense one-period matrix, by decreasing magnitude.

    Not certified: a change of the matrix by its rounding can move them by that times the growth
    of its powers; compare those of the transpose, and `transient_growth`.
    """
    values = np.linalg.eigvals(dense(loop))
    return values[np.argsort(-np.abs(values), kind="stable")]


def transient_growth(loop: PeriodicLoop, periods: ArrayLike, iterations: int = 12) -> np.ndarray:
    """How far the content of the memory can grow in j periods, for each j of `periods`.

    Largest ||w after|| / ||w before|| from a plant at rest: the norm of the w rows and columns of
    the j-th power of the one-period map, by power iteration on it times its transpose.  Every
    value is attained by a signal that was run, hence a lower bound; iterations bring it up.
    """
    once, iterations = loop.recursion, zdomain.whole_number(iterations, "iterations")
    growth = []
    for j in np.ravel(periods):
        j = zdomain.whole_number(float(j), "periods")
        state = np.zeros(once.size)
        state[-once.memory :] = np.random.default_rng(0).standard_normal(once.memory)
        best = 0.0
        for _ in range(iterations):
            state /= np.linalg.norm(state)
            for _ in range(j):
                state = once.advance(state)
            state[: -once.memory] = 0.0
            best = max(best, float(np.linalg.norm(state)))
            if not 0 < best < 1e100:
                break
            for _ in range(j):
                state = once.transposed(state)
            state[: -once.memory] = 0.0
        growth.append(best)
    return np.array(growth)
