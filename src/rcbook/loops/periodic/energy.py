"""Norms of the window K: below one, a period shrinks what the memory holds."""

from __future__ import annotations

import numpy as np

from rcbook.loops.periodic.loop import PeriodicLoop
from rcbook.loops.periodic.window import Window


def energy_gain(loop: PeriodicLoop, width: float = 1e-3) -> float:
    """Upper bound, to `width`, of how K amplifies the root of the energy of any sequence.

    Below one the loop of a stable plant is stable, and the memory shrinks by it from period to
    period.  Infinite when it exceeds 16.
    """
    low, high = 0.0, 16.0
    if not dissipates(loop.window, np.array([high]))[0]:
        return np.inf
    while high - low > width:
        levels = np.linspace(low, high, 10)[1:-1]
        below = levels[~dissipates(loop.window, levels)]
        above = levels[levels > below.max(initial=0.0)]
        low, high = below.max(initial=low), above.min(initial=high)
    return float(high)


def dissipates(window: Window, levels: np.ndarray, samples: int = 5000) -> np.ndarray:
    """Whether a storage function shows K to amplify energy by less than levels^2.

    It is the limit of a Riccati recursion backward in time (bounded real lemma); a level whose
    recursion breaks down, or has not settled after so many samples, and ten periods, gets a no.
    """
    states, row = window.states, window.row
    storage, good = np.zeros((levels.size, states, states)), np.ones(levels.size, dtype=bool)
    steps = list(zip(window.matrix, window.entry, strict=True))[::-1]
    for _ in range(10 + samples // window.period):
        before = storage
        for matrix, entry in steps:
            pulled = storage @ entry
            room = levels**2 - pulled @ entry
            good &= room > 0
            if not good.any():
                return good
            cross = pulled @ matrix
            share = cross / np.where(room > 0, room, np.inf)[:, None]
            storage = matrix.T @ storage @ matrix + row[:, None] * row
            storage += cross[:, :, None] * share[:, None, :]
        moved = np.linalg.norm(storage - before, axis=(1, 2))
        settled = moved <= 1e-9 * np.linalg.norm(storage, axis=(1, 2))
        if np.all(settled | ~good):
            break
    return good & settled


def absolute_gain(loop: PeriodicLoop) -> float:
    """Largest sum over the input times of |impulse response| of K: below one is sufficient.

    Responses are followed until they have fallen by 1e-14.
    Source: Omata, Hara and Nakano (1985); Hanson and Tsao (2000), eqs 3-4, with q in series.
    Raises ValueError when they have not after 100 000 samples.
    """
    window, state = loop.window, loop.window.entry
    total, k = np.zeros(loop.period), np.arange(loop.period)
    small = 1e-14 * np.abs(state).max()
    for lag in range(1, 100_000):
        at = (k + lag) % loop.period
        total[at] += np.abs(state @ window.row)
        state = (window.matrix[at] @ state[:, :, None])[:, :, 0]
        if np.abs(state).max() <= small:
            return float(total.max())
    raise ValueError("impulse responses do not die out: the plant is not stable")
