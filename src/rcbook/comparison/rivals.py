"""Controllers that practice uses where a memory of a period is not wanted: the rivals of this book.

Each of them is a `Feedback` on the error and is closed to a loop like any other controller, so that
everything a loop is asked can be asked of them too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rcbook import zdomain
from rcbook.loops.memory import Memory, RepetitiveController, resonators
from rcbook.zdomain import NoncausalFilter, Plant, add, multiply, shift, split_zeros


@dataclass(frozen=True, eq=False)
class Feedback:
    """gain unit(z^-1)/denominator(z^-1) on the error; a loop takes it as it takes `Resonators`.

    `period` is that of the task, which the controller itself need not know.
    Raises ValueError for a denominator that begins with 0 and numbers that are not finite.
    """

    unit: np.ndarray  # numerator at unit gain, polynomial in z^-1
    denominator: np.ndarray  # polynomial in z^-1
    period: float  # samples
    gain: float = 1.0

    def __post_init__(self) -> None:
        unit = zdomain.polynomial(self.unit, "numerator")
        denominator = zdomain.polynomial(self.denominator, "denominator")
        if denominator[0] == 0:
            raise ValueError(f"denominator = {denominator} begins with 0: drop it, and lose delay")
        object.__setattr__(self, "unit", unit)
        object.__setattr__(self, "denominator", denominator)
        object.__setattr__(self, "period", zdomain.real_number(self.period, "period", True))
        object.__setattr__(self, "gain", zdomain.real_number(self.gain, "gain"))

    @property
    def numerator(self) -> np.ndarray:
        """Causal numerator, polynomial in z^-1."""
        return self.gain * self.unit


def as_feedback(controller: Any, late: int = 0) -> Feedback:
    """Any controller with numerator, denominator and period, its answer `late` samples later.

    Raises ValueError for a lateness that is not whole or negative.
    """
    late = zdomain.whole_number(late, "late", 0)
    return Feedback(shift(controller.numerator, late), controller.denominator, controller.period)


def proportional_integral(period: float, gain: float, alpha: float) -> Feedback:
    """gain (1 + alpha z^-1/(1 - z^-1)), as `repetitive.pi_controller` has it."""
    alpha = zdomain.real_number(alpha, "alpha")
    return Feedback([1.0, alpha - 1.0], [1.0, -1.0], period, gain)


def peak_filter(
    plant: Plant, period: float, harmonics: Sequence[int], gain: float, damping: float
) -> Feedback:
    """The resonators of `memory.resonators`, each with its pole moved inside the unit circle.

    The pole of harmonic h has the magnitude exp(-damping w), w = 2 pi h/period, so that the peak is
    2 damping wide in relative frequency and of height gain/(2 damping w) at its harmonic.
    Raises ValueError for a damping that is not positive, for harmonics below 1 or at half the
    sampling frequency, and as `resonators` does.
    """
    damping = zdomain.real_number(damping, "damping", positive=True)
    bank, denominator = np.zeros(1), np.ones(1)
    for h in harmonics:
        if not 0 < 2 * h < period:
            raise ValueError(f"harmonic {h} of {period:g} samples has no peak; leave it out")
        one = resonators(plant, period, [h], 1.0)
        angle = 2 * np.pi * h / period
        shrunk = np.exp(-damping * angle) ** np.arange(3)
        # The pole and the zero shrink alike, so that the phase at the harmonic stays.
        top, bottom = one.bank * shrunk[: one.bank.size], one.denominator * shrunk
        bank = add(multiply(bank, bottom), multiply(top, denominator))
        denominator = multiply(denominator, bottom)
    gain = zdomain.real_number(gain, "gain", positive=True)
    return Feedback(bank, denominator, period, gain)


def disturbance_observer(plant: Plant, period: float, pole: float) -> Feedback:
    """What undoes the disturbance that a model of the plant does not explain, through a low-pass.

    With G = z^-d B+ B-/A and the low-pass F = (1 - pole)/(1 - pole z^-1) the estimate of a
    disturbance at the plant input is F (A/(B+ b) y - z^-d B-/b u), b = B-(1): causal as it stands.
    Written on the error it is F A/(B+ b)/(1 - F z^-d B-/b), which makes of noise F z^-d B-/b.
    Source: Umeno and Hori (1991); of zeros that are kept only the steady gain is undone.
    Raises ValueError for a pole outside 0 <= pole < 1, an unstable plant, and one with no gain at
    z = 1.
    """
    if not 0 <= zdomain.real_number(pole, "pole") < 1:
        raise ValueError(f"pole = {pole!r} of the low-pass: choose 0 <= pole < 1")
    if not plant.is_stable:
        raise ValueError(f"the plant has poles {plant.poles}; close a loop round it first")
    b_plus, b_minus = split_zeros(plant.b)
    steady = float(b_minus.sum())
    if abs(steady) < 1e-12 * np.abs(b_minus).sum():
        raise ValueError("the plant has a zero at z = 1: no constant disturbance can be undone")
    seen = (1 - pole) * shift(b_minus / steady, plant.delay)
    denominator = multiply(b_plus, add(np.array([1.0, -pole]), -seen))
    return Feedback((1 - pole) * plant.a / steady, denominator, period)


def second_order(
    compensator: NoncausalFilter, memory: Memory, gain: float, share: float
) -> Feedback:
    """gain C H/(1 - H) (1 + share H/(1 - H)): proportional and integral from period to period.

    A second pole at every harmonic, as `several(memory, memory)` has it, forgives an error of the
    period; a small share spares the noise that the latter, of gain and share one, lets through.
    Raises ValueError as `RepetitiveController` does.
    """
    once = RepetitiveController(compensator, memory, 1.0)
    share = zdomain.real_number(share, "share", positive=True)
    zero = add(np.ones(1), -(1 - share) * once.memory.polynomial)
    denominator = multiply(once.denominator, once.memory.generator)
    return Feedback(multiply(once.numerator, zero), denominator, once.period, gain)
