"""One run in plain numbers and many in arrays: the little in which their arithmetic differs.

A value per run is a number for one run and an array for many.  What adds up, teeth and modes of the
drive, is a list for one run; for many it is a list of few arrays, whose last axis counts the runs.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Arithmetic(NamedTuple):
    """For one run, whose numbers NumPy would only slow down, or for many side by side."""

    rise: Callable  # e^x - 1
    choose: Callable  # the second where the first is true, else the third
    some: Callable  # whether it is true of any run
    total: Callable  # sum of a part of what adds up
    largest: Callable
    each: Callable  # an array whose last axis counts the runs, taken apart along the others
    teeth: Callable  # an array whose first axis counts teeth, and its last one the runs
    pairs: bool  # whether one mode stands for a conjugate pair
    modes: Callable  # values of modes, and which are real
    string: Callable  # parts of many steps, one after the other


def _rise(x: complex) -> complex:
    return math.expm1(x) if isinstance(x, float) else cmath.exp(x) - 1


def _same(x: float) -> float:
    return x


ONE = Arithmetic(
    _rise,
    choose=lambda true, yes, no: yes if true else no,
    some=bool,
    total=_same,
    largest=_same,
    each=lambda a: a[..., 0].tolist(),
    teeth=lambda a: a[..., 0].tolist(),
    pairs=True,
    modes=lambda a, real: [x.real if r else x for x, r in zip(a.tolist(), real, strict=True)],
    string=np.array,
)
MANY = Arithmetic(
    np.expm1,
    choose=np.where,
    some=lambda a: a.any(),
    total=np.add.reduce,
    largest=np.maximum.reduce,
    each=np.asarray,
    teeth=lambda a: [np.moveaxis(a, 0, -2)],
    pairs=False,
    modes=lambda a, real: [a[:, None]],
    string=lambda parts: np.concatenate(parts, axis=-1),
)
