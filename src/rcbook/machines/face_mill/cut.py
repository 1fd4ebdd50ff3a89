"""The teeth in the cut: chips, forces and torque of several experiments side by side."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rcbook.machines.face_mill.experiment import Experiment


class Cut(NamedTuple):
    """What the teeth do, by half steps of the angle; per-run values on the last axis."""

    sines: np.ndarray  # (half steps per turn, teeth, 1)
    inside: np.ndarray  # (half steps per turn, teeth, 1), between entry and exit
    entered: np.ndarray  # (half steps per turn, teeth, 1), half steps since the last entry
    first: np.ndarray  # half step from which a tooth has to have entered, or the cutter to cut
    one_by_one: np.ndarray
    runout: np.ndarray  # (teeth, runs), m
    feed_speed: np.ndarray  # m/s
    pitch: float  # rad
    stiffness: np.ndarray  # N/m, force per chip thickness
    radius: np.ndarray  # m
    instantaneous: np.ndarray
    negative: np.ndarray

    def loads(self, half: int, elapsed: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, ...]:
        """Largest tooth force, torque, and teeth without a chip at a half step of the angle.

        At the end of a step the teeth are those that cut in its middle, so that a tooth which just
        leaves or enters belongs to one step only.
        """
        cutting, chips = self.chips(half, elapsed)
        force = self.on_teeth(cutting, chips)
        total = force.sum(axis=0)
        if self.instantaneous.any():
            now = self.on_teeth(*self.chips(half, self.pitch / speed))
            total = np.where(self.instantaneous, now.sum(axis=0), total)
        return force.max(axis=0), self.radius * total, np.sum(cutting & (chips <= 0), axis=0)

    def chips(self, half: int, elapsed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which teeth cut, and the chip thickness in m, after `elapsed` s for the last pitch."""
        at, held = half % len(self.sines), (half - 1 + half % 2) % len(self.sines)
        since = half - 1 + half % 2 - self.one_by_one * self.entered[held]
        cutting = self.inside[held] & (since > self.first - 0.5)
        return cutting, self.sines[at] * (self.feed_speed * elapsed) + self.runout

    def on_teeth(self, cutting: np.ndarray, chips: np.ndarray) -> np.ndarray:
        """Tangential force in N on every tooth."""
        return np.where(cutting & ((chips > 0) | self.negative), self.stiffness * chips, 0.0)


def cut_of(group: list[Experiment]) -> Cut:
    mill, halves = group[0].mill, 2 * group[0].steps_per_turn
    position = np.arange(halves)[:, None] - halves // mill.teeth * np.arange(mill.teeth)
    position = (position % halves)[:, :, None]
    angle = 2 * np.pi * position / halves
    entry, leave = (np.array([getattr(e.mill, name) for e in group]) for name in ("entry", "exit"))

    def each(take: Callable[[Experiment], float]) -> np.ndarray:
        return np.array([take(e) for e in group])

    return Cut(
        sines=np.sin(angle),
        inside=(angle > entry) & (angle < leave),
        entered=position - entry * halves / (2 * np.pi),
        first=each(lambda e: (e.engaged - 1) * halves),
        one_by_one=each(lambda e: e.entry == "one by one"),
        runout=each(lambda e: e.mill.runout).T,
        feed_speed=each(lambda e: e.mill.feed_speed),
        pitch=mill.pitch,
        stiffness=each(lambda e: e.mill.cutting_coefficient * e.mill.depth),
        radius=each(lambda e: e.mill.diameter / 2),
        instantaneous=each(lambda e: e.torque == "instantaneous"),
        negative=each(lambda e: e.keep_negative),
    )
