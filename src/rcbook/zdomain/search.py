"""Where something stops being true, and where a function first reaches zero."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from rcbook.zdomain.checks import real_number


def boundary(
    holds: Callable[[float], bool], inside: float, outside: float, precision: float
) -> float:
    """The last number at which `holds` is true on the way from `inside` to `outside`, by bisection.

    It holds there, and `precision` farther on it does not.  Of several changes on the way one is
    found.
    Raises ValueError when it does not hold `inside`, and for numbers that are not finite.
    """
    inside, outside = real_number(inside, "inside"), real_number(outside, "outside")
    precision = real_number(precision, "precision", positive=True)
    if not holds(inside):
        raise ValueError(f"it does not hold at inside = {inside!r}; begin where it does")
    while abs(outside - inside) > precision:
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if holds(middle) else (inside, middle)
    return inside


def first_crossing(function: Callable[[float], float], edges: Sequence[float]) -> float:
    """Where `function` first reaches zero from below: searched from edge to edge, then a root.

    Edges ascend or descend.  It is the first edge where the function is not below zero there, and
    infinite where it stays below at all of them; what happens and ends between two edges is missed.
    Raises ValueError for fewer than two edges or edges that turn back.
    """
    steps = np.diff(edges)
    if not steps.size or not (np.all(steps > 0) or np.all(steps < 0)):
        raise ValueError(f"edges = {list(edges)}: give two or more, all upward or all downward")
    if function(edges[0]) >= 0:
        return float(edges[0])
    for near, far in pairwise(edges):
        if function(far) >= 0:
            return float(brentq(function, near, far, xtol=1e-12))
    return np.inf
