"""Learning from pass to pass: the error of one pass, filtered, corrects the command of the next.

    u_(L+1) = q (u_L + H e_L),    e_L = r - y_L,    y_L = G u_L,    u_0 = r

G is the plant, H the law (a noncausal filter, its gain included), q a symmetric filter.  The law
is designed on one plant and the passes run on another, so mismatch is one argument; a first
command u_0 other than the reference is another.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.signal
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.signals import signal
from rcbook.zdomain import NoncausalFilter, Plant, add, multiply, shift


@dataclass(frozen=True, eq=False)
class LearningLaw:
    """A noncausal filter H from error to correction, and a symmetric filter q on the command.

    Raises ValueError when q is not symmetric.
    """

    filter: NoncausalFilter
    q: np.ndarray = field(default_factory=lambda: np.ones(1))

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", zdomain.odd_symmetric(self.q))

    @property
    def look_ahead(self) -> int:
        """Samples of error beyond k that the new command at k needs."""
        return self.filter.advance + self.q.size // 2

    @property
    def poles(self) -> np.ndarray:
        """Poles of the law's own recursion, by decreasing magnitude."""
        roots = np.roots(np.trim_zeros(self.filter.a, "b"))
        return roots[np.argsort(-np.abs(roots), kind="stable")]


@dataclass(frozen=True)
class Start:
    """What a pass sees before its first sample and what the look-ahead sees after its last.

    before: "itself" (the pass has repeated for ever), "previous" (one continuous run) or "rest"
    (plant held at a constant, no earlier error).  after: "itself" (the errors from the beginning
    of the pass), "next" (those of the next pass), "on" (the plant run on with the beginning of
    the command) or "nothing" (zero).  For q, a pass from rest holds its first command before it
    and, with "nothing", its last one after it.

    The look-ahead makes a law that recurs begin with corrections of samples before the first one;
    they are never applied.  `forgets` says that its recursion starts with zeros instead of them.
    """

    before: str
    after: str
    forgets: bool = False

    def __post_init__(self) -> None:
        allowed = {
            "itself": ("itself",),
            "previous": ("next",),
            "rest": ("itself", "on", "nothing"),
        }
        if self.after not in allowed.get(self.before, ()):
            pairs = "; ".join(f"{b} with {' or '.join(a)}" for b, a in allowed.items())
            raise ValueError(f"before {self.before!r}, after {self.after!r}: choose {pairs}")
        if self.forgets and self.before == "itself":
            raise ValueError("a pass that has repeated for ever forgets nothing; start otherwise")


PERIODIC = Start("itself", "itself")
CONTINUOUS = Start("previous", "next")
RESET = Start("rest", "nothing")


@dataclass(frozen=True, eq=False)
class Passes:
    """Signals of passes 0, 1, ..: one row per pass, one column per sample, units of the plant."""

    dt: float  # s
    reference: np.ndarray  # one row for all passes
    command: np.ndarray
    output: np.ndarray
    error: np.ndarray  # reference minus output, without measurement noise

    @property
    def time(self) -> np.ndarray:
        """Sampling instants of one pass in s."""
        return self.dt * np.arange(self.reference.size)

    @property
    def largest_error(self) -> np.ndarray:
        """Largest magnitude of the error in each pass."""
        return np.abs(self.error).max(axis=1)


def learn(
    plant: Plant,
    law: LearningLaw,
    reference: ArrayLike,
    passes: int,
    start: Start = PERIODIC,
    rest: float = 0.0,
    noise: ArrayLike | None = None,
    first: ArrayLike | None = None,
) -> Passes:
    """Run pass 0, with the command `first` (the reference), and then `passes` learned ones.

    `rest` is the constant that command and output have had before a start from rest, or before
    the first pass of a continuous run.  `noise`, (passes + 1, samples), is added to the output as
    the law sees it.
    Source: Lee, Oh and Kim, eqs 2-5 and 18.
    Raises ValueError when the law looks ahead as far as the pass is long, when the reference is
    shorter than the plant's filters, when the plant is not stable, when passes are to repeat for
    ever under a law that is not, and for noise or a first command of another shape or not finite.
    """
    if not isinstance(start, Start):
        raise ValueError(f"start = {start!r}: give PERIODIC, CONTINUOUS, RESET or another Start")
    reference = signal(reference, "reference")
    passes = zdomain.whole_number(passes, "passes", 0)
    _require_fit(plant, law, reference.size)
    if start.before == "itself":
        _require_repeating(law)
    noise = _noise(noise, (passes + 1, reference.size))
    first = reference if first is None else signal(first, "first", reference.size)
    rest = zdomain.real_number(rest, "rest")
    run = _run_on if start.before == "previous" else _run_apart
    command, output = run(plant, law, reference, first, noise, start, rest)
    return Passes(plant.dt, reference, command, output, reference - output)


def track(plant: Plant, law: LearningLaw, reference: ArrayLike) -> Passes:
    """Feedforward instead of learning: one pass, repeated for ever, with the command H r.

    Under a zero-phase law this is zero-phase control: y = G H r (Lee, Oh and Kim, eq. 19).
    Raises ValueError as `learn` does.
    """
    reference = signal(reference, "reference")
    _require_fit(plant, law, reference.size)
    _require_repeating(law)
    command = _circular(law.filter, reference)
    output = _circular(plant, command)
    return Passes(plant.dt, reference, command[None], output[None], (reference - output)[None])


def _noise(noise: ArrayLike | None, shape: tuple[int, int]) -> np.ndarray:
    if noise is None:
        return np.zeros(shape)
    if np.shape(noise) != shape:
        raise ValueError(f"noise has shape {np.shape(noise)}; give one row per pass: {shape}")
    return signal(np.ravel(noise), "noise").reshape(shape)


def _require_repeating(law: LearningLaw) -> None:
    if not np.all(np.abs(law.poles) < 1):
        raise ValueError(f"the law has poles {law.poles} and no pass repeats; start otherwise")


def _require_fit(plant: Plant, law: LearningLaw, samples: int) -> None:
    if law.look_ahead >= samples:
        raise ValueError(
            f"the law looks {law.look_ahead} samples ahead and a pass has {samples}; "
            "sample faster, or shorten the law"
        )
    longest = max(plant.numerator.size, plant.a.size)
    if samples < longest:
        raise ValueError(
            f"the reference has {samples} samples and the plant reaches back {longest}; "
            "give a longer pass"
        )
    if not plant.is_stable:
        raise ValueError(f"the plant has poles {plant.poles}; close a loop round it first")


def _run_apart(plant, law, reference, first, noise, start, rest):
    """Passes that do not hand a state on: repeated for ever, or begun at rest."""
    command, output = np.empty(noise.shape), np.empty(noise.shape)
    u = first
    for i, disturbed in enumerate(noise):
        command[i], output[i] = u, _answer(plant, u, start, rest)[: u.size]
        error = reference - output[i] - disturbed
        u = _corrected(law, u, _beyond(plant, law, error, u, reference, start, rest), start)
    return command, output


def _answer(plant: Plant, u: np.ndarray, start: Start, rest: float) -> np.ndarray:
    if start.before == "itself":
        return _circular(plant, u)
    b = plant.numerator
    state = scipy.signal.lfiltic(b, plant.a, np.full(plant.a.size, rest), np.full(b.size, rest))
    return scipy.signal.lfilter(b, plant.a, u, zi=state)[0]


def _circular(filter: Plant | NoncausalFilter, x: np.ndarray) -> np.ndarray:
    gain = zdomain.response(filter, zdomain.unit_circle(x.size))
    return np.fft.ifft(gain * np.fft.fft(x)).real


def _beyond(plant, law, error, u, reference, start, rest) -> np.ndarray:
    """The error of a pass, and behind it what the look-ahead sees."""
    ahead = law.look_ahead
    if start.after == "on":
        longer = _answer(plant, np.append(u, u[:ahead]), start, rest)
        return np.append(error, (reference[:ahead] - longer[u.size :]))
    return np.append(error, error[:ahead] if start.after == "itself" else np.zeros(ahead))


def _corrected(law: LearningLaw, u: np.ndarray, error: np.ndarray, start: Start) -> np.ndarray:
    """q (u + H e), where `error` is longer than u by the look-ahead."""
    half, n = law.q.size // 2, u.size
    if start.before == "itself":
        moved = u + _circular(law.filter, error[:n])
        return _circular(NoncausalFilter(law.q, [1.0], half), moved)
    correction = _correction(law, error, start)
    beyond = u[:half] if start.after != "nothing" else u[-1:].repeat(half)
    moved = np.append(u, beyond) + correction[: n + half]
    return np.convolve(np.append(u[:1].repeat(half), moved), law.q, "valid")


def _correction(law: LearningLaw, error: np.ndarray, start: Start) -> np.ndarray:
    """H e from sample 0 on, for an error that was zero before; shorter than it by the advance."""
    ahead = law.filter.advance
    begin = ahead if start.forgets else 0
    driven = scipy.signal.lfilter(law.filter.b, [1.0], error)[begin:]
    return scipy.signal.lfilter([1.0], law.filter.a, driven)[ahead - begin :]


def _run_on(plant, law, reference, first, noise, start, rest):
    """One continuous run: every pass begins in the state in which the last one ended.

    Pass 0 is commanded by `first`, all of it.  Before the run there was no error and nothing was
    corrected; what a filter q sees there is the end of `first`.
    """
    n, noise = reference.size, noise.ravel()
    block, half = n - law.look_ahead, law.q.size // 2
    b = plant.numerator
    state = scipy.signal.lfiltic(b, plant.a, np.full(plant.a.size, rest), np.full(b.size, rest))
    u, y = np.resize(first, (2, noise.size))
    wanted = np.resize(reference, noise.size)
    moved = np.append(first[n - half :], u)  # u + H e, from `half` samples before the run on
    for at in range(0, noise.size, block):
        now = slice(at, min(at + block, noise.size))
        if now.stop > n:
            near = moved[max(at - n, 0) : now.stop - n + 2 * half]
            u[max(at, n) : now.stop] = np.convolve(near, law.q, "valid")
        y[now], state = scipy.signal.lfilter(b, plant.a, u[now], zi=state)
        if now.stop > law.filter.advance:
            correction = _correction(law, (wanted - y - noise)[: now.stop], start)
            moved[half : half + correction.size] = u[: correction.size] + correction
    return u.reshape(-1, n), y.reshape(-1, n)


def error_factor(plant: Plant, law: LearningLaw, z: ArrayLike) -> np.ndarray:
    """q (1 - G H) at points z of the unit circle: one learning scales the way to the limit by it.

    Source: Lee, Oh and Kim, eq. 6.
    """
    q = zdomain.zero_phase_gain(law.q, z)
    return q * (1 - zdomain.response(plant, z) * zdomain.response(law.filter, z))


def contraction(plant: Plant, law: LearningLaw, points: int = 4096) -> float:
    """Largest |q (1 - G H)| over the unit circle; below one is sufficient for a stable law.

    Source: Lee, Oh and Kim, eq. 8.
    """
    points = zdomain.whole_number(points, "points")
    half = zdomain.unit_circle(2 * points)[: points + 1]
    return float(np.abs(error_factor(plant, law, half)).max())


def harmonic_contraction(plant: Plant, law: LearningLaw, period: int) -> np.ndarray:
    """|q (1 - G H)| at the harmonics 0 .. period/2, on which alone a periodic pass depends."""
    harmonics = zdomain.unit_circle(zdomain.whole_number(period, "period"))
    return np.abs(error_factor(plant, law, harmonics[: harmonics.size // 2 + 1]))


def characteristic_polynomial(plant: Plant, law: LearningLaw, period: int) -> np.ndarray:
    """Exact polynomial in z^-1 of learning that runs on continuously with `period` samples.

    Raises ValueError when the law looks ahead further than the period.
    """
    delay = zdomain.whole_number(period, "period") - law.look_ahead
    if delay < 0 or period == law.q.size // 2:
        raise ValueError(
            f"the law looks {law.look_ahead} samples ahead and its memory needs one of its own, "
            f"more than the period of {period} holds; lengthen the period"
        )
    memory = add(np.ones(1), -shift(law.q, period - law.q.size // 2))
    correction = shift(multiply(law.q, law.filter.b, plant.numerator), delay)
    return add(multiply(plant.a, law.filter.a, memory), correction)


def spectral_radius(plant: Plant, law: LearningLaw, period: int) -> float:
    """Largest root of the running scheme: below one is necessary and sufficient for stability."""
    polynomial = np.trim_zeros(characteristic_polynomial(plant, law, period), "b")
    return float(np.abs(np.roots(polynomial)).max(initial=0.0))


def noise_gain(plant: Plant, law: LearningLaw, period: int, passes: int) -> float:
    """Standard deviation of the error in pass `passes` per unit of white measurement noise.

    Each pass repeats for ever and has noise of its own, so the variance is a sum of powers of
    |q (1 - G H)|^2 at every harmonic; only what reaches the true output counts.
    """
    z = zdomain.unit_circle(zdomain.whole_number(period, "period"))
    square = np.abs(error_factor(plant, law, z)) ** 2
    once = zdomain.zero_phase_gain(law.q, z) * zdomain.response(law.filter, z)
    sums = sum(square**i for i in range(zdomain.whole_number(passes, "passes", 0)))
    return float(np.sqrt(np.mean(np.abs(zdomain.response(plant, z) * once) ** 2 * sums)))


def zero_phase_law(
    plant: Plant, gain: float = 1.0, normalisation: str = "dc", q: ArrayLike = (1.0,)
) -> LearningLaw:
    """Law that inverts poles and stable zeros and reflects the others (Lee, Oh and Kim, eq. 11)."""
    gain = zdomain.real_number(gain, "gain")
    inverse = zdomain.zero_phase_inverse(plant, normalisation=normalisation)
    return LearningLaw(NoncausalFilter(gain * inverse.b, inverse.a, inverse.advance), q)


def p_type_law(gain: float, advance: int, q: ArrayLike = (1.0,)) -> LearningLaw:
    """Law that sends the error `advance` samples back, times a gain."""
    return LearningLaw(NoncausalFilter([zdomain.real_number(gain, "gain")], [1.0], advance), q)


def norm_optimal_law(plant: Plant, weight: float, period: int) -> LearningLaw:
    """Law conj(G)/(|G|^2 + weight) on the harmonics of a period, as a symmetric span of taps.

    It minimises |e|^2 + weight |change of command|^2 from one pass to the next; `weight`, not
    negative, is in the plant's units squared.  The taps repeat with the period, so the law holds
    for passes that repeat for ever.
    """
    weight, period = zdomain.real_number(weight, "weight"), zdomain.whole_number(period, "period")
    if weight < 0:
        raise ValueError(f"weight = {weight!r} must not be negative")
    gain = zdomain.response(plant, zdomain.unit_circle(period))
    cost = np.abs(gain) ** 2 + weight
    if not np.all(cost > 1e-24 * np.abs(gain).max() ** 2):
        raise ValueError(f"weight = {weight!r}: the plant stops a harmonic; give a larger one")
    taps = np.fft.ifft(np.conj(gain) / cost).real
    half = (period - 1) // 2
    return LearningLaw(NoncausalFilter(np.roll(taps, half), [1.0], half))
