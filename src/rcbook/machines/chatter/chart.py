"""Stability charts: where a cut chatters, on all of an axis of stiffness and not only below it."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from rcbook.machines.chatter.cut import Cut, between
from rcbook.machines.chatter.multipliers import floquet
from rcbook.spread import spread

# How much the growth, times the delay, changes at most while the stiffness grows by a factor e.  At
# constant speed d s/d log K = 1/(p'/p + tau (1 + K/p)) for p = m s^2 + c s + k, and from the decay
# of the free mode up to the limit Re p'/p >= 0 and Re (1 + K/p) >= 1/2, so it is 2 at most.  A
# varying speed may exceed that, so twice the steepest change that was seen counts as well.
_STEEPEST = 2.0
_STRIDE = 16  # of the first look at the axis, a power of 2
_PER_CYCLE = (6, 12, 24, 48, 96)  # steps, refined until they are fine enough for the answer
_PIECE = 32  # cuts whose growth is worked out together


def stability_chart(
    cut: Cut, cutting_stiffness: ArrayLike, executor: Executor | None = None
) -> np.ndarray:
    """Whether each cut is stable at each cutting stiffness (N/m), whatever stiffness it has now.

    Shape cut.shape + cutting_stiffness.shape.  The growth is worked out on a coarse grid of
    stiffness, and between two of its points unless they are so far from the limit that it cannot
    be reached on the way; near the limit with steps so fine that their error leaves its sign.  So
    islands are found too.  An `executor` shares the work among its workers.
    Raises ValueError for a stiffness that is not positive.
    """
    axis, back = np.unique(
        between(cutting_stiffness, "cutting_stiffness", 0.0, np.inf), False, True
    )
    order = np.argsort(cut.speed, axis=None, kind="stable")  # neighbours share grids of time
    pieces = [cut.take(order[i : i + _PIECE]) for i in range(0, order.size, _PIECE)]
    stable = np.empty((order.size, axis.size), dtype=bool)
    stable[order] = np.concatenate(spread(partial(_stable, axis=axis), pieces, executor))
    return stable[:, back].reshape(cut.shape + np.shape(cutting_stiffness))


def _stable(cut: Cut, axis: np.ndarray) -> np.ndarray:
    """The chart of a row of cuts; the exponent is infinite where it was not asked for."""
    exponent, last = np.empty((cut.speed.size, axis.size)), axis.size - 1
    places = np.append(np.arange(0, last, _STRIDE), last)
    rows, columns = np.indices((cut.speed.size, places.size)).reshape(2, -1)
    exponent[rows, places[columns]] = _exponent(cut, rows, axis[places[columns]])
    steepest = _STEEPEST
    for half in 2 ** np.arange(int(np.log2(_STRIDE)))[::-1]:
        middle = np.arange(half, last, 2 * half)
        low, high = middle - half, np.minimum(middle + half, last)
        below, above = exponent[:, low], exponent[:, high]
        apart = np.broadcast_to(np.log(axis[high] / axis[low]), below.shape)
        seen = np.isfinite(below) & np.isfinite(above)
        slopes = np.abs(above[seen] - below[seen]) / apart[seen]
        steepest = max(steepest, 2 * np.max(slopes, initial=0))
        near = np.abs(below) + np.abs(above) < steepest * apart
        exponent[:, middle] = np.copysign(np.inf, below)
        rows, columns = np.nonzero(near | np.signbit(below * above))
        exponent[rows, middle[columns]] = _exponent(cut, rows, axis[middle[columns]])
    return exponent < 0


def _exponent(cut: Cut, rows: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Growth times the shortest delay of cuts at these rows, its sign beyond doubt."""
    delay = 2 * np.pi / (cut.speed * (1 + np.abs(cut.rva)))[rows]
    exponent, doubtful = np.empty(rows.size), np.arange(rows.size)
    for per_cycle in _PER_CYCLE:
        if not doubtful.size:
            break
        error = 2 / per_cycle**4  # of the stiffness, see `floquet`
        asked = replace(cut.take(rows[doubtful]), cutting_stiffness=stiffness[doubtful])
        exponent[doubtful] = floquet(asked, per_cycle, error / 20).growth * delay[doubtful]
        doubtful = doubtful[np.abs(exponent[doubtful]) < _STEEPEST * error]
    return exponent
