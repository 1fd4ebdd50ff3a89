"""The cut in time, with loss of contact, and a random force that disturbs it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

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

    def until(self, turns: float) -> Run:
        """The first turns of this run; as long as itself if it ends before."""
        end = round(real_number(turns, "turns", positive=True) * self.per_turn) + 1
        names = ("angle", "time", "displacement", "velocity", "force", "surface")
        return replace(self, **{name: getattr(self, name)[..., :end] for name in names})


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
    clocks, which = _clocks(cut)
    # samples first: every step of the march then reads one contiguous row
    time = np.ascontiguousarray(clock(clocks, angle)[0].T)
    forced = np.zeros_like(time) if disturbance is None else _samples(disturbance, time)
    rows = time[:, which], forced[:, which]
    march = _march(cut, *rows, (chip, real_number(kick, "kick")), per_turn)
    shape = (*cut.shape, angle.size)
    time, *march = (row.T.reshape(shape) for row in (rows[0], *march))
    return Run(cut, per_turn, angle, time, *march)


def _clocks(cut: Cut) -> tuple[Cut, np.ndarray]:
    """Cuts of every clock that there is, and which of them each cut has."""
    numbers = np.stack([cut.speed.ravel(), cut.rva.ravel(), cut.rvf.ravel()])
    _, first, which = np.unique(numbers, axis=1, return_index=True, return_inverse=True)
    return cut.take(first), which.ravel()


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
    # the tool yields to the force of the same instant
    grip = stiffness / (1 + stiffness * gain * late.imag)
    pushed = early * forced[:-1] + late * forced[1:]
    steady = stiffness * chip / cut.mode.stiffness
    y, force = np.empty(time.shape, dtype=complex), np.empty(time.shape)
    left = np.empty((per_turn + len(time), time.shape[1]))  # from one turn before the start
    left[: per_turn + 1], force[0] = steady, stiffness * chip
    y[0] = (kick - steady * root.real) / (gain * root.imag) + 1j * steady / gain
    for j in range(len(dt)):
        ahead = left[j + 1] + chip
        free_of_it = free[j] * y[j] + early[j] * force[j] + pushed[j]
        force[j + 1] = np.maximum(0, grip[j] * (ahead - gain * free_of_it.imag))
        y[j + 1] = free_of_it + late[j] * force[j + 1]
        left[per_turn + j + 1] = np.minimum(ahead, gain * y[j + 1].imag)
    x, v = gain * y.imag, gain * (root * y).imag
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
