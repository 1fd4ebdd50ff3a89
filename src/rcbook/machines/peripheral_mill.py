"""Peripheral milling: feed command to cutting force, with runout at the plant input.

Force stays in lb and command in mV, the units of the thesis, because its polynomials carry them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcbook import signals
from rcbook.zdomain import Plant, add, multiply, real_number

INCH = 25.4e-3  # m
FAST_MODES = ("keep sign", "positive", "damped cosine")


@dataclass(frozen=True, eq=False)
class PeripheralMill:
    """One milling set-up: sampled plant from feed command (mV) to force (lb), and the machine."""

    plant: Plant  # lb/mV
    spindle_frequency: float  # Hz
    flutes: int
    cutter_diameter: float  # m
    feed_speed: float  # m/s
    depth_of_cut: float  # m
    filter_corner: float  # Hz, first-order low-pass on the measured force
    runout_amplitude: float  # mV
    runout_phase: float  # rad

    @property
    def samples_per_turn(self) -> int:
        """N, samples per spindle revolution.  Raises ValueError when it is no whole number."""
        samples = 1 / (self.spindle_frequency * self.plant.dt)
        if abs(samples - round(samples)) > 1e-9 * samples:
            raise ValueError(
                f"{samples:.6g} samples per turn is no whole number; change the spindle speed or dt"
            )
        return round(samples)

    def runout(self, n: int, amplitude: float | None = None) -> np.ndarray:
        """n samples, in mV, of the sinusoidal runout that one eccentric turn adds to the command.

        Source: Horng (1989), before eq. 13, with the frequency in rad/s.
        """
        amplitude = self.runout_amplitude if amplitude is None else amplitude
        return signals.sinusoid(
            amplitude, self.spindle_frequency, self.plant.dt, n, self.runout_phase
        )


HORNG1989 = PeripheralMill(
    plant=Plant(b=[9.0452, -7.8975], a=[1, -0.7537, -0.2404], delay=1, dt=1 / 60),  # eq. 7
    spindle_frequency=10.0,
    flutes=4,
    cutter_diameter=0.375 * INCH,
    feed_speed=4.5 * INCH / 60,
    depth_of_cut=0.03 * INCH,
    filter_corner=30.0,
    runout_amplitude=0.30,
    runout_phase=2 * np.pi / 3,
)


def resample(plant: Plant, dt: float, fast_mode: str = "keep sign", sine: float = 0.0) -> Plant:
    """The plant at another sampling interval, mode by mode through its step response.

    A negative pole p has no real continuous counterpart; over a new interval of tau old ones it
    becomes -|p|^tau ("keep sign"), |p|^tau ("positive"), or the pair |p|^tau e^(+-j pi tau) of
    a mode that alternates at the old rate, |p|^tau (cos pi tau + sine sin pi tau) ("damped
    cosine"): a continuous-time machine for every `sine`, which the old samples do not show.  Each
    keeps the gain of its mode;
    all but "positive" are exact for tau = 1.
    Raises ValueError for a delay other than 1, a numerator as long as the denominator, poles that
    are repeated, complex or 1, or an unknown mode.
    """
    poles, tau = plant.poles, real_number(dt, "dt", positive=True) / plant.dt
    if plant.delay != 1:
        raise ValueError(f"delay {plant.delay}: only a plant of one delay step is resampled")
    if plant.b.size > poles.size:
        raise ValueError(f"numerator {plant.b} is too long for {poles.size} poles to be its modes")
    if np.iscomplexobj(poles) or np.unique(poles).size < poles.size or {0, 1} & {*poles}:
        raise ValueError(
            f"poles {poles}: only distinct real poles other than 1 are resampled mode by mode"
        )
    if fast_mode not in FAST_MODES:
        raise ValueError(f"fast_mode {fast_mode!r} is none of {', '.join(FAST_MODES)}")
    gains = [_mode_gain(plant, pole, poles) for pole in poles]
    modes = [
        _mode(pole, tau, fast_mode, sine, gain) for pole, gain in zip(poles, gains, strict=True)
    ]
    denominator = multiply(*(den for _, den in modes))
    numerator = add(
        *(
            multiply(num, *(den for other, (_, den) in enumerate(modes) if other != i))
            for i, (num, _) in enumerate(modes)
        )
    )
    return Plant(numerator[1:], denominator, 1, dt)


def _mode_gain(plant: Plant, pole: float, poles: np.ndarray) -> float:
    """Steady gain of the mode of `pole` in the partial fractions of the plant."""
    others = np.prod([1 - p / pole for p in poles if p != pole])
    residue = np.polynomial.polynomial.polyval(1 / pole, plant.b) / others
    return float(residue / (1 - pole))


def _mode(
    pole: float, tau: float, fast_mode: str, sine: float, gain: float
) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator of one mode with the step response gain (1 - its decay)."""
    size = abs(pole) ** tau
    if pole > 0 or fast_mode == "positive":
        decay, den = np.array([1.0]), np.array([1.0, -size])
    elif fast_mode == "keep sign":
        decay, den = np.array([1.0]), np.array([1.0, size])
    else:
        c = size * np.cos(np.pi * tau)
        s = size * np.sin(np.pi * tau)
        decay, den = np.array([1.0, sine * s - c]), np.array([1.0, -2 * c, size**2])
        if abs(s) < 1e-12:
            decay, den = np.array([1.0]), np.array([1.0, -c])
    difference = np.array([1.0, -1.0])
    numerator = add(den, -multiply(difference, decay))
    return gain * np.where(np.arange(numerator.size) == 0, 0.0, numerator), den
