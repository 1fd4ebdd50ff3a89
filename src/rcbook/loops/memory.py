"""What a loop remembers, and the factor by which one period passes an error on to the next.

A repetitive controller is C H/(1 - H) times a gain: a compensator C, which looks ahead, in front of
a memory H, which pays for it with delay.  The plain memory of a period of N samples is q z^-N, q a
symmetric filter.  Whatever the memory, the closed loop has the roots of 1 - H (1 - gain C G), so

    factor(z) = z^N H (1 - gain C G),    for the plain memory q (1 - gain C G),

below one in magnitude on the whole unit circle is sufficient for stability, and says by how much
an error of that frequency shrinks in a period.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.zdomain import NoncausalFilter, Plant, add, multiply, shift


@dataclass(frozen=True, eq=False)
class Memory:
    """H = taps[0] z^-first + taps[1] z^-(first+1) + ..: what a loop of `period` samples remembers.

    Disturbances d with (1 - H) d = 0 are learned away.
    Raises ValueError for taps that are all zero or not finite, a first delay below 1, and a period
    that is not positive.
    """

    taps: np.ndarray
    first: int  # samples of delay of the first tap
    period: float  # samples, not necessarily whole; the longest one of several

    def __post_init__(self) -> None:
        object.__setattr__(self, "taps", zdomain.polynomial(self.taps, "taps of the memory"))
        if not np.any(self.taps):
            raise ValueError("all taps of the memory are 0: it remembers nothing; leave it out")
        mend = "lengthen the period or shorten q"
        object.__setattr__(self, "first", zdomain.whole_number(self.first, "first", 1, mend))
        object.__setattr__(self, "period", zdomain.real_number(self.period, "period", True))

    @property
    def look_ahead(self) -> float:
        """Samples by which the first tap comes before the period: of q its half width."""
        return self.period - self.first

    @property
    def polynomial(self) -> np.ndarray:
        """H as a polynomial in z^-1."""
        return shift(self.taps, self.first)

    @property
    def generator(self) -> np.ndarray:
        """1 - H, which vanishes at every harmonic of the period where q = 1."""
        return add(np.ones(1), -self.polynomial)

    def gain(self, z: ArrayLike) -> np.ndarray:
        """z^N H at points z of the unit circle: for a plain memory the gain of q."""
        z = np.asarray(z, dtype=complex)
        return z**self.look_ahead * zdomain.evaluate(self.taps, z)


def plain(period: float, q: ArrayLike = (1.0,), degree: int = 3) -> Memory:
    """q z^-N, N `period` in samples; between the samples an interpolator of `degree` stands in.

    The interpolator of a fractional period is Lagrange's, of odd degree: exact for polynomials up
    to it, and falling below one in gain towards half the sampling frequency.
    Source: Laakso et al. (1996), IEEE Signal Processing Magazine 13(1).
    Raises ValueError for a q that is not symmetric or wider than the period, and an even degree.
    """
    period = zdomain.real_number(period, "period", positive=True)
    q, whole = zdomain.odd_symmetric(q), int(np.floor(period))
    half, fraction = q.size // 2, period - whole
    if fraction:
        if zdomain.whole_number(degree, "degree") % 2 == 0:
            raise ValueError(f"degree = {degree}: give an odd one, centred on the fraction")
        q, half = np.convolve(q, _lagrange(fraction, degree)), half + degree // 2
    if whole <= half:
        raise ValueError(
            f"the memory looks {half} samples ahead and needs one of its own, more than the "
            f"period of {period:g} holds; lengthen the period or shorten q"
        )
    return Memory(q, whole - half, period)


def _lagrange(fraction: float, degree: int) -> np.ndarray:
    """Taps at -(degree // 2) .. degree - degree // 2 samples that delay by a fraction of one."""
    nodes = np.arange(degree + 1) - degree // 2
    others = [np.delete(nodes, i) for i in range(degree + 1)]
    return np.array([np.prod((fraction - o) / (n - o)) for n, o in zip(nodes, others, strict=True)])


def odd_harmonic(period: float, q: ArrayLike = (1.0,)) -> Memory:
    """-q z^-N/2: half the memory and half the wait, for a signal of odd harmonics only.

    Source: Grino and Costa-Castello (2005), Automatica 41(1).
    Raises ValueError as `plain` does.
    """
    half = plain(zdomain.real_number(period, "period", positive=True) / 2, q)
    return Memory(-half.taps, half.first, 2 * half.period)


def several(*memories: Memory) -> Memory:
    """H1 + H2 - H1 H2 and so on: learns what any of them learns, so 1 - H = (1 - H1)(1 - H2) ..

    The same memory twice is one of second order, which forgives an error of the period.  The period
    of several is the longest of theirs.
    Raises ValueError without a memory, and TypeError for what is none.
    """
    if not memories:
        raise ValueError("no memory is given; name one or more")
    for each in memories:
        if not isinstance(each, Memory):
            raise TypeError(f"{each!r} is no Memory; make one with `plain` or `odd_harmonic`")
    remembered = add(np.ones(1), -multiply(*(each.generator for each in memories)))
    first = min(each.first for each in memories)
    return Memory(remembered[first:], first, max(each.period for each in memories))


def as_memory(memory: Memory | float) -> Memory:
    """The memory itself, or the plain one of a period in samples.

    Raises TypeError for what is neither, and ValueError as `plain` does.
    """
    if isinstance(memory, Memory):
        return memory
    if not isinstance(memory, int | float | np.number) or isinstance(memory, bool):
        raise TypeError(f"memory = {memory!r}: give a Memory or a period in samples")
    return plain(float(memory))


def factor(memory: Memory, compensated: ArrayLike, z: ArrayLike) -> np.ndarray:
    """z^N H (1 - gain C G) at points z of the unit circle, `compensated` being gain C G there."""
    return memory.gain(z) * (1 - np.asarray(compensated))


def gain_bound(compensated: ArrayLike) -> np.ndarray:
    """Largest gain k up to which |1 - k g| < 1 for all values g of C G along the first axis.

    That is the least 2 Re g/|g|^2, and 0 where the real part of some g is not positive.
    Raises ValueError for values that are not finite.
    """
    g = np.asarray(compensated, dtype=complex)
    if not np.all(np.isfinite(g)):
        raise ValueError("C G holds NaN or infinity; leave out the poles of the plant")
    with np.errstate(divide="ignore", invalid="ignore"):
        bounds = np.where(g.real > 0, 2 * g.real / np.abs(g) ** 2, 0.0)
    return bounds.min(axis=0)


# ---- controllers ----


@dataclass(frozen=True, eq=False)
class RepetitiveController:
    """gain C H/(1 - H): compensator C, memory H; a number for H is the period of a plain one.

    Raises ValueError when the look-ahead of C does not fit into the delay of the memory, and for a
    gain that is not positive and finite; TypeError for a compensator that is no NoncausalFilter.
    """

    compensator: NoncausalFilter
    memory: Memory
    gain: float

    def __post_init__(self) -> None:
        if not isinstance(self.compensator, NoncausalFilter):
            raise TypeError(
                f"compensator = {self.compensator!r}: give a NoncausalFilter, such as "
                "zdomain.zero_phase_inverse(plant) or lead(samples)"
            )
        object.__setattr__(self, "memory", as_memory(self.memory))
        gain = zdomain.real_number(self.gain, "repetitive gain", positive=True)
        object.__setattr__(self, "gain", gain)
        if self.delay < 0:
            raise ValueError(
                f"compensator and memory look {self.look_ahead:g} samples ahead, more than the "
                f"period of {self.period:g} holds; lengthen the period or shorten q"
            )

    @property
    def period(self) -> float:
        """N, samples."""
        return self.memory.period

    @property
    def look_ahead(self) -> float:
        """Samples by which compensator and memory look ahead of a period ago."""
        return self.compensator.advance + self.memory.look_ahead

    @property
    def delay(self) -> int:
        """Samples of delay left in front of the compensator once its look-ahead is paid for."""
        return self.memory.first - self.compensator.advance

    @property
    def numerator(self) -> np.ndarray:
        """Causal numerator, polynomial in z^-1."""
        return self.gain * shift(multiply(self.memory.taps, self.compensator.b), self.delay)

    @property
    def denominator(self) -> np.ndarray:
        """Causal denominator, polynomial in z^-1: the compensator's times 1 - H."""
        return multiply(self.compensator.a, self.memory.generator)


def lead(samples: int, gain: float = 1.0) -> NoncausalFilter:
    """gain z^samples: the compensator of a plant of which little more than its delay is known.

    Raises ValueError for samples that are not whole or negative, and a gain that is not finite.
    """
    samples = zdomain.whole_number(samples, "samples", 0, "a lead looks ahead; give 0 or more")
    return NoncausalFilter([zdomain.real_number(gain, "gain")], [1.0], samples)


@dataclass(frozen=True, eq=False)
class Resonators:
    """gain times a sum of resonators: a controller that learns chosen harmonics and no others.

    Made by `resonators`; a loop takes it as it takes a `RepetitiveController`.
    """

    bank: np.ndarray  # numerator at unit gain, polynomial in z^-1
    denominator: np.ndarray  # polynomial in z^-1
    period: float  # samples
    gain: float

    @property
    def numerator(self) -> np.ndarray:
        """Causal numerator, polynomial in z^-1."""
        return self.gain * self.bank


def resonators(plant: Plant, period: float, harmonics: Sequence[int], gain: float) -> Resonators:
    """A resonator cos(w k - arg G)/|G| at each harmonic w = 2 pi h/period of a plant's response G.

    A small enough gain then shrinks the error of each by gain/2 a sample.
    Raises ValueError for harmonics that repeat or lie outside 0 to period/2, and for one that the
    plant stops; TypeError for what is no Plant.
    """
    if not isinstance(plant, Plant):
        raise TypeError(f"plant = {plant!r}: give the Plant that the resonators act on")
    period = zdomain.real_number(period, "period", positive=True)
    if len(set(harmonics)) != len(harmonics) or not len(harmonics):
        raise ValueError(f"harmonics = {list(harmonics)}: name each of them once")
    bank, denominator = np.zeros(1), np.ones(1)
    for h in harmonics:
        h = zdomain.whole_number(h, "harmonic", 0)
        if 2 * h > period:
            raise ValueError(f"harmonic {h} lies beyond half of {period:g} samples; leave it out")
        angle = 2 * np.pi * h / period
        response = complex(zdomain.response(plant, np.exp(1j * angle)))
        if abs(response) < 1e-12:
            raise ValueError(f"the plant stops harmonic {h}; leave it out")
        if 2 * h in (0, period):
            top, bottom = np.ones(1) / response.real, np.array([1.0, -np.cos(angle)])
        else:
            turned = np.array([1.0, -np.exp(-1j * angle)]) / response
            top, bottom = turned.real, np.array([1.0, -2 * np.cos(angle), 1.0])
        bank = add(multiply(bank, bottom), multiply(top, denominator))
        denominator = multiply(denominator, bottom)
    return Resonators(bank, denominator, period, zdomain.real_number(gain, "gain", positive=True))
