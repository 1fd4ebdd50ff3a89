"""The cut in time, with loss of contact, and a random force that disturbs it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rcbook.machines.chatter.cut import Cut, clock, modal, steps_needed
from rcbook.zdomain import real_number, whole_number


@dataclass(frozen=True, eq=False)
class Run:
    """A simulated cut at equally spaced spindle angles; arrays of shape cut.shape + (samples,)."""

    cut: Cut
    per_turn: int  # steps per turn
    angle: np.ndarray  # rad, shape (samples,)
    time: np.ndarray  # s
    displacement: np.ndarray  # m, out of the cut
    velocity: np.ndarray  # m/s
    force: np.ndarray  # N, never negative
    surface: np.ndarray  # m, what this and all earlier passes left, from the tool's nominal path

    @property
    def in_contact(self) -> np.ndarray:
        """Whether the tool cuts."""
        return self.force > 0

    def vibration(self, turns: float) -> np.ndarray:
        """Rms of the displacement about its mean over the last turns, in m, shape cut.shape.

        Raises ValueError when the run is not that long.
        """
        samples = round(real_number(turns, "turns", positive=True) * self.per_turn)
        if not 0 < samples <= self.angle.size:
            raise ValueError(f"turns = {turns!r} are not in the record; simulate longer")
        return np.std(self.displacement[..., -samples:], axis=-1)


def simulate(
    cut: Cut,
    turns: float,
    chip: float,
    kick: float = 0.0,
    disturbance: Callable[[np.ndarray], np.ndarray] | None = None,
    per_cycle: int = 40,
) -> Run:
    """Cut for some turns, from the steady cut, out of which a blow drives the tool at `kick` (m/s).

    The force is K times the thickness of the chip: `chip` (m) plus the surface that is left, minus
    the position of the tool.  In the air it is 0, and the old surface stays, farther by one `chip`
    at the next pass.  `disturbance` is a further force (N) as a function of the time (s).
    The force is a straight line in every step and the response of the mode to it is exact, so
    errors fall with the square of the step, about 3/per_cycle^2 of the force.
    Raises ValueError for turns or a chip that are not positive, fewer than 8 steps per cycle, or
    a disturbance that is not finite or not of the shape of its argument.
    """
    turns = real_number(turns, "turns", positive=True)
    chip = real_number(chip, "chip", positive=True)
    needed = steps_needed(cut, whole_number(per_cycle, "per_cycle", 8))
    per_turn = int(needed.max())
    angle = 2 * np.pi / per_turn * np.arange(int(np.ceil(turns * per_turn)) + 1)
    time, _ = clock(cut, angle)
    # samples first: every step of the march then reads one contiguous row
    rows = np.moveaxis(time.reshape(-1, angle.size), -1, 0)
    forced = np.zeros_like(rows) if disturbance is None else _samples(disturbance, rows)
    march = _march(cut, rows, forced, (chip, real_number(kick, "kick")), per_turn)
    shaped = (np.moveaxis(row, 0, -1).reshape(time.shape) for row in march)
    return Run(cut, per_turn, angle, time, *shaped)


def _samples(disturbance: Callable[[np.ndarray], np.ndarray], time: np.ndarray) -> np.ndarray:
    forced = np.asarray(disturbance(time), dtype=float)
    if forced.shape != time.shape or not np.all(np.isfinite(forced)):
        raise ValueError(
            f"disturbance has shape {forced.shape} for times of shape {time.shape}, or holds NaN "
            "or infinity; give a function of the time that answers sample by sample"
        )
    return forced


def _march(
    cut: Cut, time: np.ndarray, forced: np.ndarray, start: tuple[float, float], per_turn: int
) -> tuple[np.ndarray, ...]:
    """Displacement, velocity, cutting force and surface, each of the shape of `time`."""
    (chip, kick), stiffness = start, cut.cutting_stiffness.ravel()
    root, gain = modal(cut.mode, 0.0)
    dt = np.diff(time, axis=0)
    free, early, late = _ramp_response(root * dt)
    early, late = early * dt, late * dt
    give = 1 + stiffness * gain * late.imag  # the tool yields to the force of the same instant
    steady = stiffness * chip / cut.mode.stiffness
    x, v, force = np.zeros((3, *time.shape))
    left = np.zeros((per_turn + len(time), time.shape[1]))  # from one turn before the start
    left[: per_turn + 1], x[0], v[0], force[0] = steady, steady, kick, stiffness * chip
    y = (kick - x[0] * root.real) / (gain * root.imag) + 1j * x[0] / gain
    for j in range(len(dt)):
        y = free[j] * y + early[j] * (force[j] + forced[j]) + late[j] * forced[j + 1]
        ahead = left[j + 1] + chip
        force[j + 1] = np.maximum(0, stiffness * (ahead - gain * y.imag) / give[j])
        y += late[j] * force[j + 1]
        x[j + 1], v[j + 1] = gain * y.imag, gain * (root * y).imag
        left[per_turn + j + 1] = np.minimum(ahead, x[j + 1])
    return x, v, force, left[per_turn:]


def _ramp_response(z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """e^z, and the integrals over w from 0 to 1 of e^(z (1 - w)) times 1 - w and times w."""
    free = np.exp(z)
    constant = (free - 1) / z
    late = (constant - 1) / z
    return free, constant - late, late


def noise(
    rms: float, lowest: float, highest: float, rng: np.random.Generator, lines: int = 300
) -> Callable[[np.ndarray], np.ndarray]:
    """A random force (N) as a function of time: lines of equal size between two frequencies in Hz.

    It is the same force whatever the step.  Raises ValueError for a band that is not one.
    """
    lowest, highest = real_number(lowest, "lowest", True), real_number(highest, "highest", True)
    if lowest >= highest:
        raise ValueError(f"lowest = {lowest!r} must lie below highest = {highest!r}")
    lines = whole_number(lines, "lines")
    frequency = 2 * np.pi * rng.uniform(lowest, highest, lines)
    phase = rng.uniform(0, 2 * np.pi, lines)
    size = real_number(rms, "rms", positive=True) * np.sqrt(2 / lines)

    def force(time: np.ndarray) -> np.ndarray:
        total = np.zeros(np.shape(time))
        for f, p in zip(frequency, phase, strict=True):
            total += np.sin(f * time + p)
        return size * total

    return force
