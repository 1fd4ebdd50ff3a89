"""Regenerative chatter of one mode, at a constant and at a sinusoidally varying spindle speed.

    m x'' + c x' + k x = K (h0 + x(one turn ago) - x),   x positive out of the cut

The grid is equally spaced in spindle ANGLE, so that the delay is always the same whole number of
steps and only the duration of the steps varies: a plant sampled at T(k), as everywhere in the case
study of Hanson and Tsao.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rcbook.zdomain import real_number, whole_number

RPM = 2 * np.pi / 60  # rad/s
_TINY = np.finfo(float).tiny
_LARGEST_EXPONENT = 300.0  # e^300 and its inverse are far from overflow
_CHECK_EVERY = 4  # Krylov steps between looks at the eigenvalue
_RATIO_ERROR = 1e-5  # how well rvf is met by a ratio of whole numbers of steps
_LONGEST = 2_000_000  # steps of one speed period that still fit into memory
_CHUNK = 20_000  # steps that are held at once, of all cuts of one batch together


# ---- the machine ----


@dataclass(frozen=True)
class Mode:
    """A vibration mode that rings: mass (kg), damping (N s/m) and stiffness (N/m).

    Raises ValueError when one is not positive or the mode is overdamped.
    """

    mass: float  # kg
    damping: float  # N s/m
    stiffness: float  # N/m

    def __post_init__(self) -> None:
        for field in fields(self):
            value = real_number(getattr(self, field.name), field.name, positive=True)
            object.__setattr__(self, field.name, value)
        if self.damping_ratio >= 1:
            raise ValueError(
                f"damping = {self.damping!r} makes a damping ratio of {self.damping_ratio:.4g}; "
                "choose less than 1, a mode that rings"
            )

    @property
    def natural_frequency(self) -> float:
        """Undamped natural frequency in rad/s."""
        return float(np.sqrt(self.stiffness / self.mass))

    @property
    def damping_ratio(self) -> float:
        """Damping over critical damping."""
        return float(self.damping / (2 * np.sqrt(self.mass * self.stiffness)))


@dataclass(frozen=True, eq=False)
class Cut:
    """A mode in a cut; every number but the mode may be an array, and they broadcast.

    The spindle speed is w0 [1 + rva sin(rvf w0 t)] for the law "time" (Hanson and Tsao, eq. 15),
    or w0 [1 + rva sin(rvf theta)] for the law "angle"; under both it repeats every 1/rvf turns.
    A negative rva shifts the variation by half of its period.
    Raises ValueError for numbers out of range, shapes that do not broadcast, an unknown law.
    """

    mode: Mode
    cutting_stiffness: ArrayLike  # K, N/m: cutting coefficient times width of cut
    speed: ArrayLike  # w0, rad/s
    rva: ArrayLike = 0.0  # amplitude of the speed over w0
    rvf: ArrayLike = 1.0  # frequency of the variation over that of the spindle
    law: str = "time"

    def __post_init__(self) -> None:
        numbers = [
            _array(self.cutting_stiffness, "cutting_stiffness", 0.0, np.inf),
            _array(self.speed, "speed", 0.0, np.inf),
            _array(self.rva, "rva", -1.0, 1.0),
            _array(self.rvf, "rvf", 0.0, np.inf),
        ]
        if self.law not in _LAWS:
            raise ValueError(f"law {self.law!r} is none of {', '.join(_LAWS)}")
        shapes = [number.shape for number in numbers]
        try:
            numbers = np.broadcast_arrays(*numbers)
        except ValueError:
            raise ValueError(
                f"shapes {shapes} of cutting_stiffness, speed, rva and rvf do not broadcast; "
                "make them agree"
            ) from None
        for name, number in zip(_NUMBERS, numbers, strict=True):
            object.__setattr__(self, name, number)

    @property
    def shape(self) -> tuple[int, ...]:
        """Common shape of the numbers; () for a single cut."""
        return self.speed.shape

    @property
    def mean_speed(self) -> np.ndarray:
        """Mean speed over time in rad/s: w0 for the law "time", less for the law "angle"."""
        return 2 * np.pi / self.rvf / _LAWS[self.law](self, 2 * np.pi / self.rvf)[0]

    def take(self, which: ArrayLike) -> Cut:
        """The cuts at these places of the flattened arrays, as one row."""
        return replace(self, **{name: getattr(self, name).ravel()[which] for name in _NUMBERS})


_NUMBERS = ("cutting_stiffness", "speed", "rva", "rvf")


def _array(value: ArrayLike, name: str, above: float, below: float) -> np.ndarray:
    array = np.asarray(value)
    if array.dtype.kind not in "iuf" or array.size == 0:
        raise ValueError(f"{name} = {value!r} must hold real numbers")
    array = array.astype(float)
    wrong = ~((array > above) & (array < below))
    if wrong.any():
        raise ValueError(f"{name} = {array[wrong][0]} must lie between {above:g} and {below:g}")
    array.setflags(write=False)
    return array


# ---- the spindle ----


def clock(cut: Cut, angle: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Time (s) and spindle speed (rad/s) at spindle angles (rad), shape cut.shape + angle.shape.

    At angle 0 the time is 0 and the speed is w0, rising for a positive rva.
    """
    angle = np.asarray(angle, dtype=float)
    if not np.all(np.isfinite(angle)):
        raise ValueError(f"angle = {angle} holds NaN or infinity; give finite angles")
    wide = (Ellipsis,) + (None,) * angle.ndim
    numbers = {name: getattr(cut, name)[wide] for name in _NUMBERS}
    return _LAWS[cut.law](replace(cut, **numbers), angle)


def _clock_of_time_law(cut: Cut, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # rvf theta = phi + rva (1 - cos phi) with phi = rvf w0 t is Kepler's equation E - e sin E = M
    # for E = phi + pi/2; from this start Newton's method converges for every e below 1.
    e, mean = cut.rva, cut.rvf * angle - cut.rva + np.pi / 2
    anomaly = mean + 0.85 * e * np.sign(np.sin(mean))
    for _ in range(30):
        step = (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
        anomaly -= step
        if np.max(np.abs(step), initial=0) < 1e-9:  # the next one would be the square of this
            break
    phase = anomaly - np.pi / 2
    return phase / (cut.rvf * cut.speed), cut.speed * (1 + e * np.sin(phase))


def _clock_of_angle_law(cut: Cut, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    # The integral of 1/(1 + rva sin psi) in the form that is continuous over many periods.
    phase, root = cut.rvf * angle, np.sqrt(1 - cut.rva**2)
    q = cut.rva / (1 + root)
    swing = np.arctan2(-q * np.cos(phase), 1 + q * np.sin(phase))
    integral = (phase - 2 * swing - 2 * np.arctan(q)) / root
    return integral / (cut.rvf * cut.speed), cut.speed * (1 + cut.rva * np.sin(phase))


_LAWS = {"time": _clock_of_time_law, "angle": _clock_of_angle_law}


# ---- exact results at constant speed ----


def least_limit(mode: Mode) -> float:
    """Cutting stiffness 2 k zeta (1 + zeta) in N/m below which no constant speed chatters."""
    return float(2 * mode.stiffness * mode.damping_ratio * (1 + mode.damping_ratio))


def lobes(mode: Mode, speed: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Exact limit of the cutting stiffness (N/m) at constant speeds (rad/s), and its frequency.

    With 1/G(j w) = P + j Q the limit is K = -1/(2 Re G) = -(P^2 + Q^2)/(2 P), and the phase
    w tau - 2 atan(P/Q), which grows with w, is a whole number of turns.
    The frequency of chatter is in rad/s.  Raises ValueError when a speed is not positive.
    """
    speed = _array(speed, "speed", 0.0, np.inf)
    natural, zeta = mode.natural_frequency, mode.damping_ratio
    delay = 2 * np.pi / speed
    # K falls up to this frequency and rises beyond it, so one of its two neighbours is lowest
    weakest = natural * np.sqrt(1 + 2 * zeta)
    turns = np.floor(_lobe_phase(mode, weakest, delay) / (2 * np.pi))
    least = np.floor(natural * delay / (2 * np.pi)) + 1
    candidates = [_lobe_frequency(mode, np.maximum(n, least), delay) for n in (turns, turns + 1)]
    limits = np.array([_lobe_limit(mode, frequency) for frequency in candidates])
    lower = np.argmin(limits, axis=0)
    return np.choose(lower, limits), np.choose(lower, candidates)


def _lobe_phase(mode: Mode, frequency: np.ndarray, delay: np.ndarray) -> np.ndarray:
    p = mode.stiffness - mode.mass * frequency**2
    return frequency * delay - 2 * np.arctan(p / (mode.damping * frequency))


def _lobe_limit(mode: Mode, frequency: np.ndarray) -> np.ndarray:
    p = mode.stiffness - mode.mass * frequency**2
    return -(p**2 + (mode.damping * frequency) ** 2) / (2 * p)


def _lobe_frequency(mode: Mode, turns: np.ndarray, delay: np.ndarray) -> np.ndarray:
    """The frequency above the natural one at which the phase is so many turns, by bisection."""
    low = np.full_like(delay, mode.natural_frequency)
    high = np.maximum(low, 2 * np.pi * turns / delay)
    for _ in range(60):
        middle = (low + high) / 2
        below = _lobe_phase(mode, middle, delay) < 2 * np.pi * turns
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return high


def rightmost_root(cut: Cut) -> np.ndarray:
    """Rightmost root s (1/s) of m s^2 + c s + k + K (1 - e^(-s tau)) = 0, tau = 2 pi/w0.

    Newton's method from two families of starts: whole numbers n of waves to a turn, in the form
    s tau = log(K/(m s^2 + c s + k + K)) + 2 pi j n, up to twice the frequency of the mode; and
    the free mode at stiffnesses from k to k + 2 K, which matters for weak cuts and short delays.
    Raises ValueError when the speed varies.
    """
    if np.any(cut.rva != 0):
        raise ValueError(f"rva = {cut.rva.ravel()}: only a constant speed has roots; set rva = 0")
    mode, k, tau = cut.mode, cut.cutting_stiffness[..., None], 2 * np.pi / cut.speed[..., None]
    highest = 2 * np.sqrt((mode.stiffness + cut.cutting_stiffness.max()) / mode.mass)
    n = np.arange(int(highest * tau.max() / (2 * np.pi)) + 3)
    wave = (1e-3 * mode.natural_frequency + 2j * np.pi * n / tau) * np.ones_like(k)
    free, _ = _modal(mode, k * np.linspace(0, 2, 9))
    free = np.concatenate([free, 1j * free.imag], axis=-1)
    with np.errstate(all="ignore"):  # starts that run away are dropped
        for _ in range(100):
            p, slope = _in_contact(mode, k, wave)
            wave = wave - (wave * tau - np.log(k / p) - 2j * np.pi * n) / (tau + slope / p)
            p, slope = _in_contact(mode, k, free)
            free = free - (p - k * np.exp(-free * tau)) / (slope + k * tau * np.exp(-free * tau))
        s = np.concatenate([wave, free], axis=-1)
        size = np.abs(_in_contact(mode, k, s)[0] - k * np.exp(-s * tau))
    exact = size < 1e-9 * (mode.stiffness + k)
    best = np.argmax(np.where(exact, s.real, -np.inf), axis=-1)
    root = np.take_along_axis(s, best[..., None], -1)[..., 0]
    return root.real + 1j * np.abs(root.imag)


def _in_contact(mode: Mode, k: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """m s^2 + c s + stiffness + k, and its slope."""
    rigid = mode.mass * s + mode.damping
    return rigid * s + mode.stiffness + k, rigid + mode.mass * s


# ---- the growth over one period of the speed ----


class Floquet(NamedTuple):
    """The dominant Floquet multiplier and what follows from it, each of the cut's shape."""

    multiplier: np.ndarray  # complex; of a conjugate pair the one with imaginary part >= 0
    turns: np.ndarray  # spindle turns that it spans: 1/rvf, or a multiple that makes one or more
    growth: np.ndarray  # 1/s: log|multiplier| over the time of these turns
    residual: np.ndarray  # of the eigenvalue iteration, relative to the multiplier


class _Period(NamedTuple):
    """One speed period of a batch of cuts: what each step adds, per unit of old and new surface."""

    per_turn: int
    block: int  # steps that are summed at once
    old: np.ndarray  # coefficients of y and its conjugate, one turn ago, at the start of a step
    old_conjugate: np.ndarray
    new: np.ndarray  # the same at its end
    new_conjugate: np.ndarray
    decay: np.ndarray  # free response from the start of the block to the end of a step


def floquet(cut: Cut, per_cycle: int = 10, tolerance: float = 1e-6, most: int = 60) -> Floquet:
    """Dominant multiplier of the cut over its speed period, by semi-discretisation.

    The surface of the last turn is a cubic in every step (value and slope at the nodes) and the
    response of the mode to it is exact, so errors fall with the fourth power of the step: with
    `per_cycle` steps per cycle of the mode, at the lowest speed, about 2/per_cycle^4 of the
    cutting stiffness.  The eigenvalue comes from at most `most` Arnoldi steps, fewer where the
    residual falls below `tolerance`.  The ratio rvf is held by whole numbers of steps, to 1e-5.
    Raises ValueError for fewer than 4 steps per cycle, a tolerance that is not positive, or a
    speed period too long for memory or for the range of floating-point numbers.
    """
    per_cycle = whole_number(per_cycle, "per_cycle", 4)
    most = whole_number(most, "most", 2)
    tolerance = real_number(tolerance, "tolerance", positive=True)
    multiplier = np.empty(cut.speed.size, dtype=complex)
    turns, growth, residual = np.empty((3, cut.speed.size))
    for places, per_turn, per_period in _batches(cut, per_cycle):
        batch = replace(cut.take(places), rvf=per_turn / per_period)
        repeats = -(-per_turn // per_period)
        period = _period(batch, per_turn, repeats * per_period)
        with np.errstate(over="ignore", invalid="ignore"):
            multiplier[places], residual[places] = _dominant(period, tolerance, most)
        turns[places] = repeats / batch.rvf
        time = 2 * np.pi * turns[places] / batch.mean_speed
        growth[places] = np.log(np.maximum(np.abs(multiplier[places]), _TINY)) / time
    return Floquet(*(a.reshape(cut.shape) for a in (multiplier, turns, growth, residual)))


def stability_limit(
    cut: Cut, highest: float = 20.0, ratio: float = 1.15, precision: float = 1e-3, **options: float
) -> np.ndarray:
    """Lowest cutting stiffness (N/m) at which each cut begins to chatter, whatever it has now.

    Searched upward in steps of `ratio` from 0.7 of the least limit at constant speed, or from
    where the cut is stable, up to `highest` times that limit, beyond which it is infinite; then
    bisected to a relative `precision`.  An instability narrower than a step of the search can be
    missed.  The options are those of `floquet`.
    Raises ValueError when `highest` or `ratio` is not above 1, or the precision is not positive.
    """
    precision = real_number(precision, "precision", positive=True)
    for name, value in (("highest", highest), ("ratio", ratio)):
        if real_number(value, name) <= 1:
            raise ValueError(f"{name} = {value!r} must be above 1")
    low, high = _bracket(cut, highest * least_limit(cut.mode), ratio, options)
    found = np.flatnonzero(np.isfinite(high))
    for _ in range(int(np.ceil(np.log2(max(1.0, np.log(ratio) / precision))))):
        middle = np.sqrt(low[found] * high[found])
        chatters = _grows(cut, found, middle, options)
        high[found[chatters]] = middle[chatters]
        low[found[~chatters]] = middle[~chatters]
    return np.sqrt(low * high).reshape(cut.shape)


def _bracket(
    cut: Cut, highest: float, ratio: float, options: dict
) -> tuple[np.ndarray, np.ndarray]:
    """A stiffness without and one with chatter for each cut, neighbours in a search upward."""
    cuts, start = cut.speed.size, 0.7 * least_limit(cut.mode)
    low, high = np.full(cuts, start), np.full(cuts, np.inf)
    unsafe = np.arange(cuts)
    while unsafe.size:  # ends, because a cut without stiffness only decays
        unsafe = unsafe[_grows(cut, unsafe, low[unsafe], options)]
        low[unsafe] /= ratio
    searching = np.arange(cuts)
    while searching.size:
        trial = low[searching] * ratio
        chatters = _grows(cut, searching, trial, options)
        high[searching[chatters]] = trial[chatters]
        low[searching[~chatters]] = trial[~chatters]
        searching = searching[~chatters & (trial < highest)]
    return low, high


def _grows(cut: Cut, places: np.ndarray, stiffness: np.ndarray, options: dict) -> np.ndarray:
    if not places.size:
        return np.zeros(0, dtype=bool)
    return floquet(replace(cut.take(places), cutting_stiffness=stiffness), **options).growth > 0


def _steps_needed(cut: Cut, per_cycle: int) -> np.ndarray:
    """Steps per turn that make `per_cycle` steps of a cycle in contact at the lowest speed."""
    frequency = np.sqrt((cut.mode.stiffness + cut.cutting_stiffness) / cut.mode.mass)
    cycles = frequency / (cut.speed * (1 - np.abs(cut.rva)))
    return np.ceil(per_cycle * np.maximum(cycles, np.maximum(2, 2 * cut.rvf)))


def _batches(cut: Cut, per_cycle: int) -> Iterator[tuple[np.ndarray, int, int]]:
    """Places of cuts that share a grid, with its steps per turn and per speed period."""
    needed, rvf = _steps_needed(cut, per_cycle).ravel(), cut.rvf.ravel()
    for ratio in np.unique(rvf):
        places = np.flatnonzero(rvf == ratio)
        places = places[np.argsort(-needed[places], kind="stable")]
        while places.size:
            per_turn, per_period = _grid(ratio, int(needed[places[0]]))
            if max(per_turn, per_period) > _LONGEST:
                raise ValueError(
                    f"speed = {cut.speed.ravel()[places[0]]:.4g} rad/s with rvf = {ratio:.4g} "
                    f"needs {max(per_turn, per_period)} steps a period; choose a higher one"
                )
            most = max(1, _CHUNK // max(per_turn, per_period))
            yield places[:most], per_turn, per_period
            places = places[most:]


def _grid(rvf: float, least: int) -> tuple[int, int]:
    """Whole numbers of steps per turn, `least` or somewhat more, and per speed period."""
    per_turn = np.arange(least, least + least // 4 + 1)
    per_period = np.rint(per_turn / rvf)
    error = np.abs(per_period * rvf / per_turn - 1)
    best = np.argmax(error <= max(_RATIO_ERROR, error.min()))  # the first that is good enough
    return int(per_turn[best]), int(per_period[best])


def _period(cut: Cut, per_turn: int, steps: int) -> _Period:
    """The steps of one period; y' = s y + force and x = Im y/(m w_d) carry the mode in contact."""
    root, gain = _modal(cut.mode, cut.cutting_stiffness)
    time, speed = clock(cut, 2 * np.pi / per_turn * np.arange(steps + 1))
    dt = np.diff(time, axis=-1)
    values = _cubic_integrals(root[:, None] * dt)
    # the old surface was cut at another speed: its slope in time is rescaled
    scale = speed / speed[:, (np.arange(steps + 1) - per_turn) % steps]
    slope, last = scale * root[:, None], (cut.cutting_stiffness * gain)[:, None] * dt / 2j
    block = max(1, min(per_turn, int(_LARGEST_EXPONENT / np.max(-root.real[:, None] * dt))))
    in_block = time[:, 1:] - time[:, :-1][:, np.arange(steps) // block * block]
    decay = np.exp(root[:, None] * in_block)
    unit = last / decay
    return _Period(
        per_turn,
        block,
        unit * (values[0] + values[1] * dt * slope[:, :-1]),
        -unit * (values[0] + values[1] * dt * slope[:, :-1].conj()),
        unit * (values[2] + values[3] * dt * slope[:, 1:]),
        -unit * (values[2] + values[3] * dt * slope[:, 1:].conj()),
        decay,
    )


def _modal(mode: Mode, contact: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Root s in the upper half plane of m s^2 + c s + k + contact, and 1/(m Im s)."""
    decay = mode.damping / (2 * mode.mass)
    ringing = np.sqrt((mode.stiffness + np.asarray(contact)) / mode.mass - decay**2)
    return -decay + 1j * ringing, 1 / (mode.mass * ringing)


def _cubic_integrals(z: np.ndarray) -> tuple[np.ndarray, ...]:
    """Integrals over w from 0 to 1 of e^(z (1 - w)) times the four Hermite cubics in w.

    They belong to value and slope at w = 0, then value and slope at w = 1.
    """
    phi = [np.exp(z)]
    for factorial in (1, 1, 2, 6):
        phi.append((phi[-1] - 1 / factorial) / z)
    one, w, w2, w3 = phi[1], phi[2], 2 * phi[3], 6 * phi[4]
    return one - 3 * w2 + 2 * w3, w - 2 * w2 + w3, 3 * w2 - 2 * w3, w3 - w2


def _advance(period: _Period, history: np.ndarray) -> np.ndarray:
    """The last turn of y, shape (cuts, per_turn + 1), one period later."""
    turn, steps = period.per_turn, period.decay.shape[1]
    y = np.empty((len(history), turn + 1 + steps), dtype=complex)
    y[:, : turn + 1] = history
    for a in range(0, steps, period.block):
        b = min(a + period.block, steps)
        past, span = y[:, a : b + 1], slice(a, b)
        back = past.conj()
        added = period.old[:, span] * past[:, :-1]
        added += period.old_conjugate[:, span] * back[:, :-1]
        added += period.new[:, span] * past[:, 1:]
        added += period.new_conjugate[:, span] * back[:, 1:]
        np.cumsum(added, axis=1, out=added)
        added += y[:, turn + a, None]
        np.multiply(added, period.decay[:, span], out=y[:, turn + a + 1 : turn + b + 1])
    return y[:, steps:]


def _dominant(period: _Period, tolerance: float, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Dominant eigenvalue of the period map and its relative residual, by Arnoldi's method."""
    cuts, n = len(period.decay), 2 * (period.per_turn + 1)
    basis, projected = np.empty((cuts, most + 1, n)), np.zeros((cuts, most + 1, most))
    basis[:, 0] = np.random.default_rng(1).standard_normal(n)
    basis[:, 0] /= np.linalg.norm(basis[:, 0], axis=-1, keepdims=True)
    for k in range(most):
        now = np.ascontiguousarray(basis[:, k]).view(complex)
        image = np.ascontiguousarray(_advance(period, now)).view(float)
        known = basis[:, : k + 1]
        for _ in range(2):  # twice is enough to keep the basis orthogonal
            parts = known @ image[:, :, None]
            image = image - (parts.transpose(0, 2, 1) @ known)[:, 0]
            projected[:, : k + 1, k] += parts[:, :, 0]
        size = np.linalg.norm(image, axis=-1)
        if not np.all(np.isfinite(size)):
            raise ValueError("chatter outgrows all numbers in one period; choose a larger rvf")
        projected[:, k + 1, k] = size
        basis[:, k + 1] = image / np.maximum(size, _TINY)[:, None]
        if (k + 1) % _CHECK_EVERY == 0 or k + 1 == most:
            value, residual = _ritz(projected[:, : k + 2, : k + 1])
            if residual.max() < tolerance:
                break
    return value, residual


def _ritz(projected: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    values, vectors = np.linalg.eig(projected[:, :-1])
    values = values.astype(complex)
    best = np.argmax(np.abs(values), axis=1)[:, None]
    value = np.take_along_axis(values, best, 1)[:, 0]
    last = np.take_along_axis(np.abs(vectors[:, -1]), best, 1)[:, 0]
    residual = projected[:, -1, -1] * last / np.maximum(np.abs(value), _TINY)
    return value.real + 1j * np.abs(value.imag), residual


# ---- simulation with loss of contact ----


@dataclass(frozen=True, eq=False)
class Run:
    """A simulated cut at equally spaced spindle angles; arrays of shape cut.shape + (samples,)."""

    cut: Cut
    per_turn: int  # steps per turn
    angle: np.ndarray  # rad, shape (samples,)
    time: np.ndarray  # s
    displacement: np.ndarray  # m, out of the cut
    velocity: np.ndarray  # m/s
    force: np.ndarray  # N, never negative
    surface: np.ndarray  # m, what this and all earlier passes left, from the tool's nominal path

    @property
    def in_contact(self) -> np.ndarray:
        """Whether the tool cuts."""
        return self.force > 0

    def vibration(self, turns: float) -> np.ndarray:
        """Rms of the displacement about its mean over the last turns, in m, shape cut.shape.

        Raises ValueError when the run is not that long.
        """
        samples = round(real_number(turns, "turns", positive=True) * self.per_turn)
        if not 0 < samples <= self.angle.size:
            raise ValueError(f"turns = {turns!r} are not in the record; simulate longer")
        return np.std(self.displacement[..., -samples:], axis=-1)


def simulate(
    cut: Cut,
    turns: float,
    chip: float,
    kick: float = 0.0,
    disturbance: Callable[[np.ndarray], np.ndarray] | None = None,
    per_cycle: int = 40,
) -> Run:
    """Cut for some turns, from the steady cut, out of which a blow drives the tool at `kick` (m/s).

    The force is K times the thickness of the chip: `chip` (m) plus the surface that is left, minus
    the position of the tool.  In the air it is 0, and the old surface stays, farther by one `chip`
    at the next pass.  `disturbance` is a further force (N) as a function of the time (s).
    The force is a straight line in every step and the response of the mode to it is exact, so
    errors fall with the square of the step, about 3/per_cycle^2 of the force.
    Raises ValueError for turns or a chip that are not positive, fewer than 8 steps per cycle, or
    a disturbance that is not finite or not of the shape of its argument.
    """
    turns = real_number(turns, "turns", positive=True)
    chip = real_number(chip, "chip", positive=True)
    needed = _steps_needed(cut, whole_number(per_cycle, "per_cycle", 8))
    per_turn = int(needed.max())
    angle = 2 * np.pi / per_turn * np.arange(int(np.ceil(turns * per_turn)) + 1)
    time, _ = clock(cut, angle)
    # samples first: every step of the march then reads one contiguous row
    rows = np.moveaxis(time.reshape(-1, angle.size), -1, 0)
    forced = np.zeros_like(rows) if disturbance is None else _samples(disturbance, rows)
    march = _march(cut, rows, forced, (chip, real_number(kick, "kick")), per_turn)
    shaped = (np.moveaxis(row, 0, -1).reshape(time.shape) for row in march)
    return Run(cut, per_turn, angle, time, *shaped)


def _samples(disturbance: Callable[[np.ndarray], np.ndarray], time: np.ndarray) -> np.ndarray:
    forced = np.asarray(disturbance(time), dtype=float)
    if forced.shape != time.shape or not np.all(np.isfinite(forced)):
        raise ValueError(
            f"disturbance has shape {forced.shape} for times of shape {time.shape}, or holds NaN "
            "or infinity; give a function of the time that answers sample by sample"
        )
    return forced


def _march(
    cut: Cut, time: np.ndarray, forced: np.ndarray, start: tuple[float, float], per_turn: int
) -> tuple[np.ndarray, ...]:
    """Displacement, velocity, cutting force and surface, each of the shape of `time`."""
    (chip, kick), stiffness = start, cut.cutting_stiffness.ravel()
    root, gain = _modal(cut.mode, 0.0)
    dt = np.diff(time, axis=0)
    free, early, late = _ramp_response(root * dt)
    early, late = early * dt, late * dt
    give = 1 + stiffness * gain * late.imag  # the tool yields to the force of the same instant
    steady = stiffness * chip / cut.mode.stiffness
    x, v, force = np.zeros((3, *time.shape))
    left = np.zeros((per_turn + len(time), time.shape[1]))  # from one turn before the start
    left[: per_turn + 1], x[0], v[0], force[0] = steady, steady, kick, stiffness * chip
    y = (kick - x[0] * root.real) / (gain * root.imag) + 1j * x[0] / gain
    for j in range(len(dt)):
        y = free[j] * y + early[j] * (force[j] + forced[j]) + late[j] * forced[j + 1]
        ahead = left[j + 1] + chip
        force[j + 1] = np.maximum(0, stiffness * (ahead - gain * y.imag) / give[j])
        y += late[j] * force[j + 1]
        x[j + 1], v[j + 1] = gain * y.imag, gain * (root * y).imag
        left[per_turn + j + 1] = np.minimum(ahead, x[j + 1])
    return x, v, force, left[per_turn:]


def _ramp_response(z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """e^z, and the integrals over w from 0 to 1 of e^(z (1 - w)) times 1 - w and times w."""
    free = np.exp(z)
    constant = (free - 1) / z
    late = (constant - 1) / z
    return free, constant - late, late


def noise(
    rms: float, lowest: float, highest: float, rng: np.random.Generator, lines: int = 300
) -> Callable[[np.ndarray], np.ndarray]:
    """A random force (N) as a function of time: lines of equal size between two frequencies in Hz.

    It is the same force whatever the step.  Raises ValueError for a band that is not one.
    """
    lowest, highest = real_number(lowest, "lowest", True), real_number(highest, "highest", True)
    if lowest >= highest:
        raise ValueError(f"lowest = {lowest!r} must lie below highest = {highest!r}")
    lines = whole_number(lines, "lines")
    frequency = 2 * np.pi * rng.uniform(lowest, highest, lines)
    phase = rng.uniform(0, 2 * np.pi, lines)
    size = real_number(rms, "rms", positive=True) * np.sqrt(2 / lines)

    def force(time: np.ndarray) -> np.ndarray:
        total = np.zeros(np.shape(time))
        for f, p in zip(frequency, phase, strict=True):
            total += np.sin(f * time + p)
        return size * total

    return force


HANSON_TSAO2000 = Cut(
    mode=Mode(mass=0.365, damping=208.0, stiffness=12.8e6),  # eq. 17
    cutting_stiffness=1.5e6,  # ours: the paper has none, only that constant speed just chatters
    speed=1000 * RPM,
    rva=0.2,
    rvf=0.2,
)
FEED = 0.1e-3  # m per turn: the chip thickness, if the tool is pushed along the feed
