"""Sampled plants, and filters that look ahead."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rcbook.zdomain.checks import polynomial, real_number, whole_number
from rcbook.zdomain.polynomials import evaluate, shift, sorted_roots

if TYPE_CHECKING:  # what takes a second to import is imported where it is used
    import control

_ON_CIRCLE = 1e-9  # a pole this close to the unit circle is taken to lie on it


@dataclass(frozen=True, eq=False)
class Plant:
    """Sampled plant z^-delay b(z^-1)/a(z^-1), with a scaled so that a[0] = 1.

    Raises ValueError for a[0] = 0 or a negative delay (improper), b[0] = 0 (count that as delay),
    NaN, and a sampling interval that is not positive.
    """

    b: np.ndarray
    a: np.ndarray
    delay: int
    dt: float  # s

    def __post_init__(self) -> None:
        a, b = polynomial(self.a, "denominator a"), polynomial(self.b, "numerator b")
        if a[0] == 0:
            raise ValueError(f"a = {a} begins with 0: the plant is improper; drop the zero")
        if b[0] == 0:
            raise ValueError(f"b = {b} begins with 0; drop it and add one to the delay")
        with np.errstate(over="ignore"):
            b, scaled = b / a[0], a / a[0]
        if not np.all(np.isfinite([*b, *scaled])):
            raise ValueError(f"a = {a} begins too small to divide by; scale a and b up")
        object.__setattr__(self, "dt", real_number(self.dt, "sampling interval dt", positive=True))
        object.__setattr__(self, "b", polynomial(b))
        object.__setattr__(self, "a", polynomial(scaled))
        object.__setattr__(self, "delay", whole_number(self.delay, "delay", least=0))

    @property
    def poles(self) -> np.ndarray:
        """Poles away from the origin, by decreasing magnitude."""
        return sorted_roots(self.a)

    @property
    def zeros(self) -> np.ndarray:
        """Finite zeros away from the origin, by decreasing magnitude."""
        return sorted_roots(self.b)

    @property
    def numerator(self) -> np.ndarray:
        """z^-delay b(z^-1) with its leading zeros written out."""
        return shift(self.b, self.delay)

    @property
    def denominator(self) -> np.ndarray:
        """a(z^-1), under the name that controllers have for it."""
        return self.a

    @property
    def is_stable(self) -> bool:
        """Whether every pole lies inside the unit circle."""
        return bool(np.all(np.abs(self.poles) < 1 - _ON_CIRCLE))

    def to_control(self) -> control.TransferFunction:
        """The same plant as a python-control transfer function in z."""
        import control

        length = max(self.numerator.size, self.a.size)
        in_z = [np.pad(p, (0, length - p.size)) for p in (self.numerator, self.a)]
        return control.TransferFunction(*in_z, self.dt)


@dataclass(frozen=True, eq=False)
class NoncausalFilter:
    """z^advance b(z^-1)/a(z^-1): it looks `advance` samples ahead, so only a delay can hold it."""

    b: np.ndarray
    a: np.ndarray
    advance: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "b", polynomial(self.b, "numerator b"))
        object.__setattr__(self, "a", polynomial(self.a, "denominator a"))
        object.__setattr__(self, "advance", whole_number(self.advance, "advance", least=0))


def response(plant: Plant | NoncausalFilter, z: ArrayLike) -> np.ndarray:
    """Value of a plant or a noncausal filter at the points z."""
    z = np.asarray(z)
    power = plant.advance if isinstance(plant, NoncausalFilter) else -plant.delay
    return z ** float(power) * evaluate(plant.b, z) / evaluate(plant.a, z)
