"""Coercion at the door: what enters is what its name says, or refused with the mend."""

from __future__ import annotations

from numbers import Integral, Real

import numpy as np
from numpy.typing import ArrayLike


def polynomial(coefficients: ArrayLike, name: str = "polynomial") -> np.ndarray:
    """Coerce to a read-only 1-D float array, lowest power of z^-1 first.

    Raises ValueError when it is empty, has more than one axis, or holds NaN or infinity.
    """
    array = np.array(coefficients, ndmin=1)
    if np.iscomplexobj(array):
        raise ValueError(f"{name} = {array} is complex; give real coefficients")
    array = array.astype(float)
    if array.ndim != 1 or array.size == 0:
        raise ValueError(f"{name} has shape {array.shape}; give one non-empty row of coefficients")
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{name} = {array} holds NaN or infinity; give finite coefficients")
    array.setflags(write=False)
    return array


def whole_number(value: object, name: str, least: int = 1, mend: str = "round it") -> int:
    """Coerce to an int not below `least`; 6.0 is accepted, 6.4 is not.

    Raises ValueError otherwise.
    """
    whole = isinstance(value, Integral) or (isinstance(value, float) and value.is_integer())
    if not whole or isinstance(value, bool) or value < least:
        raise ValueError(f"{name} = {value!r} must be a whole number not below {least}; {mend}")
    return int(value)


def real_number(value: object, name: str, positive: bool = False) -> float:
    """Coerce to a finite float, a positive one if asked.

    Raises ValueError otherwise.
    """
    fits = isinstance(value, Real) and not isinstance(value, bool) and np.isfinite(value)
    if not fits or (positive and not value > 0):
        kind = "positive" if positive else "real"
        raise ValueError(f"{name} = {value!r} must be a {kind} finite number")
    return float(value)
