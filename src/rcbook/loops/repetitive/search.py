"""What is looked for round a repetitive loop: gains that will do, and how far a run swings."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from functools import partial

import numpy as np
import scipy.optimize
from numpy.typing import ArrayLike

from rcbook import signals
from rcbook.loops.repetitive.loop import Loop, Process
from rcbook.loops.repetitive.response import respond
from rcbook.loops.repetitive.stability import controller_polynomials
from rcbook.loops.run import Run
from rcbook.spread import spread
from rcbook.zdomain import evaluate


def acceptable_gains(
    loop: Loop,
    gains: ArrayLike,
    fault: Callable[[Run], float],
    reference: ArrayLike,
    *,
    disturbance: ArrayLike | None = None,
    executor: Executor | None = None,
) -> tuple[float, float]:
    """Lowest and highest repetitive gain at which `fault` of the response changes its sign.

    `fault` is negative where a run is acceptable.  Changes are looked for between neighbours of
    `gains`, whose runs the workers of an `executor` share, and refined to 1e-12.
    Raises ValueError where the fault does not change its sign twice.
    """
    at = partial(_fault_at, loop, fault, reference, disturbance)
    gains = signals.signal(gains, "gains")
    changes = np.flatnonzero(np.diff(np.sign(spread(at, gains, executor))))
    if changes.size < 2:
        raise ValueError(f"{changes.size} ends of a range among {gains.size} gains; try others")
    low, high = (
        scipy.optimize.brentq(at, gains[i], gains[i + 1], xtol=1e-12) for i in changes[[0, -1]]
    )
    return low, high


def _fault_at(loop: Loop, fault: Callable, reference, disturbance, gain: float) -> float:
    return fault(respond(loop.with_gain(gain), reference, disturbance=disturbance))


def meeting_gains(process: Process) -> np.ndarray:
    """Positive factors on the inner controller at which branches of the root locus meet, sorted.

    Only those on the real axis, where d' n = d n' for the closed loop d + k n.
    """
    d, n = controller_polynomials(process)
    z = np.roots(np.polysub(np.polymul(np.polyder(d), n), np.polymul(d, np.polyder(n))))
    z = z[np.isreal(z) & (z != 0)].real
    factors = -evaluate(d, z) / evaluate(n, z)
    return np.sort(factors[np.isfinite(factors) & (factors > 0)])


def swings(run: Run, samples: int, windows: int = 1) -> np.ndarray:
    """Half the range of the output in each of the last windows of a run; infinite if it ran away.

    Raises ValueError when the run is too short for them.
    """
    if run.unbounded:
        return np.full(windows, np.inf)
    if samples * windows > run.output.size:
        raise ValueError(f"{run.output.size} samples hold no {windows} windows of {samples}")
    return np.ptp(run.output[-samples * windows :].reshape(windows, samples), axis=1) / 2
