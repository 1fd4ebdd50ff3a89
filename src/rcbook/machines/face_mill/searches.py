"""Where a cut stops being stable, where its current meets the limit, and which steps will do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy.optimize

from rcbook import zdomain
from rcbook.machines.face_mill.experiment import Experiment
from rcbook.machines.face_mill.measures import current_swing
from rcbook.machines.face_mill.mill import FaceMill
from rcbook.machines.face_mill.model import is_stable
from rcbook.machines.face_mill.simulation import simulate


def largest_stable_depth(
    mill: FaceMill,
    torque: str = "memory",
    roots_outside: Callable[[FaceMill], int] | None = None,
    deepest: float = 9e-3,
    precision: float = 1e-6,
) -> float:
    """Largest depth in m, from that of the mill on, at which drive, cut and loop are stable.

    `roots_outside` counts the roots outside of the unit circle that the loop round a mill has;
    without it drive and cut stand alone.  `torque` is that of `is_stable`.  Zero when already the
    mill as it stands is unstable.
    """

    def stable(depth: float) -> bool:
        deeper = replace(mill, depth=depth)
        alone = is_stable(deeper, torque)
        return alone and (roots_outside is None or not roots_outside(deeper))

    if not stable(mill.depth):
        return 0.0
    return zdomain.boundary(stable, mill.depth, deepest, precision)


def onset_of_limit(
    experiment_at: Callable[[float], Experiment],
    start: float,
    second: float,
    far: float,
    tolerance: float,
) -> float:
    """Where the largest current of the last turn comes up to the limit of the drive.

    `experiment_at` gives the experiment for a number, such as a speed; the secant method begins
    with `start` and `second` and ends within `tolerance`.  Infinite when less than 99 percent of
    the limit are reached at `far`, where the limit should have been met.
    """

    def highest(x: float) -> float:
        run = simulate(experiment_at(x))
        return run.highest_current[run.during(-1)].max()

    limit = experiment_at(far).mill.drive.current_limit
    if not highest(far) > 0.99 * limit:
        return np.inf
    found = scipy.optimize.newton(lambda x: highest(x) - limit, start, x1=second, tol=tolerance)
    return float(found)


def step_errors(
    experiment: Experiment, substeps: Sequence[int], points: int
) -> dict[str, np.ndarray]:
    """What all numbers of steps per sample but the last are off from the last, by quantity.

    Force (N), speed (rad/s) and current (A): the largest difference at the samples.  Swing of the
    current in the last turn (A): its difference, with `points` per sample at which the extremes
    are looked for.
    """
    *coarse, finest = (
        simulate(replace(experiment, substeps=n, inner=points // n)) for n in substeps
    )
    off: dict[str, list] = {name: [] for name in ("force", "speed", "current", "swing")}
    for run in coarse:
        for name in ("force", "speed", "current"):
            at, truth = (getattr(r, name)[:: r.experiment.substeps] for r in (run, finest))
            off[name].append(np.abs(at - truth).max())
        off["swing"].append(abs(current_swing(run) - current_swing(finest)))
    return {name: np.array(errors) for name, errors in off.items()}
