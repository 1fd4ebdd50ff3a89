"""Learning laws: from the error of one pass to the correction of the next command."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.zdomain import NoncausalFilter, Plant


@dataclass(frozen=True, eq=False)
class LearningLaw:
    """A noncausal filter H from error to correction, and a symmetric filter q on the command.

    Raises ValueError when q is not symmetric.
    """

    filter: NoncausalFilter
    q: np.ndarray = field(default_factory=lambda: np.ones(1))

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", zdomain.odd_symmetric(self.q))

    @property
    def look_ahead(self) -> int:
        """Samples of error beyond k that the new command at k needs."""
        return self.filter.advance + self.q.size // 2

    @property
    def poles(self) -> np.ndarray:
        """Poles of the law's own recursion, by decreasing magnitude."""
        roots = np.roots(np.trim_zeros(self.filter.a, "b"))
        return roots[np.argsort(-np.abs(roots), kind="stable")]


def zero_phase_law(
    plant: Plant, gain: float = 1.0, normalisation: str = "dc", q: ArrayLike = (1.0,)
) -> LearningLaw:
    """Law that inverts poles and stable zeros and reflects the others (Lee, Oh and Kim, eq. 11)."""
    gain = zdomain.real_number(gain, "gain")
    inverse = zdomain.zero_phase_inverse(plant, normalisation=normalisation)
    return LearningLaw(NoncausalFilter(gain * inverse.b, inverse.a, inverse.advance), q)


def p_type_law(gain: float, advance: int, q: ArrayLike = (1.0,)) -> LearningLaw:
    """Law that sends the error `advance` samples back, times a gain."""
    return LearningLaw(NoncausalFilter([zdomain.real_number(gain, "gain")], [1.0], advance), q)


def norm_optimal_law(plant: Plant, weight: float, period: int) -> LearningLaw:
    """Law conj(G)/(|G|^2 + weight) on the harmonics of a period, as a symmetric span of taps.

    It minimises |e|^2 + weight |change of command|^2 from one pass to the next; `weight`, not
    negative, is in the plant's units squared.  The taps repeat with the period, so the law holds
    for passes that repeat for ever.
    """
    weight, period = zdomain.real_number(weight, "weight"), zdomain.whole_number(period, "period")
    if weight < 0:
        raise ValueError(f"weight = {weight!r} must not be negative")
    gain = zdomain.response(plant, zdomain.unit_circle(period))
    cost = np.abs(gain) ** 2 + weight
    if not np.all(cost > 1e-24 * np.abs(gain).max() ** 2):
        raise ValueError(f"weight = {weight!r}: the plant stops a harmonic; give a larger one")
    taps = np.fft.ifft(np.conj(gain) / cost).real
    half = (period - 1) // 2
    return LearningLaw(NoncausalFilter(np.roll(taps, half), [1.0], half))
