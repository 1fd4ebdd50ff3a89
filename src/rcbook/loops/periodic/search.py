"""Where a condition on a loop is first met."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq


def first_crossing(
    function: Callable[[float], float], edges: Sequence[float], precision: float = 1e-7
) -> float:
    """Where `function` first reaches zero from below: searched from edge to edge, then a root.

    It is the first edge where the function is not below zero there, and infinite where it stays
    below at all of them; what happens between two edges can be missed.
    Raises ValueError for fewer than two edges or edges that do not ascend.
    """
    if len(edges) < 2 or not np.all(np.diff(edges) > 0):
        raise ValueError(f"edges = {list(edges)}: give two or more, in ascending order")
    if function(edges[0]) >= 0:
        return float(edges[0])
    for low, high in pairwise(edges):
        if function(high) >= 0:
            return float(brentq(function, low, high, xtol=precision))
    return np.inf
