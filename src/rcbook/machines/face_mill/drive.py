"""The drive, which moves on exactly while the command stands still and the torque is a parabola."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rcbook.machines import spindle_drive
from rcbook.machines.face_mill.abreast import MANY, Arithmetic
from rcbook.machines.spindle_drive import SpindleDrive


class Modes(NamedTuple):
    """The drive taken apart into its modes."""

    poles: list
    right: list  # [state][mode]
    left: list  # [mode][state]
    command: list  # [mode] by speed command, V
    load: list  # [mode] by torque, N m
    current: list  # [mode] by a limited current command, V


class Drive(NamedTuple):
    """The drive by what its current command does, and that command by the modes in control."""

    control: Modes
    limited: Modes
    held: Modes  # limited, and the velocity integral stands
    wanted: list  # [mode], V
    by_command: float  # V per V of speed command
    limit: float  # V


def drive_of(drive: SpindleDrive, op: Arithmetic) -> Drive:
    closed, inner = spindle_drive.speed_driven(drive), spindle_drive.current_driven(drive)
    integral = np.array([[0, 0, 0, 0, drive.velocity_integral]]).T
    driven = np.hstack([integral, inner.B[:, [1, 0]]])
    runs_on = np.array([[1, 1, 1, 1, 0]]).T
    control = _modes(op, closed.A, np.hstack([closed.B, np.zeros((5, 1))]))
    return Drive(
        control,
        _modes(op, inner.A, driven),
        _modes(op, runs_on * inner.A, runs_on * driven),
        [
            i - drive.velocity_gain * w
            for w, i in zip(control.right[2], control.right[4], strict=True)
        ],
        drive.velocity_gain,
        drive.command_limit,
    )


def _modes(op: Arithmetic, matrix: np.ndarray, inputs: np.ndarray) -> Modes:
    poles, right = np.linalg.eig(matrix)
    left, kept = np.linalg.inv(right), (poles.imag >= 0) | (not op.pairs)
    driven, right = left @ inputs, right * np.where((poles.imag > 0) & op.pairs, 2, 1)
    real = poles[kept].imag == 0

    def each(rows: np.ndarray) -> list:
        return [op.modes(row[kept], real) for row in rows]

    return Modes(*each([poles]), each(right), [*zip(*each(left.T), strict=True)], *each(driven.T))


def mixed(op: Arithmetic, runs: bool, yes: Modes, no: Modes) -> Modes:
    """The one modes for some of many runs, and the other ones for the rest."""

    def choose(a: list, b: list) -> list:
        if isinstance(a, np.ndarray):
            return op.choose(runs, a, b)
        return [choose(*pair) for pair in zip(a, b, strict=True)]

    return Modes(*choose(yes, no))


def modal(modes: Modes, state: list) -> list:
    return [sum(c * x for c, x in zip(row, state, strict=True)) for row in modes.left]


def read(op: Arithmetic, row: list, state: list) -> float:
    """A state of the drive, from its row of `right` and the modes."""
    return sum(op.total((c * x).real) for c, x in zip(row, state, strict=True))


def pushes(modes: Modes, command: float, current: float) -> list:
    """What speed command and limited current command add to the rates of the modes."""
    return [c * command + i * current for c, i in zip(modes.command, modes.current, strict=True)]


def move(
    op: Arithmetic, modes: Modes, state: list, push: list, torque: tuple, seconds: float
) -> tuple[list, float, float]:
    """Modes, speed and turned angle after some seconds.

    `torque` has the value at the start, and the two derivatives with these seconds for a unit.
    """
    level, slope, curve = torque
    after, speed, turned = [], 0.0, 0.0
    for pole, old, by_load, by_command, seen in zip(
        modes.poles, state, modes.load, push, modes.right[0], strict=True
    ):
        rate = pole * old + by_load * level + by_command
        one, two, three, four = _weights(op, pole * seconds)
        new = old + seconds * (one * rate + by_load * (two * slope + three * curve))
        passed = old + seconds * (two * rate + by_load * (three * slope + four * curve))
        after.append(new)
        speed = speed + op.total((seen * new).real)
        turned = turned + op.total((seen * passed).real)
    return after, speed, seconds * turned


def _weights(op: Arithmetic, x: complex) -> tuple:
    """e^x less its first 1 to 4 terms, over x to the power of 1 to 4."""
    small = abs(x) < 1e-2
    if op.some(small):  # where differences lose digits: by the series, for the others as below
        four = (1 + x / 5 * (1 + x / 6 * (1 + x / 7 * (1 + x / 8)))) / 24
        three = 1 / 6 + x * four
        two = 1 / 2 + x * three
        series = 1 + x * two, two, three, four
        if not op.some(small ^ True):
            return series
        others = _weights(op, op.choose(small, 1.0, x))
        return tuple(op.choose(small, a, b) for a, b in zip(series, others, strict=True))
    one = op.rise(x) / x
    two = (one - 1) / x
    three = (two - 1 / 2) / x
    return one, two, three, (three - 1 / 6) / x


def currents_within(
    op: Arithmetic, modes: Modes, begun: list, inner: int
) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest current at `inner` points, but for the last, of steps begun so.

    `begun` has the arguments of `move` one after the other, each an array.
    """
    count, found, over = len(modes.poles), [], MANY._replace(total=op.total)
    state, push, (level, slope, curve, seconds) = begun[:count], begun[count:-4], begun[-4:]
    for part in np.arange(1, inner) / inner:
        within = level, slope * part, curve * part**2
        after, _, _ = move(over, modes, state, push, within, seconds * part)
        found.append(read(over, modes.right[1], after))
    return np.min(found, axis=0), np.max(found, axis=0)
