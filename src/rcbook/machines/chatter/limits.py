"""The cutting stiffness at which chatter begins, by bisection on the growth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rcbook.machines.chatter.constant_speed import least_limit
from rcbook.machines.chatter.cut import Cut
from rcbook.machines.chatter.multipliers import floquet
from rcbook.zdomain import real_number


def stability_limit(
    cut: Cut, highest: float = 20.0, ratio: float = 1.15, precision: float = 1e-3, **options: float
) -> np.ndarray:
    """Lowest cutting stiffness (N/m) at which each cut begins to chatter, whatever it has now.

    Searched upward in steps of `ratio` from 0.7 of the least limit at constant speed, or from
    where the cut is stable, up to `highest` times that limit, beyond which it is infinite; then
    bisected to a relative `precision`.  An instability narrower than a step of the search can be
    missed; `stability_chart` finds it.  The options are those of `floquet`.
    Raises ValueError when `highest` or `ratio` is not above 1, or the precision is not positive.
    """
    precision = real_number(precision, "precision", positive=True)
    for name, value in (("highest", highest), ("ratio", ratio)):
        if real_number(value, name) <= 1:
            raise ValueError(f"{name} = {value!r} must be above 1")
    low, high = _bracket(cut, highest * least_limit(cut.mode), ratio, options)
    found = np.flatnonzero(np.isfinite(high))
    for _ in range(int(np.ceil(np.log2(max(1.0, np.log(ratio) / precision))))):
        middle = np.sqrt(low[found] * high[found])
        chatters = _grows(cut, found, middle, options)
        high[found[chatters]] = middle[chatters]
        low[found[~chatters]] = middle[~chatters]
    return np.sqrt(low * high).reshape(cut.shape)


def _bracket(
    cut: Cut, highest: float, ratio: float, options: dict
) -> tuple[np.ndarray, np.ndarray]:
    """A stiffness without and one with chatter for each cut, neighbours in a search upward."""
    cuts, start = cut.speed.size, 0.7 * least_limit(cut.mode)
    low, high = np.full(cuts, start), np.full(cuts, np.inf)
    unsafe = np.arange(cuts)
    while unsafe.size:  # ends, because a cut without stiffness only decays
        unsafe = unsafe[_grows(cut, unsafe, low[unsafe], options)]
        low[unsafe] /= ratio
    searching = np.arange(cuts)
    while searching.size:
        trial = low[searching] * ratio
        chatters = _grows(cut, searching, trial, options)
        high[searching[chatters]] = trial[chatters]
        low[searching[~chatters]] = trial[~chatters]
        searching = searching[~chatters & (trial < highest)]
    return low, high


def _grows(cut: Cut, places: np.ndarray, stiffness: np.ndarray, options: dict) -> np.ndarray:
    if not places.size:
        return np.zeros(0, dtype=bool)
    return floquet(replace(cut.take(places), cutting_stiffness=stiffness), **options).growth > 0
