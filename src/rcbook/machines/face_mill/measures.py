"""What is read off a run: tooth forces, peaks, swings, and whether control was stable."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rcbook.machines.face_mill.cut import tooth_chips
from rcbook.machines.face_mill.mill import RPM
from rcbook.machines.face_mill.readings import OUTPUTS, one_of
from rcbook.machines.face_mill.simulation import Run

GROWTH = 1.01  # beyond which neither rounding nor convergence decides


def tooth_forces(run: Run) -> np.ndarray:
    """Tangential force in N on every tooth at the end of every step, shape (n + 1, teeth)."""
    one = run.experiment
    back = one.mill.samples_per_pitch * one.substeps
    before = run.time[0] - np.arange(back, 0, -1) * 2 * np.pi / one.steps_per_turn / one.mill.speed
    elapsed = run.time - np.concatenate([before, run.time])[: run.time.size]
    forces = one.mill.cutting_coefficient * one.mill.depth * tooth_chips(one, elapsed)
    return np.where(np.isnan(run.force)[:, None], np.nan, forces)


def pitch_peaks(run: Run) -> np.ndarray:
    """Largest tooth force in N within each tooth pitch, shape (turns, teeth)."""
    return run.force[1:].reshape(run.experiment.turns, run.experiment.mill.teeth, -1).max(axis=2)


def pitch_torques(run: Run) -> np.ndarray:
    """Mean cutting torque in N m over each tooth pitch, shape (turns, teeth).

    The passing of the teeth of an even cutter leaves no trace in it.
    """
    return run.torque[1:].reshape(run.experiment.turns, run.experiment.mill.teeth, -1).mean(axis=2)


def peak_spreads(run: Run) -> np.ndarray:
    """Largest minus smallest of the peaks per tooth pitch in N, by turns; infinite once at rest."""
    return np.nan_to_num(np.ptp(pitch_peaks(run), axis=1), nan=np.inf)


def torque_spreads(run: Run) -> np.ndarray:
    """Largest minus smallest mean torque of a pitch in N m, by turns; infinite once at rest."""
    return np.nan_to_num(np.ptp(pitch_torques(run), axis=1), nan=np.inf)


def current_swings(run: Run) -> np.ndarray:
    """Half the range of the current in A within each turn; infinite once at rest."""
    turns = run.experiment.turns
    high = run.highest_current[1:].reshape(turns, -1).max(axis=1)
    low = run.lowest_current[1:].reshape(turns, -1).min(axis=1)
    return np.nan_to_num(high - low, nan=np.inf) / 2


def current_swing(run: Run, turn: int = -1) -> float:
    """Half the range of the current in A within a turn counted as in `Run.during`."""
    run.during(turn)
    return float(current_swings(run)[turn - 1 if turn > 0 else turn])


class Evenness(NamedTuple):
    """Spreads in N or N m, in the turn before control and in the last one."""

    before: float
    after: float

    @property
    def left(self) -> float:
        """Share of the spread that control leaves."""
        return self.after / self.before


def evenness(run: Run, output: str = "force") -> Evenness:
    """How even control makes the peaks per tooth pitch, or the mean torques of the pitches.

    Raises ValueError for another output than force or torque.
    """
    one_of(output, OUTPUTS, "output")
    spreads = peak_spreads(run) if output == "force" else torque_spreads(run)
    return Evenness(spreads[run.experiment.controlled - 2], spreads[-1])


def turns_until(run: Run, share: float) -> int:
    """Turns of control after which the spread of the peaks stays within a share of that before.

    All turns of control when it does not.
    """
    spreads, controlled = peak_spreads(run), run.experiment.controlled
    over = np.flatnonzero(~(spreads[controlled - 1 :] / spreads[controlled - 2] <= share))
    return int(over[-1]) + 1 if over.size else 0


def revolutions_until(run: Run, spread: float) -> float:
    """Revolutions of control after which any turn's peaks spread by at most `spread` N for good.

    A turn may begin with any tooth; infinite when the run ends above it.
    """
    teeth = run.experiment.mill.teeth
    peaks = pitch_peaks(run)[run.experiment.controlled - 1 :].ravel()
    turns = np.ptp(np.lib.stride_tricks.sliding_window_view(peaks, teeth), axis=1)
    over = np.flatnonzero(~(turns <= spread))
    if over.size and over[-1] == turns.size - 1:
        return np.inf
    return float((over[-1] + 1) / teeth) if over.size else 0.0


def summary(run: Run) -> dict[str, str | float]:
    """A controlled run as the row of a table: outcome, spreads, range of current and speed.

    Spreads are those before control and in the last turn, ranges those of the last turn.
    """
    last, force, torque = run.during(-1), evenness(run), evenness(run, "torque")
    speed = run.speed[last] / RPM
    return {
        "outcome": outcome(run),
        "peaks before (N)": force.before,
        "at the end (N)": force.after,
        "torque before (N m)": torque.before,
        "at the end (N m)": torque.after,
        "current from (A)": run.lowest_current[last].min(),
        "to (A)": run.highest_current[last].max(),
        "speed from (rpm)": speed.min(),
        "to (rpm)": speed.max(),
    }


def outcome(run: Run) -> str:
    """Whether control was "stable", "unstable" or "undecided", from peak force and current.

    Unstable is a standstill, a spread of the peaks in the last turn not below that of the turn
    before control, or a swing of the current that grows.  Stable is less than half of the spread
    and no growth of it either, unless it is below a twentieth of the one before.  Undecided is what
    is neither, and a cut whose peaks differ by less than a hundredth of the nominal force to begin
    with.  What grows is larger in the last quarter of control than in the two quarters before, by
    more than the factor `GROWTH`.  How slow a growth is seen depends on the number of turns.
    Raises ValueError when fewer than five turns are controlled or none is cut before.
    """
    one = run.experiment
    if not one.engaged < one.controlled <= one.turns - 4:
        raise ValueError(
            f"cut from turn {one.engaged}, controlled from {one.controlled} of {one.turns}: "
            "give it a turn of cutting before control and five turns of control"
        )
    spreads = np.ptp(pitch_peaks(run), axis=1)
    before, last = spreads[one.controlled - 2], spreads[-1]
    if run.standstill is not None:
        return "unstable"
    if before < 0.01 * one.mill.nominal_force:
        return "undecided"
    if last >= before or _grows(run, current_swings(run)):
        return "unstable"
    calm = last < before / 2 and (last <= before / 20 or not _grows(run, spreads))
    return "stable" if calm else "undecided"


def _grows(run: Run, values: np.ndarray) -> bool:
    """Whether values by turns are larger in the last quarter of control than in the two before."""
    quarter = max(1, (run.experiment.turns - run.experiment.controlled + 1) // 4)
    return bool(values[-quarter:].max() > GROWTH * values[-3 * quarter : -quarter].max())
