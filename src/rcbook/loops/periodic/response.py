"""Responses of a periodic loop: sample by sample, and in steady state."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike
from scipy.sparse.linalg import splu

from rcbook.loops.periodic.loop import PeriodicLoop
from rcbook.loops.periodic.recursion import Recursion
from rcbook.loops.periodic.verdict import verdict
from rcbook.loops.run import BOUND, FREE, Limits, Run
from rcbook.loops.verdict import require_stable
from rcbook.signals import signal

_MEND = "choose another design or gain, or shorten q"


def simulate(
    loop: PeriodicLoop,
    reference: ArrayLike,
    *,
    disturbance: ArrayLike | None = None,
    noise: ArrayLike | None = None,
    limits: Limits = FREE,
) -> Run:
    """Run the loop from rest, limits included; without limits a period is one sparse solve.

    The disturbance acts on the plant input, the noise on the measured output.  What the controller
    sends is v, so `repetitive` is the command before its limit; the other limit is on u, what the
    memory hands to the compensator.
    Raises ValueError when the signals differ in length or hold NaN.
    """
    inputs = _inputs(reference, disturbance, noise)
    limit = BOUND * np.abs(inputs).max()
    periods = _linear if limits == FREE else _limited
    found = []
    for signals in periods(loop, inputs, limits):
        found.append(signals)
        if not np.abs(signals[:3]).max() <= limit:
            break
    y, v, asked, clipped_v, clipped_u = np.concatenate(found, axis=1)[:, : inputs.shape[1]]
    inside = np.abs([y, v, asked]).max(axis=0) <= limit
    end = inside.size if inside.all() else int(np.argmin(inside))
    acted = (int(clipped[:end].sum()) for clipped in (clipped_v, clipped_u))
    signals = (s[:end] for s in (*inputs, y, v, asked))
    return Run(_time(loop, end), *signals, end < inside.size, *acted)


def _inputs(
    reference: ArrayLike, disturbance: ArrayLike | None, noise: ArrayLike | None
) -> np.ndarray:
    """Reference, disturbance and noise as rows of one length; what is not given is 0."""
    r = signal(reference, "reference")
    others = (("disturbance", disturbance), ("noise", noise))
    return np.array([r, *(r * 0 if s is None else signal(s, name, r.size) for name, s in others)])


def _time(loop: PeriodicLoop, samples: int) -> np.ndarray:
    intervals = np.resize(loop.plant.intervals, samples)
    return np.concatenate([[0.0], np.cumsum(intervals)[:-1]])[:samples]


def _added(loop: PeriodicLoop, inputs: np.ndarray) -> Iterator[np.ndarray]:
    """What the inputs add to the rows of the recursion, period by period; zero after their end."""
    inputs = np.pad(inputs, ((0, 0), (0, -inputs.shape[1] % loop.period)))
    for r, d, noise in inputs.reshape(3, -1, loop.period).transpose(1, 0, 2):
        yield loop.recursion.right(r - noise, d)


def _linear(loop: PeriodicLoop, inputs: np.ndarray, _: Limits) -> Iterator[np.ndarray]:
    once, untouched = loop.recursion, np.zeros((2, loop.period))
    state = np.zeros(once.size)
    for right in _added(loop, inputs):
        timeline = once.run(state, right)
        state = timeline[once.last]
        y, v = once.signals(timeline)
        yield np.array([y, v, v, *untouched])


def _limited(loop: PeriodicLoop, inputs: np.ndarray, limits: Limits) -> Iterator[np.ndarray]:
    once = loop.recursion
    kept = sent = np.zeros(once.size)
    for right in _added(loop, inputs):
        kept, sent, clipped = once.limited(kept, sent, right, limits)
        asked = once.signals(kept)[1]
        yield np.array([*once.signals(sent), asked, *clipped[::-1]])
        kept, sent = kept[once.last], sent[once.last]


def steady_state(
    loop: PeriodicLoop, reference: ArrayLike, *, disturbance: ArrayLike | None = None
) -> Run:
    """The periodic solution under a periodic reference and disturbance, from one sparse solve.

    They hold one period of the plant, or several of them.
    Raises ValueError for a loop that is not stable, as there is none, and for another length.
    """
    inputs = _inputs(reference, disturbance, None)
    if inputs.shape[1] % loop.period:
        raise ValueError(
            f"{inputs.shape[1]} samples are not whole periods of {loop.period}; add some"
        )
    require_stable(verdict(loop), _MEND)
    once, added = loop.recursion, list(_added(loop, inputs))
    matrix = _closed_circle(once, len(added))
    right = np.concatenate([np.concatenate([np.zeros(once.size), each]) for each in added])
    timelines = splu(matrix).solve(right).reshape(len(added), -1)
    y, v = np.concatenate([once.signals(timeline) for timeline in timelines], axis=1)
    return Run(_time(loop, y.size), *inputs, y, v, v)


def _closed_circle(once: Recursion, periods: int) -> scipy.sparse.csc_array:
    """The recursion of some periods, the state of the first of which is that after the last."""
    length = once.matrix.shape[1]
    own = scipy.sparse.vstack([scipy.sparse.eye_array(once.size, length), once.matrix])
    ended = (np.ones(once.size), (np.arange(once.size), once.last))
    ended = scipy.sparse.coo_array(ended, shape=(length, length))
    before = scipy.sparse.coo_array(np.roll(np.eye(periods), 1, axis=0))
    each = scipy.sparse.eye_array(periods)
    return (scipy.sparse.kron(each, own) - scipy.sparse.kron(before, ended)).tocsc()
