"""The nonlinear mill turned step by step through its experiments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rcbook.machines import spindle_drive
from rcbook.machines.face_mill.abreast import MANY, ONE, Arithmetic
from rcbook.machines.face_mill.cut import cut_of
from rcbook.machines.face_mill.drive import Drive, currents_within, drive_of, modal, read
from rcbook.machines.face_mill.experiment import Experiment
from rcbook.machines.face_mill.law import law_of
from rcbook.machines.face_mill.mill import sampling_angle
from rcbook.machines.face_mill.readings import LOGGED
from rcbook.machines.face_mill.step import End, Start, either, turn
from rcbook.zdomain import whole_number

FEW = 8  # runs that are quicker one by one
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

    Within a step of the angle the cutting torque is a parabola of time, a chip that vanishes there
    leaves its mean and its first two moments, and the drive, linear between two switchings of its
    limit, moves on exactly; the step lasts until the angle is reached.  So fast modes of the drive
    limit no step, and halving the step leaves a sixteenth of the error where teeth enter and leave
    at the ends of steps; other entries and exits, and the switching of the limit, are met to within
    a step.

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
        abreast = ABREAST if len(members) >= FEW else 1
        for first in range(0, len(members), abreast):
            some = members[first : first + abreast]
            with np.errstate(all="ignore"):  # of runs that one or the other step is not for
                found = _side_by_side([experiments[i] for i in some])
            runs.update(zip(some, found, strict=True))
    return [runs[i] for i in range(len(experiments))]


def _side_by_side(group: list[Experiment]) -> list[Run]:
    """Runs that share drive and steps; the last axis of every array counts the runs."""
    op, mill, every = ONE if len(group) == 1 else MANY, group[0].mill, group[0].substeps
    back, steps = mill.samples_per_pitch * every, group[0].turns * group[0].steps_per_turn
    angle, drive = sampling_angle(mill) / every, drive_of(mill.drive, op)
    cut, law = cut_of(group, op), law_of(group)
    log, idle = _begun(op, group, drive, steps)
    holds, moving = op.each(law.holds), op.each(np.ones(len(group), dtype=bool))
    # The clock at the ends and in the middle of the steps, begun one tooth pitch before the start.
    clock = [k * idle.seconds for k in range(-back, 1)]
    middle = [(k + 0.5) * idle.seconds for k in range(-back, 0)]
    signals = seen, _, sent = np.zeros((3, law.reach + steps // every, len(group)))
    end, before, walked, rows = idle, idle, [], log[:, :, 0] if op is ONE else log
    for step in range(steps):
        if step % every == 0:
            recent = log[max(0, step - back + 1) : step + 1]
            command = op.each(law.base + law.sample(signals, recent, step // every, moving))
        now, teeth = clock[-1], cut.meeting(step)
        since = now - clock[step], now - middle[step], now - clock[step + 1]
        guess = end.seconds**2 / before.seconds  # stays positive when the spindle stops
        start = Start(angle, end.state, end.speed, command, teeth, since, guess, moving)
        before, (end, limited, *begun) = end, turn(cut, drive, holds, start)
        moving = moving & end.reached & (end.speed > STANDSTILL * idle.speed)
        if op.some(moving ^ True):
            end = either(op, moving, end, idle)
        clock.append(now + end.seconds)
        middle.append(now + end.seconds / 2 + end.ahead)
        current = read(op, drive.control.right[1], end.state)
        loads = cut.at_end(teeth, clock[-1] - clock[step + 1], end.speed)
        row = clock[-1], end.speed, current, *loads, limited, current, current
        if op.some(moving ^ True):
            row = [op.choose(moving, value, np.nan) for value in row]
        rows[step + 1] = row
        if group[0].inner > 1:
            walked.append((step + 1, *begun))
    _widen(op, log, walked, group[0].inner)
    commands = law.base + sent  # once: every run keeps a column, and so the whole
    return [_run(one, i, log, seen, commands, law.reach) for i, one in enumerate(group)]


def _begun(
    op: Arithmetic, group: list[Experiment], drive: Drive, steps: int
) -> tuple[np.ndarray, End]:
    """The log with its first row, and a step of the spindle that turns freely."""
    rest = [spindle_drive.steady_state(e.mill.drive, e.mill.speed) for e in group]
    rest, log = np.array(rest).T, np.zeros((steps + 1, len(LOGGED), len(group)))
    log[0, 1:3], log[0, 7:] = rest[:2], rest[1]
    speed, angle = op.each(rest[0]), 2 * np.pi / group[0].steps_per_turn
    return log, End(angle / speed, 0.0, speed, True, modal(drive.control, op.each(rest)))


def _widen(op: Arithmetic, log: np.ndarray, walked: list[tuple], inner: int) -> None:
    """Let the extremes of the current in the log take in those between the ends of steps."""
    by_modes: dict[int, list] = {}
    for part in walked:
        by_modes.setdefault(id(part[1]), []).append(part)
    for parts in by_modes.values():
        steps, (modes, *_), begun = zip(*parts, strict=True)
        columns = [op.string(column) for column in zip(*begun, strict=True)]
        within, steps = currents_within(op, modes, columns, inner), np.array(steps)
        for row, extreme, found in zip((-2, -1), (np.minimum, np.maximum), within, strict=True):
            known = log[steps, row]
            log[steps, row] = extreme(known, found.reshape(known.shape))


def _run(one: Experiment, i: int, log: np.ndarray, seen, command, reach: int) -> Run:
    turns = np.arange(len(log)) / one.steps_per_turn
    still = np.flatnonzero(np.isnan(log[:, 1, i]))
    stop = float(turns[still[0]]) if still.size else None
    return Run(one, turns, *log[:, :, i].T, seen[reach:, i], command[reach:, i], stop)
