"""The one idea: an inverse of the plant that is real and never negative on the unit circle.

A zero that can be cancelled is cancelled; one that cannot is reflected, which costs gain and no
phase, and looks ahead.  Every loop of this library has this inverse in it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rcbook.zdomain.checks import polynomial, real_number
from rcbook.zdomain.plant import NoncausalFilter, Plant
from rcbook.zdomain.polynomials import multiply

NORMALISATIONS = ("peak", "dc", "l1")
# A zero of multiplicity m is known to eps^(1/m) only; keeping one that lies inside does no harm.
_NEAR_CIRCLE = 1e-4


def zero_phase_inverse(
    plant: Plant,
    radius: float = 1.0,
    normalisation: str = "peak",
    cancel_unstable: bool = False,
) -> NoncausalFilter:
    """Inverse C = z^delay A(z^-1) B-(z) / (b B+(z^-1)), so that plant * C = |B-|^2 / b >= 0.

    B- holds the zeros of magnitude `radius` or more; b is the peak of |B-|^2 over the unit circle
    ("peak", which keeps 0 <= plant * C <= 1), its value at z = 1 ("dc"), or the square of the sum
    of absolute values of B- ("l1", never below the peak).  `cancel_unstable` inverts the model of
    an unstable plant as well, which is of use only where the plant itself is another, stable one.
    Source: Tomizuka (1987); Horng (1989), eqs 15 and 18-20.
    Raises ValueError for an unstable plant, an unknown normalisation, a B- that vanishes at z = 1
    under "dc", and zeros on or outside the unit circle left to be cancelled.
    """
    if not (plant.is_stable or cancel_unstable):
        raise ValueError(
            f"the plant has a pole of magnitude {np.abs(plant.poles).max():.6g}, and an inverse "
            "would cancel it; stabilise the plant first (for example by PI control)"
        )
    b_plus, b_minus = split_zeros(plant.b, radius)
    b = _normaliser(b_minus, normalisation)
    return NoncausalFilter(
        b=multiply(plant.a, b_minus[::-1]) / b,
        a=b_plus,
        advance=plant.delay + b_minus.size - 1,
    )


def split_zeros(b: ArrayLike, radius: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Split b = B+ B-, B- monic with the zeros of magnitude `radius` or more.

    Zeros on the unit circle, or inside it by less than 1e-4, go to B- whenever radius <= 1.
    Raises ValueError when b begins with 0, the radius is not positive, or it is so large that
    zeros on or outside the unit circle would stay in B+ and be cancelled.
    """
    b = polynomial(b, "numerator b")
    if b[0] == 0:
        raise ValueError(f"b = {b} begins with 0; drop it and count it as delay")
    radius = real_number(radius, "radius", positive=True)
    zeros = np.roots(b)
    kept = np.abs(zeros) >= radius - _NEAR_CIRCLE
    cancelled = zeros[~kept]
    if np.any(np.abs(cancelled) >= 1 - _NEAR_CIRCLE):
        raise ValueError(
            f"radius = {radius!r} would cancel the zeros "
            f"{cancelled[np.abs(cancelled) >= 1 - _NEAR_CIRCLE]} "
            "on or outside the unit circle; choose a radius of 1 or less"
        )
    b_plus = b[0] * np.atleast_1d(np.poly(cancelled)).real
    return b_plus, np.atleast_1d(np.poly(zeros[kept])).real


def _normaliser(b_minus: np.ndarray, normalisation: str) -> float:
    if normalisation == "l1":
        return float(np.abs(b_minus).sum() ** 2)
    if normalisation == "dc":
        dc = float(b_minus.sum() ** 2)
        if dc < 1e-12 * np.abs(b_minus).sum() ** 2:
            raise ValueError("B- vanishes at z = 1, so 'dc' divides by zero; use 'peak' or 'l1'")
        return dc
    if normalisation == "peak":
        return _peak_square(b_minus)
    raise ValueError(f"normalisation {normalisation!r} is none of {', '.join(NORMALISATIONS)}")


def _peak_square(p: np.ndarray) -> float:
    """Exact maximum of |p|^2 over the unit circle, from the stationary points of a cosine sum."""
    r = np.correlate(p, p, "full")[p.size - 1 :]
    cosines = np.polynomial.chebyshev.Chebyshev(np.concatenate([r[:1], 2 * r[1:]]))
    inner = cosines.deriv().roots() if p.size > 2 else np.zeros(0)
    x = np.concatenate([[-1.0, 1.0], np.clip(np.real(inner), -1, 1)])
    return float(cosines(x).max())
