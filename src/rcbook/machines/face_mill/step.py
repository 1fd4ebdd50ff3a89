"""One step of the cutter angle: the time that it takes, and the drive behind it."""

from __future__ import annotations

from typing import NamedTuple

from rcbook.machines.face_mill.abreast import Arithmetic
from rcbook.machines.face_mill.cut import Cut, Met
from rcbook.machines.face_mill.drive import Drive, Modes, mixed, modal, move, pushes, read

PASSES = 30
MISS = 1e-9  # of the angle


class Start(NamedTuple):
    """What a step of the angle, in rad, begins with."""

    angle: float
    state: list  # in the modes of the drive in control
    speed: float  # rad/s
    command: float  # V
    teeth: list[Met]
    since: tuple  # s from one pitch before its start, middle and end to its start
    guess: float  # s that it may take
    moving: bool


class End(NamedTuple):
    """How the step ends."""

    seconds: float  # that it took
    ahead: float  # s by which half of the angle takes more than half of them
    speed: float  # rad/s
    reached: bool  # whether the spindle got there
    state: list  # in the modes of the drive in control


def turn(cut: Cut, drive: Drive, holds: bool, start: Start) -> tuple[End, bool, Modes, list]:
    """The end of the step, and whether the current command is limited in it.

    With its modes, and with what of it `currents_within` needs.
    """
    op, state, modes = cut.op, start.state, None
    wanted = read(op, drive.wanted, state) + drive.by_command * start.command
    limited = abs(wanted) > drive.limit
    current = op.choose(wanted > 0, drive.limit, -drive.limit)
    cases = limited ^ True, limited & (holds ^ True), limited & holds
    for runs, case in zip(cases, drive[:3], strict=True):
        if op.some(runs):
            modes = case if modes is None else mixed(op, runs, case, modes)
    if modes is not drive.control:
        state = modal(modes, [read(op, row, state) for row in drive.control.right])
    push = pushes(modes, start.command, current)
    end, torque = _turn(cut, modes, state, push, start)
    begun = [*state, *push, *torque, end.seconds]
    if modes is not drive.control:
        after = modal(drive.control, [read(op, row, end.state) for row in modes.right])
        end = end._replace(state=after)
    return end, limited, modes, begun


def either(op: Arithmetic, runs: bool, yes: End, no: End) -> End:
    """The one end for some runs, and the other one for the rest."""
    numbers = (op.choose(runs, a, b) for a, b in zip(yes[:4], no[:4], strict=True))
    state = [op.choose(runs, a, b) for a, b in zip(yes.state, no.state, strict=True)]
    return End(*numbers, state)


def _turn(cut: Cut, modes: Modes, state: list, push: list, start: Start) -> tuple[End, tuple]:
    """Newton's method for the time at which the angle is reached, under the torque meanwhile."""
    op, angle, seconds, then = cut.op, start.angle, start.guess, start.speed
    for _ in range(PASSES):
        ahead = angle / 8 * (1 / start.speed - 1 / then)
        torque = cut.torque(start.teeth, _fed(cut, start, seconds, ahead, then), ahead / seconds)
        after, speed, turned = move(op, modes, state, push, torque, seconds)
        miss = turned - angle
        reached = abs(miss) < MISS * angle
        if not op.some(start.moving & (reached ^ True)):
            break
        then = op.choose(speed > start.speed / 100, speed, start.speed / 100)
        better = seconds - miss / then
        better = op.choose(better > seconds / 2, better, seconds / 2)
        seconds = op.choose(better < 2 * seconds, better, 2 * seconds)
    return End(seconds, ahead, speed, reached, after), torque


def _fed(cut: Cut, start: Start, seconds: float, ahead: float, then: float) -> tuple:
    """Feed in m during the last pitch, at the start, in the middle and at the end of the step."""
    feed, (before, middle, after) = cut.feed_speed, start.since
    times = before, middle + seconds / 2 + ahead, after + seconds
    if cut.op.some(cut.instantaneous):
        slow, slower = 1 / start.speed, 1 / then
        between = 1.5 * seconds / start.angle - (slow + slower) / 4
        times = [
            cut.op.choose(cut.instantaneous, cut.pitch * at, time)
            for at, time in zip((slow, between, slower), times, strict=True)
        ]
    return feed * times[0], feed * times[1], feed * times[2]
