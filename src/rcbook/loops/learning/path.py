"""What a machine makes of learned samples: between them, and under limits of its feed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.signals import signal


def error_between(
    samples: ArrayLike, shape: Callable[[np.ndarray], np.ndarray], points: int = 50
) -> float:
    """Largest error of a tool that moves straight from sample to sample of a repeating pass.

    `shape` gives the wanted position at any number of samples from the first one; it is looked at
    in `points` points an interval.
    """
    samples, points = signal(samples, "samples"), zdomain.whole_number(points, "points")
    at = np.arange(samples.size * points) / points
    straight = np.interp(at, np.arange(samples.size + 1), np.append(samples, samples[0]))
    return float(np.abs(straight - shape(at)).max())


def rate_limited(
    command: ArrayLike, dt: float, speed: float, acceleration: float = np.inf, passes: int = 8
) -> np.ndarray:
    """The last of `passes` passes of a repeating command, followed from 0 under limits.

    `speed` and `acceleration` are the largest ones, in units of the command per s and per s^2.
    The follower aims at the present command and does not brake ahead of it.
    """
    command, dt = signal(command, "command"), zdomain.real_number(dt, "dt", positive=True)
    for name, limit in (("speed", speed), ("acceleration", acceleration)):
        if not limit > 0:
            raise ValueError(f"{name} = {limit!r} must be positive")
    most, jump = speed * dt, acceleration * dt**2
    wanted = np.tile(command, zdomain.whole_number(passes, "passes"))
    out, moves = np.zeros(wanted.size), 0.0
    for k in range(wanted.size - 1):
        step = np.clip(wanted[k + 1] - out[k], -most, most)
        moves = np.clip(step, moves - jump, moves + jump)
        out[k + 1] = out[k] + moves
    return out[-command.size :]
