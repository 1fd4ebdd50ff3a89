"""The drive, which moves on exactly while torque and command stand still."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rcbook.machines import spindle_drive
from rcbook.machines.spindle_drive import SpindleDrive

NEWTON_STEPS = 30
ROUNDING = 1e-13


class Modes(NamedTuple):
    """The drive mode by mode, first axis: in control, limited, limited with the integral held."""

    poles: np.ndarray  # (3, 5)
    right: np.ndarray  # (3, 5, 5)
    left: np.ndarray  # (3, 5, 5)
    inputs: np.ndarray  # (3, 5, 3), of speed command, torque and the limited current command
    wanted: np.ndarray  # (5,), current command per state
    wanted_by_command: float  # current command per speed command
    limit: float  # V


def modes_of(drive: SpindleDrive) -> Modes:
    closed, inner = spindle_drive.speed_driven(drive), spindle_drive.current_driven(drive)
    held = inner.A.copy()
    held[4] = 0
    by_command = np.array([[0, 0, 0, 0, drive.velocity_integral]]).T
    driven = np.hstack([by_command, inner.B[:, [1, 0]]])
    matrices = np.array([closed.A, inner.A, held])
    inputs = np.array([np.hstack([closed.B, np.zeros((5, 1))]), driven, driven])
    inputs[2, 4] = 0
    poles, right = np.linalg.eig(matrices)
    left = np.linalg.inv(right)
    wanted = np.array([0, 0, -drive.velocity_gain, 0, 1.0])
    return Modes(
        poles, right, left, left @ inputs, wanted, drive.velocity_gain, drive.command_limit
    )


def turn(
    modes: Modes,
    state: np.ndarray,
    inputs: np.ndarray,
    holds: np.ndarray,
    angle: float,
    inner: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Seconds that the spindle takes for an angle, its state then, the smallest and the largest
    current on the way at `inner` points, and whether the current command was limited."""
    wanted = modes.wanted @ state + modes.wanted_by_command * inputs[0]
    limited = np.abs(wanted) > modes.limit
    which = np.where(limited, 1 + holds, 0)
    if not limited.any():
        return *_turn_in_mode(modes, 0, state, inputs, angle, inner), limited
    inputs = np.vstack([inputs, np.sign(wanted) * modes.limit])
    seconds, after = np.empty(state.shape[1]), np.empty(state.shape)
    extremes = np.empty((2, state.shape[1]))
    for mode in np.unique(which):
        runs = which == mode
        seconds[runs], after[:, runs], extremes[:, runs] = _turn_in_mode(
            modes, mode, state[:, runs], inputs[:, runs], angle, inner
        )
    return seconds, after, extremes, limited


def _turn_in_mode(
    modes: Modes, mode: int, state: np.ndarray, inputs: np.ndarray, angle: float, inner: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Newton's method for the time at which the angle is reached, on the exact solution."""
    poles, right = modes.poles[mode][:, None], modes.right[mode]
    start = modes.left[mode] @ state
    drive = modes.inputs[mode][:, : len(inputs)] @ inputs
    decays = poles != 0
    with np.errstate(all="ignore"):  # a spindle that comes to rest has no solution
        seconds = angle / state[0]
        gain = (right[0] @ (poles * start + drive)).real * seconds
        seconds = seconds * (1 - gain / 2 / state[0])
        for _ in range(NEWTON_STEPS):
            x = poles * seconds
            rise = np.expm1(x)
            once = np.divide(rise, poles, out=seconds + 0 * x, where=decays)
            twice = np.divide(rise - x, poles**2, out=seconds**2 / 2 + 0 * x, where=decays)
            speed = (right[0] @ (start * (1 + rise) + drive * once)).real
            miss = (right[0] @ (start * once + drive * twice)).real - angle
            if np.all(np.abs(miss) < ROUNDING * angle):
                break
            seconds = seconds - miss / speed
        after = (right @ (start * (1 + rise) + drive * once)).real
        reached = (np.abs(miss) < 1e-9 * angle) & (seconds > 0)
        along = [after[1]]
        for part in np.arange(1, inner) / inner:
            x = poles * (part * seconds)
            rise = np.expm1(x)
            once = np.divide(rise, poles, out=part * seconds + 0 * x, where=decays)
            along.append((right[1] @ (start * (1 + rise) + drive * once)).real)
    extremes = np.array([np.min(along, axis=0), np.max(along, axis=0)])
    return seconds, np.where(reached, after, 0.0), extremes
