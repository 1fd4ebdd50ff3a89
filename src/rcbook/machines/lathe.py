"""Noncircular turning: the radial servo of a lathe, and sections as functions of spindle angle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from rcbook.signals import signal
from rcbook.zdomain import Plant, multiply, real_number, whole_number


@dataclass(frozen=True)
class Servo:
    """Servo gain z^-1 prod(1 + q z^-1)/prod(1 + p z^-1), command to position in mm/mm.

    Zeros and poles are given by their coefficients q and p, minus the roots; complex ones come in
    conjugate pairs.  Source: Lee, Oh and Kim, eqs 9-10, with gain and delay written out.
    """

    gain: float
    zeros: tuple[complex, ...]
    poles: tuple[complex, ...]
    dt: float  # s

    @property
    def plant(self) -> Plant:
        """The servo as a sampled plant.  Raises ValueError when a conjugate is missing."""
        b, a = _product(self.zeros), _product(self.poles)
        return Plant(real_number(self.gain, "gain") * b, a, 1, self.dt)

    @property
    def steady_gain(self) -> float:
        """Position per command when nothing moves, G(1)."""
        return float(self.plant.b.sum() / self.plant.a.sum())

    def misjudged(self, zeros: ArrayLike = 1.0, poles: ArrayLike = 1.0) -> Servo:
        """The servo as an identification sees it that is off by these factors; the gain stays.

        One factor for all zeros and one for all poles, or one for each coefficient.
        """
        off = {"zeros": _scaled(self.zeros, zeros, "zeros")}
        return replace(self, **off, poles=_scaled(self.poles, poles, "poles"))


def _scaled(coefficients: tuple[complex, ...], factors: ArrayLike, name: str) -> tuple:
    factors = [real_number(f, name) for f in np.atleast_1d(factors).tolist()]
    if len(factors) == 1:
        factors *= len(coefficients)
    if len(factors) != len(coefficients):
        raise ValueError(f"{name} has {len(factors)} factors; give one, or {len(coefficients)}")
    return tuple(f * c for f, c in zip(factors, coefficients, strict=True))


def _product(coefficients: tuple[complex, ...]) -> np.ndarray:
    product = multiply(*(np.array([1.0, c]) for c in coefficients))
    if np.abs(np.imag(product)).max() > 1e-12 * np.abs(product).max():
        raise ValueError(f"{coefficients} holds a complex coefficient without its conjugate")
    return np.real(product)


LEE_OH_KIM = Servo(0.14, (0.77, 2.43), (0.14, -0.15 + 0.15j, -0.15 - 0.15j), 0.01)  # eq. 13
LEE_OH_KIM_NC = Servo(0.046, (3.0,), (-0.6 + 0.15j, -0.6 - 0.15j), 0.01)  # eq. 21
LEE_OH_KIM_MISJUDGED = (1.25, 0.75)  # estimate over truth in figs 12 and 13


def samples_per_turn(speed: float, dt: float) -> float:
    """Samples per spindle turn at a speed in rpm, whole or not (Lee, Oh and Kim, eq. 1)."""
    speed, dt = real_number(speed, "speed", positive=True), real_number(dt, "dt", positive=True)
    return 60 / (speed * dt)


def spindle_angle(n: int, per_turn: float, start: float = 0.0) -> np.ndarray:
    """Spindle angle in rad at n samples, `per_turn` of them to a turn, from the angle `start`."""
    per_turn = real_number(per_turn, "per_turn", positive=True)
    start = real_number(start, "start")
    return start + 2 * np.pi * np.arange(whole_number(n, "n")) / per_turn


def polygon_section(angle: ArrayLike, sides: int, inradius: float) -> np.ndarray:
    """Radius of a regular polygon at a spindle angle, with the middle of a side at angle 0.

    Corners lie at odd multiples of pi/sides; a square of side 2a has the inradius a.
    """
    half = np.pi / whole_number(sides, "sides", 3)
    folded = np.mod(_finite(angle) + half, 2 * half) - half
    return real_number(inradius, "inradius", positive=True) / np.cos(folded)


def ellipse_section(angle: ArrayLike, a: float, b: float) -> np.ndarray:
    """Radius of an ellipse about its centre, half axes a (at angle 0) and b."""
    a, b = real_number(a, "a", positive=True), real_number(b, "b", positive=True)
    angle = _finite(angle)
    return a * b / np.hypot(b * np.cos(angle), a * np.sin(angle))


def _finite(angle: ArrayLike) -> np.ndarray:
    angle = np.asarray(angle, dtype=float)
    if not np.all(np.isfinite(angle)):
        raise ValueError(f"angle = {angle} holds NaN or infinity; give finite angles")
    return angle


def error_between(
    samples: ArrayLike, shape: Callable[[np.ndarray], np.ndarray], points: int = 50
) -> float:
    """Largest error of a tool that moves straight from sample to sample of a repeating pass.

    `shape` gives the wanted position at any number of samples from the first one; it is looked at
    in `points` points an interval.
    """
    samples, points = signal(samples, "samples"), whole_number(points, "points")
    at = np.arange(samples.size * points) / points
    straight = np.interp(at, np.arange(samples.size + 1), np.append(samples, samples[0]))
    return float(np.abs(straight - shape(at)).max())


def rate_limited(
    command: ArrayLike, dt: float, speed: float, acceleration: float = np.inf, passes: int = 8
) -> np.ndarray:
    """The last of `passes` passes of a repeating command, followed from 0 under limits.

    `speed` and `acceleration` are the largest ones, in units of the command per s and per s^2.
    The follower aims at the present command and does not brake ahead of it.
    """
    command, dt = signal(command, "command"), real_number(dt, "dt", positive=True)
    for name, limit in (("speed", speed), ("acceleration", acceleration)):
        if not limit > 0:
            raise ValueError(f"{name} = {limit!r} must be positive")
    most, jump = speed * dt, acceleration * dt**2
    wanted = np.tile(command, whole_number(passes, "passes"))
    out, moves = np.zeros(wanted.size), 0.0
    for k in range(wanted.size - 1):
        step = np.clip(wanted[k + 1] - out[k], -most, most)
        moves = np.clip(step, moves - jump, moves + jump)
        out[k + 1] = out[k] + moves
    return out[-command.size :]
