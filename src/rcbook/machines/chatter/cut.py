"""A mode in a cut, and the clock of its spindle.

m x'' + c x' + k x = K (h0 + x(one turn ago) - x),   x positive out of the cut
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike

from rcbook.zdomain import real_number

RPM = 2 * np.pi / 60  # rad/s
_NUMBERS = ("cutting_stiffness", "speed", "rva", "rvf")


@dataclass(frozen=True)
class Mode:
    """A vibration mode that rings: mass (kg), damping (N s/m) and stiffness (N/m).

    Raises ValueError when one is not positive or the mode is overdamped.
    """

    mass: float  # kg
    damping: float  # N s/m
    stiffness: float  # N/m

    def __post_init__(self) -> None:
        for field in fields(self):
            value = real_number(getattr(self, field.name), field.name, positive=True)
            object.__setattr__(self, field.name, value)
        if self.damping_ratio >= 1:
            raise ValueError(
                f"damping = {self.damping!r} makes a damping ratio of {self.damping_ratio:.4g}; "
                "choose less than 1, a mode that rings"
            )

    @property
    def natural_frequency(self) -> float:
        """Undamped natural frequency in rad/s."""
        return float(np.sqrt(self.stiffness / self.mass))

    @property
    def damping_ratio(self) -> float:
        """Damping over critical damping."""
        return float(self.damping / (2 * np.sqrt(self.mass * self.stiffness)))


@dataclass(frozen=True, eq=False)
class Cut:
    """A mode in a cut; every number but the mode may be an array, and they broadcast.

    The spindle speed is w0 [1 + rva sin(rvf w0 t)] for the law "time" (Hanson and Tsao, eq. 15),
    or w0 [1 + rva sin(rvf theta)] for the law "angle"; under both it repeats every 1/rvf turns.
    A negative rva shifts the variation by half of its period.
    Raises ValueError for numbers out of range, shapes that do not broadcast, an unknown law.
    """

    mode: Mode
    cutting_stiffness: ArrayLike  # K, N/m: cutting coefficient times width of cut
    speed: ArrayLike  # w0, rad/s
    rva: ArrayLike = 0.0  # amplitude of the speed over w0
    rvf: ArrayLike = 1.0  # frequency of the variation over that of the spindle
    law: str = "time"

    def __post_init__(self) -> None:
        numbers = [
            between(self.cutting_stiffness, "cutting_stiffness", 0.0, np.inf),
            between(self.speed, "speed", 0.0, np.inf),
            between(self.rva, "rva", -1.0, 1.0),
            between(self.rvf, "rvf", 0.0, np.inf),
        ]
        if self.law not in _LAWS:
            raise ValueError(f"law {self.law!r} is none of {', '.join(_LAWS)}")
        shapes = [number.shape for number in numbers]
        try:
            numbers = np.broadcast_arrays(*numbers)
        except ValueError:
            raise ValueError(
                f"shapes {shapes} of cutting_stiffness, speed, rva and rvf do not broadcast; "
                "make them agree"
            ) from None
        for name, number in zip(_NUMBERS, numbers, strict=True):
            object.__setattr__(self, name, number)

    @property
    def shape(self) -> tuple[int, ...]:
        """Common shape of the numbers; () for a single cut."""
        return self.speed.shape

    @property
    def mean_speed(self) -> np.ndarray:
        """Mean speed over time in rad/s: w0 for the law "time", less for the law "angle"."""
        return 2 * np.pi / self.rvf / _LAWS[self.law](self, 2 * np.pi / self.rvf)[0]

    def take(self, which: ArrayLike) -> Cut:
        """The cuts at these places of the flattened arrays, as one row."""
        return replace(self, **{name: getattr(self, name).ravel()[which] for name in _NUMBERS})


def between(value: ArrayLike, name: str, above: float, below: float) -> np.ndarray:
    """Real numbers as a read-only array.  Raises ValueError outside of an open interval."""
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or array.size == 0:
        raise ValueError(f"{name} = {value!r} must hold real numbers")
    array = array.astype(float)
    wrong = ~((array > above) & (array < below))
    if wrong.any():
        raise ValueError(f"{name} = {array[wrong][0]} must lie between {above:g} and {below:g}")
    array.setflags(write=False)
    return array


def clock(cut: Cut, angle: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Time (s) and spindle speed (rad/s) at spindle angles (rad), shape cut.shape + angle.shape.

    At angle 0 the time is 0 and the speed is w0, rising for a positive rva.
    """
    angle = np.asarray(angle, dtype=float)
    if not np.all(np.isfinite(angle)):
        raise ValueError(f"angle = {angle} holds NaN or infinity; give finite angles")
    wide = (Ellipsis,) + (None,) * angle.ndim
    numbers = {name: getattr(cut, name)[wide] for name in _NUMBERS}
    return _LAWS[cut.law](replace(cut, **numbers), angle)


def _clock_of_time_law(cut: Cut, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # rvf theta = phi + rva (1 - cos phi) with phi = rvf w0 t is Kepler's equation E - e sin E = M
    # for E = phi + pi/2; from this start Newton's method converges for every e below 1.
    e, mean = cut.rva, cut.rvf * angle - cut.rva + np.pi / 2
    anomaly = mean + 0.85 * e * np.sign(np.sin(mean))
    for _ in range(30):
        step = (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
        anomaly -= step
        if np.max(np.abs(step), initial=0) < 1e-9:  # the next one would be the square of this
            break
    phase = anomaly - np.pi / 2
    return phase / (cut.rvf * cut.speed), cut.speed * (1 + e * np.sin(phase))


def _clock_of_angle_law(cut: Cut, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # The integral of 1/(1 + rva sin psi) in the form that is continuous over many periods.
    phase, root = cut.rvf * angle, np.sqrt(1 - cut.rva**2)
    q = cut.rva / (1 + root)
    swing = np.arctan2(-q * np.cos(phase), 1 + q * np.sin(phase))
    integral = (phase - 2 * swing - 2 * np.arctan(q)) / root
    return integral / (cut.rvf * cut.speed), cut.speed * (1 + cut.rva * np.sin(phase))


_LAWS = {"time": _clock_of_time_law, "angle": _clock_of_angle_law}


def modal(mode: Mode, contact: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Root s in the upper half plane of m s^2 + c s + k + contact, and 1/(m Im s)."""
    decay = mode.damping / (2 * mode.mass)
    ringing = np.sqrt((mode.stiffness + np.asarray(contact)) / mode.mass - decay**2)
    return -decay + 1j * ringing, 1 / (mode.mass * ringing)


def steps_needed(cut: Cut, per_cycle: int) -> np.ndarray:
    """Steps per turn that make `per_cycle` steps of a cycle in contact at the lowest speed."""
    frequency = np.sqrt((cut.mode.stiffness + cut.cutting_stiffness) / cut.mode.mass)
    cycles = frequency / (cut.speed * (1 - np.abs(cut.rva)))
    return np.ceil(per_cycle * np.maximum(cycles, np.maximum(2, 2 * cut.rvf)))


HANSON_TSAO2000 = Cut(
    mode=Mode(mass=0.365, damping=208.0, stiffness=12.8e6),  # eq. 17
    cutting_stiffness=1.5e6,  # ours: the paper has none, only that constant speed just chatters
    speed=1000 * RPM,
    rva=0.2,
    rvf=0.2,
)
HANSON_TSAO2000_FEED = (
    0.1e-3  # m per turn: the chip thickness, if the tool is pushed along the feed
)
