"""The mill itself: cutter, cut and drive, nominal values and runout."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rcbook.machines import spindle_drive
from rcbook.machines.spindle_drive import SpindleDrive
from rcbook.signals import signal
from rcbook.zdomain import real_number, whole_number

RPM = 2 * np.pi / 60  # rad/s


@dataclass(frozen=True)
class FaceMill:
    """A cutter, a cut and the drive that turns it.

    `runout` holds, tooth by tooth, the radius of a tooth minus that of the tooth before it.
    Raises ValueError for a wrong number of runouts, a sum of them that is not zero to 1e-9 m, entry
    and exit angles outside 0 <= entry < exit <= pi, and sizes that are not positive.
    """

    drive: SpindleDrive
    teeth: int
    diameter: float  # m
    speed: float  # nominal, rad/s
    depth: float  # m
    feed_per_turn: float  # m
    cutting_coefficient: float  # N/m2
    runout: tuple[float, ...]  # m
    entry: float = 0.0  # rad
    exit: float = np.pi  # rad
    samples_per_pitch: int = 5

    def __post_init__(self) -> None:
        for name in ("diameter", "speed", "depth", "feed_per_turn", "cutting_coefficient"):
            value = real_number(getattr(self, name), name, positive=True)
            object.__setattr__(self, name, value)
        for name in ("teeth", "samples_per_pitch"):
            object.__setattr__(self, name, whole_number(getattr(self, name), name))
        runout = signal(self.runout, "runout", self.teeth)
        if abs(runout.sum()) > 1e-9:
            raise ValueError(
                f"runout sums to {runout.sum():.3g} m over the turn; make it differences of radii, "
                "which sum to zero"
            )
        object.__setattr__(self, "runout", tuple(map(float, runout)))
        if not 0 <= real_number(self.entry, "entry") < real_number(self.exit, "exit") <= np.pi:
            raise ValueError(
                f"entry {self.entry!r}, exit {self.exit!r}: a tooth cuts from one to the other "
                "within 0 to pi rad"
            )

    @property
    def pitch(self) -> float:
        """Angle between teeth in rad."""
        return 2 * np.pi / self.teeth

    @property
    def samples_per_turn(self) -> int:
        """N, samples per turn of the cutter."""
        return self.teeth * self.samples_per_pitch

    @property
    def feed_speed(self) -> float:
        """Speed of the feed in m/s, which stays constant."""
        return self.feed_per_turn * self.speed / (2 * np.pi)

    @property
    def tooth_feed(self) -> float:
        """Nominal feed per tooth in m."""
        return self.feed_per_turn / self.teeth

    @property
    def nominal_force(self) -> float:
        """Tangential force in N of a tooth at 90 degrees, at nominal speed without runout."""
        return self.cutting_coefficient * self.depth * self.tooth_feed

    @property
    def nominal_torque(self) -> float:
        """Cutting torque in N m of infinitely many teeth at nominal speed (eq. 13)."""
        arc = np.cos(self.entry) - np.cos(self.exit)
        area = self.depth * self.feed_per_turn / (2 * np.pi)
        return self.diameter / 2 * self.cutting_coefficient * area * arc

    @property
    def torque_slope(self) -> float:
        """G_d, slope of the torque of infinitely many teeth over the speed, N m s/rad (eq. 14)."""
        return -self.nominal_torque / self.speed

    @property
    def force_slope(self) -> float:
        """Slope of the peak force over the speed per angle of pitch, N s/rad2 (eq. 17)."""
        return -self.cutting_coefficient * self.depth * self.feed_speed / self.speed**2


TSAO_PONG1991 = FaceMill(  # default conditions
    drive=spindle_drive.TSAO_PONG1991,
    teeth=8,
    diameter=0.10,
    speed=200 * RPM,
    depth=1.23e-3,
    feed_per_turn=0.48e-3,
    cutting_coefficient=7.6332e8,
    runout=(
        14.142e-6,
        5.8579e-6,
        -5.8579e-6,
        -14.142e-6,
        -14.142e-6,
        -5.8579e-6,
        5.8579e-6,
        14.142e-6,
    ),
)
# Of case 4, in m.
TSAO_PONG1991_RANDOM_RUNOUT = (0.0, 0.0, 0.0, 14.3e-6, 3.7e-6, 20e-6, -9.25e-6, -28.75e-6)


def eccentric_runout(teeth: int, eccentricity: float, phase: float = 0.0) -> tuple[float, ...]:
    """Runout of a cutter whose teeth lie on a circle off the spindle axis, each value in m.

    Tooth i (from 1) has the radius R + eccentricity cos((i - 1) pitch - phase).
    """
    angle = 2 * np.pi * np.arange(whole_number(teeth, "teeth", 2)) / teeth
    radius = real_number(eccentricity, "eccentricity") * np.cos(angle - real_number(phase, "phase"))
    return tuple(map(float, radius - np.roll(radius, 1)))


def sampling_angle(mill: FaceMill) -> float:
    """Turn of the cutter in rad from one sample to the next."""
    return mill.pitch / mill.samples_per_pitch
