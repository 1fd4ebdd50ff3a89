"""Noncircular boring at variable speed: a piezoelectric boring bar, sampled at spindle angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.integrate
from numpy.typing import ArrayLike

from rcbook.zdomain import real_number, whole_number

if TYPE_CHECKING:  # what takes a second to import is imported where it is used
    import control

_WHOLE = 1e-9  # relative distance from a whole number that counts as one


@dataclass(frozen=True)
class BoringBar:
    """The tool stage b0/(s^4 + a3 s^3 + a2 s^2 + a1 s + a0) 1/(m s^2 + c s + k), and its servo.

    Source: Hanson and Tsao (2000), eq. 16.
    """

    b0: float
    amplifier: tuple[float, float, float, float]  # a0, a1, a2, a3 in 1/s^4 .. 1/s
    mass: float  # kg
    damping: float  # N s/m
    stiffness: float  # N/m
    sampling_interval: float  # s, nominal
    amplitude: float  # m, of the reference of eq. 19

    @property
    def dc_gain(self) -> float:
        """b0/(a0 k), the output to a steady input of one, in the units of the source."""
        return self.b0 / (self.amplifier[0] * self.stiffness)

    @property
    def plant(self) -> control.StateSpace:
        """The stage in state space, scaled to unit DC gain.

        A compensator that is divided by the size of the numerator takes up any scale, so the
        loop does not change.
        """
        import control

        denominator = np.polymul(
            [1.0, *self.amplifier[::-1]], [self.mass, self.damping, self.stiffness]
        )
        scaled = control.tf([denominator[-1]], denominator)
        return control.ss(scaled)

    def reference(self, periods: int, n: int) -> np.ndarray:
        """n samples, in m, of a sine wave with `periods` periods in them (eq. 19)."""
        cycles = np.arange(whole_number(n, "n")) * whole_number(periods, "periods", 0)
        return self.amplitude * np.sin(2 * np.pi * cycles / n)


HANSON_TSAO2000 = BoringBar(  # eq. 17; section 5
    b0=3.34e18,
    amplifier=(2.18e18, 3.30e14, 1.04e10, 1.79e5),
    mass=0.365,
    damping=208.0,
    stiffness=12.8e6,
    sampling_interval=250e-6,
    amplitude=12.5e-6,
)


def sinusoidal_intervals(nominal: float, gamma: float, n: int) -> np.ndarray:
    """n sampling intervals in s, nominal (1 + gamma sin(2 pi k/n)).

    Source: Hanson and Tsao (2000), eq. 18.
    Raises ValueError when gamma is not between -1 and 1: an interval would not be positive.
    """
    nominal, gamma = real_number(nominal, "nominal", positive=True), real_number(gamma, "gamma")
    if not abs(gamma) < 1:
        raise ValueError(f"gamma = {gamma!r} makes an interval vanish; stay between -1 and 1")
    angle = 2 * np.pi * np.arange(whole_number(n, "n")) / n
    return nominal * (1 + gamma * np.sin(angle))


def nose(time: ArrayLike, centre: float, width: float, period: float) -> np.ndarray:
    """A bump of height 1 once in every period (s): exp(-(t - centre)^2/(2 width^2)), times in s.

    Raises ValueError for a width or period that is not positive.
    """
    width = real_number(width, "width", positive=True)
    period = real_number(period, "period", positive=True)
    away = np.asarray(time, dtype=float) - real_number(centre, "centre")
    return np.exp(-0.5 * (((away + period / 2) % period - period / 2) / width) ** 2)


def speed_law(time: ArrayLike, nominal: float, amplitude: float, frequency: float) -> np.ndarray:
    """Spindle speed nominal + amplitude sin(2 pi frequency t), speeds in rad/s, frequency in Hz.

    Source: Hanson and Tsao (2000), eq. 14.
    """
    return nominal + amplitude * np.sin(2 * np.pi * frequency * np.asarray(time, dtype=float))


def relative_speed_law(time: ArrayLike, nominal: float, rva: float, rvf: float) -> np.ndarray:
    """Spindle speed nominal (1 + rva sin(rvf nominal t)) in rad/s.

    Source: Hanson and Tsao (2000), eq. 15.
    """
    return nominal * (1 + rva * np.sin(rvf * nominal * np.asarray(time, dtype=float)))


def angle_triggered_intervals(
    speed: Callable[[float], float], step: float, n: int, start: float = 0.0
) -> np.ndarray:
    """n intervals in s between samples that the spindle triggers every `step` rad.

    `speed` is the spindle speed in rad/s at a time in s, counted from the first sample at `start`.
    Raises ValueError when the speed does not stay positive, and for a step that is not positive.
    """
    step, start = real_number(step, "step", positive=True), real_number(start, "start")
    n = whole_number(n, "n")

    def slowness(_: float, time: np.ndarray) -> np.ndarray:
        now = np.asarray(speed(time[0]), dtype=float)
        if not now > 0:
            raise ValueError(f"speed = {now} rad/s at {time[0]:.6g} s: the spindle must not stop")
        return np.atleast_1d(1 / now)

    angles = step * np.arange(n + 1)
    found = scipy.integrate.solve_ivp(
        slowness,
        (0.0, angles[-1]),
        [start],
        method="DOP853",
        t_eval=angles,
        rtol=1e-12,
        atol=1e-15,
        max_step=angles[-1] / 16,
    )
    if not found.success:
        raise ValueError(f"at {found.t[-1]:.6g} rad: {found.message} Does the spindle stop?")
    return np.diff(found.y[0])


def samples_per_period(speed: float, interval: float, rvf: float) -> int:
    """N, the samples in which a speed of mean `speed` (rad/s) and the profile both repeat.

    `interval` in s is the mean sampling interval; one speed period spans 1/rvf turns.
    Source: Hanson and Tsao (2000), section 5, conditions (i) and (ii).
    Raises ValueError when the samples do not divide a turn, or the turns not a speed period.
    """
    speed = real_number(speed, "speed", positive=True)
    interval = real_number(interval, "interval", positive=True)
    per_turn = 2 * np.pi / (speed * interval)
    turns = 1 / real_number(rvf, "rvf", positive=True)
    for value, what, mend in (
        (per_turn, "samples per turn", "change the speed or the interval"),
        (turns, "turns per period of the speed", "choose rvf as one over a whole number"),
    ):
        if round(value) < 1 or abs(value - round(value)) > _WHOLE * value:
            raise ValueError(f"{value:.9g} {what} is no whole number; {mend}")
    return round(per_turn) * round(turns)
