"""What eqs 23 to 25 print, and the same numbers computed for a mill."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rcbook import zdomain
from rcbook.machines import spindle_drive
from rcbook.machines.face_mill.mill import FaceMill, sampling_angle
from rcbook.machines.face_mill.model import control_model
from rcbook.zdomain import Plant

# Of the controller of eq. 25, the tiny ones too: from z^5 down, and from z^-1 down.
TSAO_PONG1991_NUMERATOR = (1.2, 0.24, -0.48, 0.34, 0.34, -0.81, 0.1, 0.82, -7.5e-9, 1.3e-24)
TSAO_PONG1991_NUMERATOR += (-9.1e-42,)
TSAO_PONG1991_DENOMINATOR = (1.55, -3.80e-4, 4.62e-12, 3.86e-29)
TSAO_PONG1991_BOUND = 116  # b, in the denominator


class PrintedController(NamedTuple):
    """A controller of the printed digits, with the parts of a `Controller`."""

    numerator: np.ndarray
    denominator: np.ndarray


def printed_controller(
    q: np.ndarray, leading: float, numerator_delay: int, generator_delay: int
) -> PrintedController:
    """Eq. 25 in its printed digits, with the filter q of eq. 26 in five taps.

    What is damaged in print is given: the leading coefficient of the denominator, and the delays
    that stand with numerator and generator, as positive exponents of z^-1.
    """
    numerator = np.convolve(q, TSAO_PONG1991_NUMERATOR)  # its first term is that of z^7
    generator = zdomain.add(np.ones(1), -zdomain.shift(q, generator_delay - 2))
    denominator = np.convolve([leading, *TSAO_PONG1991_DENOMINATOR], generator)
    return PrintedController(
        zdomain.shift(numerator, numerator_delay - 7), TSAO_PONG1991_BOUND * denominator
    )


class SampledDigits(NamedTuple):
    """Eqs 23 to 25 for a mill."""

    plant: Plant  # command to peak force
    turned: Plant  # command to what the cutter turns in an interval, without the moving sum
    digits: np.ndarray  # gain and slow pole of eq. 23; slow pair (2) and gain of eq. 24; of eq. 25
    # the denominator (4) and the numerator (9), without what is tiny


def sampled_digits(mill: FaceMill) -> SampledDigits:
    """The sampled model, and the numbers of eqs 23 to 25 that depend on the cut, 18 of them."""
    driven = spindle_drive.speed_driven(mill.drive, mill.torque_slope)
    turning = spindle_drive.in_angle(driven, mill.speed)["speed", "command"]
    turned = zdomain.interval_integral(turning, sampling_angle(mill))
    lead = mill.force_slope * (turning.C @ turning.A @ turning.B).item()
    slow, pair = (np.sort_complex(p)[-1] for p in (turning.poles(), turned.poles))
    plant = control_model(mill)
    inverse = zdomain.zero_phase_inverse(plant)
    numerator = inverse.b[:9] * (5 * (1 - np.sort(turned.zeros.real)[0])) ** 2
    of_model = [lead, slow.real, pair.real, abs(pair.imag), plant.b[0]]
    return SampledDigits(plant, turned, np.array([*of_model, *inverse.a[:4], *numerator]))


def last_coefficients(mill: FaceMill, roots: Sequence[float]) -> list[float]:
    """The last two numerator coefficients of eq. 25 and the last of its denominator.

    They are products of roots so small that rounding makes them: two poles and a zero, given.
    """
    _, turned, digits = sampled_digits(mill)
    slow = sorted(turned.poles, key=abs)[:1:-1]  # the pair and the third pole
    a = np.poly([*slow, *roots[:2]]).real
    b_minus = np.convolve(np.ones(5), [1, -np.sort(turned.zeros.real)[0]])
    return [*np.convolve(a, b_minus[::-1])[-2:], -digits[8] * roots[2]]
