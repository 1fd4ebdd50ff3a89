"""The teeth in the cut: chips, forces and torque of one experiment, or of several side by side."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rcbook.machines.face_mill.abreast import Arithmetic
from rcbook.machines.face_mill.experiment import Experiment

Met = tuple  # a tooth in a step, or all: sines (start, middle, end), runout, and who cuts


class Cut(NamedTuple):
    """What the teeth do."""

    op: Arithmetic
    sines: list  # [step of the turn][tooth or all] at its start, in its middle and at its end
    begins: list  # [step of the turn][tooth or all] half step from which a tooth cuts, if ever
    runout: list  # [tooth or all], m
    feed_speed: float  # m/s
    pitch: float  # rad
    stiffness: float  # N/m, force per chip thickness
    radius: float  # m
    instantaneous: bool
    negative: bool

    def meeting(self, step: int) -> list[Met]:
        """The teeth that cut in the middle of a step, and so from its start to its end."""
        place, now = step % len(self.sines), 2 * step + 1
        teeth = zip(self.sines[place], self.runout, self.begins[place], strict=True)
        cutting = [(*sines, runout, begin < now) for sines, runout, begin in teeth]
        return [met for met in cutting if self.op.some(met[4])]

    def torque(self, teeth: list[Met], fed: tuple, skew: float) -> tuple[float, float, float]:
        """The torque within a step, a parabola: at its start, and its two derivatives in steps.

        `fed` is the feed per pitch at the start, in the middle and at the end of the step in m;
        half the angle takes `skew` more than half of the time.
        """
        level = slope = curve = 0 * skew
        for start, middle, end, runout, on in teeth:
            first, last = fed[0] * start + runout, fed[2] * end + runout
            mean = fed[1] * middle + runout - skew * (last - first)
            chip = mean, (last - first) / 2, (first + last) / 2 - mean
            met = on & (self.negative | (mean > 0))
            bent = on & (first * last < 0) & (self.negative ^ True)
            if self.op.some(bent):
                pairs = zip(_positive_part(self.op, *chip), chip, strict=True)
                met, chip = met | bent, [self.op.choose(bent, part, all_) for part, all_ in pairs]
            level = level + self.op.total(met * chip[0])
            slope = slope + self.op.total(met * chip[1])
            curve = curve + self.op.total(met * chip[2])
        force = self.radius * self.stiffness
        start = level - slope + curve
        return force * start, force * (2 * slope - 4 * curve), force * 8 * curve

    def at_end(self, teeth: list[Met], elapsed: float, speed: float) -> tuple[float, float, float]:
        """Largest tooth force, torque, and teeth without a chip at the end of a step."""
        op, fed = self.op, self.feed_speed * elapsed
        largest = total = without = 0 * fed
        now = op.choose(self.instantaneous, self.feed_speed * self.pitch / speed, fed)
        for _, _, end, runout, on in teeth:
            chip, other = fed * end + runout, now * end + runout
            force = op.largest(on * op.choose(self.negative | (chip > 0), chip, 0.0))
            largest = op.choose(force > largest, force, largest)
            total = total + op.total(on * op.choose(self.negative | (other > 0), other, 0.0))
            without = without + op.total(on & (chip <= 0))
        return self.stiffness * largest, self.radius * self.stiffness * total, without


def _positive_part(op: Arithmetic, a: float, b: float, c: float) -> tuple[float, float, float]:
    """The parabola whose integral, and whose first two moments, are those of max(0, a + bx + cx^2).

    On -1 to 1, where the one it is given changes its sign once.
    """
    root = (a + c) / -b
    for _ in range(2):
        root = root - (a + root * (b + root * c)) / b
    low, high = op.choose(b > 0, root, -1.0), op.choose(b > 0, 1.0, root)

    def integrals(x: float) -> tuple[float, float, float]:
        square = x * x
        return (
            x * (a + x * (b / 2 + x * c / 3)),
            square * (a / 2 + x * (b / 3 + x * c / 4)),
            square * x * (a / 3 + x * (b / 4 + x * c / 5)),
        )

    zeroth, first, second = (
        (above - below) / 2 for above, below in zip(integrals(high), integrals(low), strict=True)
    )
    bow = (3 * second - zeroth) / 2
    return zeroth - 2.5 * bow, 3 * first, 7.5 * bow


def cut_of(group: list[Experiment], op: Arithmetic) -> Cut:
    sines, begins = passing(group)

    def each(take: Callable[[Experiment], float]) -> float:
        return op.each(np.array([take(e) for e in group]))

    return Cut(
        op,
        sines=[op.teeth(step[..., None]) for step in sines],
        begins=[op.teeth(step) for step in begins],
        runout=op.teeth(np.array([e.mill.runout for e in group]).T),
        feed_speed=each(lambda e: e.mill.feed_speed),
        pitch=group[0].mill.pitch,
        stiffness=each(lambda e: e.mill.cutting_coefficient * e.mill.depth),
        radius=each(lambda e: e.mill.diameter / 2),
        instantaneous=each(lambda e: e.torque == "instantaneous"),
        negative=each(lambda e: e.keep_negative),
    )


def passing(group: list[Experiment]) -> tuple[np.ndarray, np.ndarray]:
    """By steps of a turn: sines (steps, teeth, 3), and the half steps from which teeth cut there.

    The latter are (steps, teeth, runs), infinite where the middle of the step is out of the cut.
    """
    mill, halves = group[0].mill, 2 * group[0].steps_per_turn
    place = np.arange(halves + 1)[:, None] - halves // mill.teeth * np.arange(mill.teeth)
    place = place % halves
    sine = np.sin(2 * np.pi * place / halves)
    middle = place[1::2, :, None]
    angle = 2 * np.pi * middle / halves
    entry, leave, one_by_one, engaged = np.array(
        [(e.mill.entry, e.mill.exit, e.entry == "one by one", e.engaged) for e in group]
    ).T
    entered = middle - entry * halves / (2 * np.pi)  # half steps ago
    begins = (engaged - 1) * halves - 0.5 + one_by_one * entered
    begins = np.where((angle > entry) & (angle < leave), begins, np.inf)
    return np.stack([sine[:-1:2], sine[1::2], sine[2::2]], axis=-1), begins


def tooth_chips(one: Experiment, elapsed: np.ndarray) -> np.ndarray:
    """Chips in m that push, at the ends of steps, of every tooth, 0 for one that does not cut."""
    sines, begins = passing([one])
    steps = np.arange(-1, elapsed.size - 1)
    place = steps % len(sines)
    chips = one.mill.feed_speed * elapsed[:, None] * sines[place, :, 2] + one.mill.runout
    cutting = (begins[place, :, 0] < 2 * steps[:, None] + 1) & ((chips > 0) | one.keep_negative)
    return np.where(cutting, chips, 0.0)
