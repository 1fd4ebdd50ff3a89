"""Face milling in the cutter angle: chip thickness with runout, and the drive it acts upon.

The independent variable is the angle of the cutter, so that samples, teeth and runout keep step
whatever the speed does; time is a state like any other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.machines import spindle_drive
from rcbook.machines.spindle_drive import TSAO_PONG1991, SpindleDrive
from rcbook.signals import signal
from rcbook.zdomain import Plant, multiply, real_number, whole_number

RPM = 2 * np.pi / 60  # rad/s
OUTPUTS = ("force", "torque")
MEASURES = ("sample", "interval", "pitch")
ENTRIES = ("one by one", "at once")
TORQUES = ("memory", "instantaneous")
LIMITS = ("clamp", "hold")
LOGGED = ("time", "speed", "current", "force", "torque", "out_of_cut", "saturated")
LOGGED += ("lowest_current", "highest_current")
ABREAST = 256  # runs computed side by side, few enough for the processor's cache
STANDSTILL = 0.01  # of the nominal speed
GROWTH = 1.01  # beyond which neither rounding nor convergence decides
NEWTON_STEPS = 30
ROUNDING = 1e-13


@dataclass(frozen=True)
class FaceMill:
    """A cutter, a cut and the drive that turns it.

    `runout` holds, tooth by tooth, the radius of a tooth minus that of the tooth before it.
    Raises ValueError for a wrong number of runouts, a sum of them that is not zero to 1e-9 m, entry
    and exit angles outside 0 <= entry < exit <= pi, and sizes that are not positive.
    """

    drive: SpindleDrive
    teeth: int
    diameter: float  # m
    speed: float  # nominal, rad/s
    depth: float  # m
    feed_per_turn: float  # m
    cutting_coefficient: float  # N/m2
    runout: tuple[float, ...]  # m
    entry: float = 0.0  # rad
    exit: float = np.pi  # rad
    samples_per_pitch: int = 5

    def __post_init__(self) -> None:
        for name in ("diameter", "speed", "depth", "feed_per_turn", "cutting_coefficient"):
            value = real_number(getattr(self, name), name, positive=True)
            object.__setattr__(self, name, value)
        for name in ("teeth", "samples_per_pitch"):
            object.__setattr__(self, name, whole_number(getattr(self, name), name))
        runout = signal(self.runout, "runout", self.teeth)
        if abs(runout.sum()) > 1e-9:
            raise ValueError(
                f"runout sums to {runout.sum():.3g} m over the turn; make it differences of radii, "
                "which sum to zero"
            )
        object.__setattr__(self, "runout", tuple(map(float, runout)))
        if not 0 <= real_number(self.entry, "entry") < real_number(self.exit, "exit") <= np.pi:
            raise ValueError(
                f"entry {self.entry!r}, exit {self.exit!r}: a tooth cuts from one to the other "
                "within 0 to pi rad"
            )

    @property
    def pitch(self) -> float:
        """Angle between teeth in rad."""
        return 2 * np.pi / self.teeth

    @property
    def samples_per_turn(self) -> int:
        """N, samples per turn of the cutter."""
        return self.teeth * self.samples_per_pitch

    @property
    def feed_speed(self) -> float:
        """Speed of the feed in m/s, which stays constant."""
        return self.feed_per_turn * self.speed / (2 * np.pi)

    @property
    def tooth_feed(self) -> float:
        """Nominal feed per tooth in m."""
        return self.feed_per_turn / self.teeth

    @property
    def nominal_force(self) -> float:
        """Tangential force in N of a tooth at 90 degrees, at nominal speed without runout."""
        return self.cutting_coefficient * self.depth * self.tooth_feed

    @property
    def nominal_torque(self) -> float:
        """Cutting torque in N m of infinitely many teeth at nominal speed (eq. 13)."""
        arc = np.cos(self.entry) - np.cos(self.exit)
        area = self.depth * self.feed_per_turn / (2 * np.pi)
        return self.diameter / 2 * self.cutting_coefficient * area * arc

    @property
    def torque_slope(self) -> float:
        """G_d, slope of the torque of infinitely many teeth over the speed, N m s/rad (eq. 14)."""
        return -self.nominal_torque / self.speed

    @property
    def force_slope(self) -> float:
        """Slope of the peak force over the speed per angle of pitch, N s/rad2 (eq. 17)."""
        return -self.cutting_coefficient * self.depth * self.feed_speed / self.speed**2


EIGHT_TEETH = FaceMill(  # default conditions
    drive=TSAO_PONG1991,
    teeth=8,
    diameter=0.10,
    speed=200 * RPM,
    depth=1.23e-3,
    feed_per_turn=0.48e-3,
    cutting_coefficient=7.6332e8,
    runout=(
        14.142e-6,
        5.8579e-6,
        -5.8579e-6,
        -14.142e-6,
        -14.142e-6,
        -5.8579e-6,
        5.8579e-6,
        14.142e-6,
    ),
)
RANDOM_RUNOUT = (0.0, 0.0, 0.0, 14.3e-6, 3.7e-6, 20e-6, -9.25e-6, -28.75e-6)  # case 4, m


def eccentric_runout(teeth: int, eccentricity: float, phase: float = 0.0) -> tuple[float, ...]:
    """Runout of a cutter whose teeth lie on a circle off the spindle axis, each value in m.

    Tooth i (from 1) has the radius R + eccentricity cos((i - 1) pitch - phase).
    """
    angle = 2 * np.pi * np.arange(whole_number(teeth, "teeth", 2)) / teeth
    radius = real_number(eccentricity, "eccentricity") * np.cos(angle - real_number(phase, "phase"))
    return tuple(map(float, radius - np.roll(radius, 1)))


def sampling_angle(mill: FaceMill) -> float:
    """Turn of the cutter in rad from one sample to the next."""
    return mill.pitch / mill.samples_per_pitch


def control_model(mill: FaceMill, torque_feedback: bool = True, output: str = "force") -> Plant:
    """Speed command (V) to peak force (N), or torque (N m), linearised and sampled in the angle.

    A tooth meets what the feed has moved while one pitch went by: the integral of the speed over
    `samples_per_pitch` sampling intervals, one after the other, which is an exact moving sum.
    The sampling interval of the plant is an angle in rad.
    Source: Tsao and Pong (1991), eqs 16-18; for the torque eq. 8 averaged over the pitch.
    Raises ValueError for another output than force or torque.
    """
    _one_of(output, OUTPUTS, "output")
    slope = mill.torque_slope if torque_feedback else 0.0
    driven = spindle_drive.in_angle(spindle_drive.speed_driven(mill.drive, slope), mill.speed)
    turned = zdomain.interval_integral(driven["speed", "command"], sampling_angle(mill))
    gain = mill.force_slope if output == "force" else mill.torque_slope / mill.pitch
    moving_sum = np.ones(mill.samples_per_pitch)
    return Plant(gain * multiply(turned.b, moving_sum), turned.a, turned.delay, turned.dt)


def frequency_response(
    mill: FaceMill, z: ArrayLike, torque: str = "memory", aliases: int = 40
) -> np.ndarray:
    """Response from sampled speed command (V) to sampled peak force (N) at points z of the circle.

    It is that of the continuous machine behind its hold, summed over the aliases, and so holds for
    a torque that a sampled model of finite order cannot have: with the "memory" of eq. 8 averaged
    over the teeth, as well as "instantaneous" (eq. 14) and "none".
    Raises ValueError for another torque and for points off the circle.
    """
    _one_of(torque, (*TORQUES, "none"), "torque")
    aliases = whole_number(aliases, "aliases", 1)
    step, z = sampling_angle(mill), np.asarray(z, dtype=complex)
    if not np.all(np.abs(np.abs(z) - 1) < 1e-9):
        raise ValueError(f"z = {z} leaves the unit circle, where the response is; stay on it")
    turn = np.angle(z)[..., None] + 2 * np.pi * np.arange(-aliases, aliases + 1)
    sigma = 1j * turn / step
    speed = _speed_response(mill, sigma, "command") / _cut_alone(mill, sigma, torque)
    hold, memory = zdomain.phi1(-sigma * step), zdomain.phi1(-sigma * mill.pitch)
    return mill.force_slope * mill.pitch * np.sum(hold * memory * speed, axis=-1)


def is_stable(mill: FaceMill, torque: str = "memory") -> bool:
    """Whether drive and cut alone are stable, without repetitive control.

    The zeros of 1 minus the loop through drive and cut in the right half plane are counted along
    the imaginary axis, up to the 100th harmonic of the turn.
    Raises ValueError for another torque, and when a zero lies too close to the axis to tell.
    """
    _one_of(torque, (*TORQUES, "none"), "torque")
    turned = zdomain.turns_round_origin(
        lambda harmonic: _cut_alone(mill, 1j * harmonic, torque), 1e-6, 100.0, 2000
    )
    return round(2 * turned) == 0


def _cut_alone(mill: FaceMill, sigma: np.ndarray, torque: str) -> np.ndarray:
    """1 - (drive from torque to speed)(slope of the torque over the speed), without aliases."""
    memory = zdomain.phi1(-sigma * mill.pitch)
    slope = {"memory": mill.torque_slope * memory, "instantaneous": mill.torque_slope, "none": 0}
    return 1 - _speed_response(mill, sigma, "load") * slope[torque]


def _speed_response(mill: FaceMill, sigma: np.ndarray, source: str) -> np.ndarray:
    driven = spindle_drive.in_angle(spindle_drive.speed_driven(mill.drive), mill.speed)
    poles, residues = zdomain.modes(driven["speed", source])
    return sum(r / (sigma - p) for p, r in zip(poles, residues, strict=True))


class Controller(Protocol):
    """A sampled controller: causal numerator and denominator, polynomials in z^-1."""

    @property
    def numerator(self) -> np.ndarray: ...

    @property
    def denominator(self) -> np.ndarray: ...


@dataclass(frozen=True)
class Experiment:
    """One cut in simulation: the mill, its controller, and a reading of what the paper leaves open.

    The spindle turns freely at nominal speed before the turn `engaged` and the controller is idle
    before the turn `controlled`, both counted from 1.  Per sample the controller sees the nominal
    value minus what `measure` makes of the largest tooth force, or of the cutting torque:
    the value at the instant, or the largest over the last sampling interval or tooth pitch.
    Teeth that stand in the cut at engagement cut "at once", or each from its next entry on, "one by
    one".  `torque` computes the load with the memory of eq. 8 or from the speed of the instant.
    `keep_negative` lets a chip thickness below zero push.  The current limit acts on the current
    command, with the velocity integral running on ("clamp") or stopped ("hold") meanwhile.
    Raises ValueError for another word than these and numbers that are no whole ones.
    """

    mill: FaceMill
    controller: Controller | None = None
    controlled: int = 6
    engaged: int = 2
    turns: int = 16
    output: str = "force"
    measure: str = "sample"
    entry: str = "one by one"
    torque: str = "memory"
    keep_negative: bool = False
    limit: str = "clamp"
    substeps: int = 12  # steps of integration per sample
    inner: int = 1  # points of every step at which extremes of the current are looked for

    def __post_init__(self) -> None:
        for name in ("controlled", "engaged", "turns", "substeps", "inner"):
            object.__setattr__(self, name, whole_number(getattr(self, name), name))
        for name, allowed in (
            ("output", OUTPUTS),
            ("measure", MEASURES),
            ("entry", ENTRIES),
            ("torque", TORQUES),
            ("limit", LIMITS),
        ):
            _one_of(getattr(self, name), allowed, name)

    @property
    def steps_per_turn(self) -> int:
        """Steps of integration per turn of the cutter."""
        return self.mill.samples_per_turn * self.substeps

    @property
    def target(self) -> float:
        """Nominal value of the output, in N or N m, that the controller holds."""
        return self.mill.nominal_force if self.output == "force" else self.mill.nominal_torque


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


def tooth_forces(run: Run) -> np.ndarray:
    """Tangential force in N on every tooth at the end of every step, shape (n + 1, teeth)."""
    one = run.experiment
    cut, back = _cut([one]), one.mill.samples_per_pitch * one.substeps
    before = run.time[0] - np.arange(back, 0, -1) * 2 * np.pi / one.steps_per_turn / one.mill.speed
    elapsed = run.time - np.concatenate([before, run.time])[: run.time.size]
    forces = np.array(
        [cut.on_teeth(*cut.chips(2 * k, np.array([t])))[:, 0] for k, t in enumerate(elapsed)]
    )
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


def _side_by_side(group: list[Experiment]) -> list[Run]:
    """Runs that share drive and steps; the last axis of every array counts the runs."""
    mill, every = group[0].mill, group[0].substeps
    back, steps = mill.samples_per_pitch * every, group[0].turns * group[0].steps_per_turn
    angle = sampling_angle(mill) / every
    modes, cut, law = _modes(mill.drive), _cut(group), _law(group)
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
        seconds, after, extremes, limited = _turn(
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


class _Modes(NamedTuple):
    """The drive mode by mode, first axis: in control, limited, limited with the integral held."""

    poles: np.ndarray  # (3, 5)
    right: np.ndarray  # (3, 5, 5)
    left: np.ndarray  # (3, 5, 5)
    inputs: np.ndarray  # (3, 5, 3), of speed command, torque and the limited current command
    wanted: np.ndarray  # (5,), current command per state
    wanted_by_command: float  # current command per speed command
    limit: float  # V


def _modes(drive: SpindleDrive) -> _Modes:
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
    return _Modes(
        poles, right, left, left @ inputs, wanted, drive.velocity_gain, drive.command_limit
    )


def _turn(
    modes: _Modes,
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
    modes: _Modes, mode: int, state: np.ndarray, inputs: np.ndarray, angle: float, inner: int
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


class _Cut(NamedTuple):
    """What the teeth do, by half steps of the angle; per-run values on the last axis."""

    sines: np.ndarray  # (half steps per turn, teeth, 1)
    inside: np.ndarray  # (half steps per turn, teeth, 1), between entry and exit
    entered: np.ndarray  # (half steps per turn, teeth, 1), half steps since the last entry
    first: np.ndarray  # half step from which a tooth has to have entered, or the cutter to cut
    one_by_one: np.ndarray
    runout: np.ndarray  # (teeth, runs), m
    feed_speed: np.ndarray  # m/s
    pitch: float  # rad
    stiffness: np.ndarray  # N/m, force per chip thickness
    radius: np.ndarray  # m
    instantaneous: np.ndarray
    negative: np.ndarray

    def loads(self, half: int, elapsed: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, ...]:
        """Largest tooth force, torque, and teeth without a chip at a half step of the angle.

        At the end of a step the teeth are those that cut in its middle, so that a tooth which just
        leaves or enters belongs to one step only.
        """
        cutting, chips = self.chips(half, elapsed)
        force = self.on_teeth(cutting, chips)
        total = force.sum(axis=0)
        if self.instantaneous.any():
            now = self.on_teeth(*self.chips(half, self.pitch / speed))
            total = np.where(self.instantaneous, now.sum(axis=0), total)
        return force.max(axis=0), self.radius * total, np.sum(cutting & (chips <= 0), axis=0)

    def chips(self, half: int, elapsed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which teeth cut, and the chip thickness in m, after `elapsed` s for the last pitch."""
        at, held = half % len(self.sines), (half - 1 + half % 2) % len(self.sines)
        since = half - 1 + half % 2 - self.one_by_one * self.entered[held]
        cutting = self.inside[held] & (since > self.first - 0.5)
        return cutting, self.sines[at] * (self.feed_speed * elapsed) + self.runout

    def on_teeth(self, cutting: np.ndarray, chips: np.ndarray) -> np.ndarray:
        """Tangential force in N on every tooth."""
        return np.where(cutting & ((chips > 0) | self.negative), self.stiffness * chips, 0.0)


def _cut(group: list[Experiment]) -> _Cut:
    mill, halves = group[0].mill, 2 * group[0].steps_per_turn
    position = np.arange(halves)[:, None] - halves // mill.teeth * np.arange(mill.teeth)
    position = (position % halves)[:, :, None]
    angle = 2 * np.pi * position / halves
    entry, leave = (np.array([getattr(e.mill, name) for e in group]) for name in ("entry", "exit"))

    def each(take: Callable[[Experiment], float]) -> np.ndarray:
        return np.array([take(e) for e in group])

    return _Cut(
        sines=np.sin(angle),
        inside=(angle > entry) & (angle < leave),
        entered=position - entry * halves / (2 * np.pi),
        first=each(lambda e: (e.engaged - 1) * halves),
        one_by_one=each(lambda e: e.entry == "one by one"),
        runout=each(lambda e: e.mill.runout).T,
        feed_speed=each(lambda e: e.mill.feed_speed),
        pitch=mill.pitch,
        stiffness=each(lambda e: e.mill.cutting_coefficient * e.mill.depth),
        radius=each(lambda e: e.mill.diameter / 2),
        instantaneous=each(lambda e: e.torque == "instantaneous"),
        negative=each(lambda e: e.keep_negative),
    )


class _Law(NamedTuple):
    """The controllers side by side: coefficients (reach, runs), latest sample first."""

    numerator: np.ndarray
    denominator: np.ndarray  # of the samples before, sign reversed
    reach: int  # samples of memory
    first: np.ndarray  # sample from which the controller is at work
    target: np.ndarray
    base: np.ndarray  # V, command of the nominal speed
    row: np.ndarray  # of the log that is controlled
    window: np.ndarray  # 0 sample, 1 interval, 2 pitch
    holds: np.ndarray  # 1 where the velocity integral stops at the limit

    def measure(self, log: np.ndarray, every: int) -> np.ndarray:
        """What the controllers are shown, from the log of the last tooth pitch."""
        runs = np.arange(self.row.size)
        recent = (log[-1:], log[-every:], log)
        return np.choose(self.window, [part[:, self.row, runs].max(axis=0) for part in recent])

    def answer(self, error: np.ndarray, sent: np.ndarray, k: int) -> np.ndarray:
        """What the controllers add to the command at row k of errors and earlier answers."""
        errors = error[k - self.reach + 1 : k + 1][::-1]
        answers = sent[k - self.reach : k][::-1]
        return (self.numerator * errors).sum(axis=0) + (self.denominator * answers).sum(axis=0)


def _law(group: list[Experiment]) -> _Law:
    samples = group[0].mill.samples_per_turn
    numerators, denominators = [], []
    for one in group:
        n, d = (np.zeros(1), np.ones(1)) if one.controller is None else _fraction(one.controller)
        numerators.append(n / d[0])
        denominators.append(-d[1:] / d[0])
    reach = max(map(len, numerators + denominators))
    stacked = (
        np.array([np.pad(p, (0, reach - len(p))) for p in ps]).T
        for ps in (numerators, denominators)
    )
    return _Law(
        *stacked,
        reach,
        first=np.array([(one.controlled - 1) * samples for one in group]),
        target=np.array([one.target for one in group]),
        base=np.array([one.mill.drive.tacho_gain * one.mill.speed for one in group]),
        row=np.array([LOGGED.index(one.output) for one in group]),
        window=np.array([MEASURES.index(one.measure) for one in group]),
        holds=np.array([one.limit == "hold" for one in group], dtype=int),
    )


def _fraction(controller: Controller) -> tuple[np.ndarray, np.ndarray]:
    numerator = zdomain.polynomial(controller.numerator, "controller numerator")
    denominator = zdomain.polynomial(controller.denominator, "controller denominator")
    if denominator[0] == 0:
        raise ValueError(f"controller denominator {denominator} begins with 0; it is not causal")
    return numerator, denominator


def _one_of(value: str, allowed: tuple[str, ...], name: str) -> None:
    if value not in allowed:
        raise ValueError(f"{name} {value!r} is none of {', '.join(allowed)}")
