"""The nonlinear mill turned step by step through its experiments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rcbook.machines import spindle_drive
from rcbook.machines.face_mill.cut import cut_of
from rcbook.machines.face_mill.drive import modes_of, turn
from rcbook.machines.face_mill.experiment import Experiment
from rcbook.machines.face_mill.law import law_of
from rcbook.machines.face_mill.mill import sampling_angle
from rcbook.machines.face_mill.readings import LOGGED
from rcbook.zdomain import whole_number

ABREAST = 256  # runs computed side by side, few enough for the processor's cache
STANDSTILL = 0.01  # of the nominal speed


@dataclass(frozen=True, eq=False)
class Run:
    """What one experiment did: n + 1 values, at the start and at the end of each of n steps.

    After a standstill the values are NaN.
    """

    experiment: Experiment
    turns: np.ndarray  # revolutions of the cutter since the start
    time: np.ndarray  # s
    speed: np.ndarray  # rad/s
    current: np.ndarray  # A
    force: np.ndarray  # N, largest tangential force on a tooth
    torque: np.ndarray  # N m
    out_of_cut: np.ndarray  # number of teeth between entry and exit that met no chip
    saturated: np.ndarray  # 1 where the current command was limited in the step before, else 0
    lowest_current: np.ndarray  # A, within the step before
    highest_current: np.ndarray  # A
    seen: np.ndarray  # N or N m, what the controller was shown at each sample
    command: np.ndarray  # V, speed command from each sample to the next
    standstill: float | None  # revolutions after which the spindle stood still, if it did

    def during(self, turn: int) -> slice:
        """The values of a turn counted from 1, or from the end: -1 is the last turn."""
        per_turn, turns = self.experiment.steps_per_turn, self.experiment.turns
        size = whole_number(abs(turn), "turn", 0)
        if not 1 <= size <= turns:
            raise ValueError(f"turn {turn}: the run has turns 1 to {turns}, or -1 for the last")
        first = (size - 1 if turn > 0 else turns - size) * per_turn
        return slice(first + 1, first + 1 + per_turn)


def simulate(experiment: Experiment) -> Run:
    """Turn the cutter through one experiment; see `simulate_all`."""
    return simulate_all([experiment])[0]


def simulate_all(experiments: Sequence[Experiment]) -> list[Run]:
    """Turn the cutters of several experiments, side by side where they share drive and steps.

    Within a step of the angle the cutting torque is held at its value in the middle, and the drive,
    linear between two switchings of its limit, moves on exactly; the step lasts until the angle is
    reached.  So fast modes of the drive limit no step, and halving the step quarters the error
    where teeth enter and leave at the ends of steps; other entries and exits, and the switching of
    the limit, are met to within a step.

    The current overshoots just behind a sampling instant, in less time than a step takes.  Its
    extremes are therefore looked for at `inner` points of every step's exact solution.
    Source: Tsao and Pong (1991), eqs 6-9 and 12.
    """
    experiments = list(experiments)
    alike: dict[tuple, list[int]] = {}
    for i, one in enumerate(experiments):
        mill = one.mill
        steps = (one.substeps, one.inner, one.turns)
        key = (mill.drive, mill.teeth, mill.samples_per_pitch, *steps)
        alike.setdefault(key, []).append(i)
    runs: dict[int, Run] = {}
    for members in alike.values():
        for first in range(0, len(members), ABREAST):
            some = members[first : first + ABREAST]
            runs.update(zip(some, _side_by_side([experiments[i] for i in some]), strict=True))
    return [runs[i] for i in range(len(experiments))]


def _side_by_side(group: list[Experiment]) -> list[Run]:
    """Runs that share drive and steps; the last axis of every array counts the runs."""
    mill, every = group[0].mill, group[0].substeps
    back, steps = mill.samples_per_pitch * every, group[0].turns * group[0].steps_per_turn
    angle = sampling_angle(mill) / every
    modes, cut, law = modes_of(mill.drive), cut_of(group), law_of(group)
    state = rest = np.array([spindle_drive.steady_state(mill.drive, e.mill.speed) for e in group]).T
    # The clock at the ends and in the middle of the steps, begun one tooth pitch before the start.
    clock = np.arange(-back, steps + 1)[:, None] * angle / rest[0]
    middle = clock[:-1] + angle / 2 / rest[0]
    log = np.zeros((steps + 1, len(LOGGED), len(group)))
    log[0, :3], log[0, 7:] = (clock[back], state[0], state[1]), state[1]
    seen, error, sent = np.zeros((3, law.reach + steps // every, len(group)))
    moving = np.ones(len(group), dtype=bool)
    for step in range(steps):
        now, speed, trend = back + step, state[0], (state[0] - log[step - 1, 1]) / 2
        if step % every == 0:
            k = law.reach + step // every
            seen[k] = law.measure(log[max(0, step - back + 1) : step + 1], every)
            at_work = moving & (step // every >= law.first)
            error[k] = np.where(at_work, law.target - seen[k], 0.0)
            sent[k] = law.answer(error, sent, k)
        ahead = speed + np.where(moving & (step > 0), trend, 0.0)  # speed in the middle
        guess = clock[now] + angle / 2 / speed
        _, load, _ = cut.loads(2 * step + 1, guess - middle[step], ahead)
        inputs = np.array([law.base + sent[k], load])
        seconds, after, extremes, limited = turn(
            modes, state, inputs, law.holds, angle, group[0].inner
        )
        moving = moving & (after[0] > STANDSTILL * rest[0])
        state = np.where(moving, after, rest)
        clock[now + 1] = clock[now] + np.where(moving, seconds, angle / rest[0])
        bend = angle / 8 * (1 / speed - 1 / state[0])
        middle[now] = (clock[now] + clock[now + 1]) / 2 + bend
        loads = cut.loads(2 * step + 2, clock[now + 1] - clock[step + 1], state[0])
        row = (clock[now + 1], *state[:2], *loads, limited, *extremes)
        log[step + 1] = np.where(moving, row, np.nan)
    return [_run(one, i, log, seen, law.base + sent, law.reach) for i, one in enumerate(group)]


def _run(one: Experiment, i: int, log: np.ndarray, seen, command, reach: int) -> Run:
    turns = np.arange(len(log)) / one.steps_per_turn
    still = np.flatnonzero(np.isnan(log[:, 1, i]))
    stop = float(turns[still[0]]) if still.size else None
    return Run(one, turns, *log[:, :, i].T, seen[reach:, i], command[reach:, i], stop)
