"""Passes: what a scheme does, pass by pass, and what becomes of it in the end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # its signal is loaded when asked for, and takes half a second
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.loops.learning.scheme import Scheme, circular, one_pass, require_repeating, resting
from rcbook.loops.run import BOUND, FREE, Limits
from rcbook.signals import signal


@dataclass(frozen=True, eq=False)
class Passes:
    """Signals of passes 0, 1, ..: one row per pass, one column per sample, units of the plant.

    The record ends before the pass in which a signal exceeds 1e30 times the largest input, and is
    `unbounded` then.
    """

    dt: float  # s
    reference: np.ndarray  # one row for all passes
    disturbance: np.ndarray  # at the plant input
    noise: np.ndarray  # on the measured output
    command: np.ndarray  # what the plant gets, without the disturbance
    output: np.ndarray
    unbounded: bool = False
    command_clipped: int = 0  # samples at which the limit on the command acted

    @property
    def time(self) -> np.ndarray:
        """Sampling instants of one pass in s."""
        return self.dt * np.arange(self.reference.size)

    @property
    def error(self) -> np.ndarray:
        """Reference minus output, without measurement noise."""
        return self.reference - self.output

    @property
    def measured_error(self) -> np.ndarray:
        """Reference minus measured output: what the law sees."""
        return self.error - self.noise

    @property
    def largest_error(self) -> np.ndarray:
        """Largest magnitude of the error in each pass."""
        return np.abs(self.error).max(axis=1)


def simulate(
    scheme: Scheme,
    reference: ArrayLike,
    *,
    passes: int,
    first: ArrayLike | None = None,
    rest: float = 0.0,
    disturbance: ArrayLike | None = None,
    noise: ArrayLike | None = None,
    limits: Limits = FREE,
) -> Passes:
    """Run pass 0, with the command `first` (the reference), and then `passes` learned ones.

    `rest` is the constant that command and output have had before a start from rest, or before
    the first pass of a continuous run.  `disturbance` is one row for all passes or one a pass,
    `noise` one row a pass, (passes + 1, period).  What follows from a limited command is learned
    from the clipped one or from what was wanted, as the limit says.
    Source: Lee, Oh and Kim, eqs 2-5 and 18.
    Raises ValueError for signals that do not fit the pass or are not finite, and for a limit on
    the repetitive signal.
    """
    n, rows = scheme.period, zdomain.whole_number(passes, "passes", 0) + 1
    r = signal(reference, "reference", n)
    first = r if first is None else signal(first, "first", n)
    rest = zdomain.real_number(rest, "rest")
    if disturbance is not None and np.ndim(disturbance) == 1:
        disturbance = np.tile(signal(disturbance, "disturbance", n), (rows, 1))
    w, noise = _rows(disturbance, "disturbance", (rows, n)), _rows(noise, "noise", (rows, n))
    if np.isfinite(limits.repetitive.value):
        raise ValueError("a scheme sends nothing but its command; set limits.command instead")
    run = run_on if scheme.start.before == "previous" else _run_apart
    bound = BOUND * max(abs(rest), *(np.abs(s).max() for s in (r, first, w, noise)))
    wanted, output = run(scheme, r, w, noise, first, rest, limits.command, bound)
    kept, most = len(output), limits.command.value
    clipped = int(np.sum(np.abs(wanted) > most))
    command = np.clip(wanted, -most, most)
    return Passes(scheme.dt, r, w[:kept], noise[:kept], command, output, bool(kept < rows), clipped)


def _rows(values: ArrayLike | None, name: str, shape: tuple[int, int]) -> np.ndarray:
    if values is None:
        return np.zeros(shape)
    if np.shape(values) != shape:
        raise ValueError(f"{name} has shape {np.shape(values)}; give one row per pass: {shape}")
    return signal(np.ravel(values), name).reshape(shape)


def _run_apart(scheme, r, w, noise, first, rest, limit, bound):
    """Passes that do not hand a state on: repeated for ever, or begun at rest."""
    commands, outputs, u = [], [], first
    for at, seen in zip(w, noise, strict=True):
        sent = np.clip(u, -limit.value, limit.value)
        base = sent if limit.remember_clipped else u
        output, following = one_pass(scheme, base, sent + at, r, seen, rest)
        if outputs and max(np.abs(u).max(), np.abs(output).max()) > bound:
            break
        commands.append(u)
        outputs.append(output)
        u = following
    return np.array(commands), np.array(outputs)


def run_on(scheme, r, w, noise, first, rest, limit=FREE.command, bound=np.inf):
    """One continuous run: every pass begins in the state in which the last one ended.

    Pass 0 is commanded by `first`, all of it.  Before the run there was no error and nothing was
    corrected; what a filter q sees there is the end of `first`.
    """
    plant, law, n = scheme.plant, scheme.law, scheme.period
    half, b, state = law.q.size // 2, plant.numerator, resting(plant, rest)
    u, y = np.resize(first, (2, noise.size))
    wanted, seen = np.resize(r, noise.size), noise.ravel()
    moved = np.append(first[n - half :], u)  # u + H e, from `half` samples before the run on
    begin = law.filter.advance if scheme.start.forgets else 0
    states = tuple(np.zeros(p.size - 1) for p in (law.filter.b, law.filter.a))
    for at in range(0, noise.size, n - scheme.look_ahead):
        now = slice(at, min(at + n - scheme.look_ahead, noise.size))
        if now.stop > n:
            near = moved[max(at - n, 0) : now.stop - n + 2 * half]
            u[max(at, n) : now.stop] = np.convolve(near, law.q, "valid")
        sent = np.clip(u[now], -limit.value, limit.value)
        y[now], state = scipy.signal.lfilter(b, plant.a, sent + w.ravel()[now], zi=state)
        beyond = np.maximum(np.abs(u[now]), np.abs(y[now])) > bound
        if beyond.any() and at >= n:
            rows = (at + int(np.argmax(beyond))) // n
            return u.reshape(-1, n)[:rows], y.reshape(-1, n)[:rows]
        error = wanted[now] - y[now] - seen[now]
        correction, since, states = _more(law, begin, error, at, states)
        these = slice(since, since + correction.size)
        base = np.clip(u[these], -limit.value, limit.value) if limit.remember_clipped else u[these]
        moved[half + these.start : half + these.stop] = base + correction
    return u.reshape(-1, n), y.reshape(-1, n)


def _more(law, begin, error, at, states):
    """H e of the samples from 0 on that the errors from sample `at` on allow.

    Returns it, its first sample, and the states of the filter; `begin` is the first error that
    the recursion gets.
    """
    b, a, ahead = law.filter.b, law.filter.a, law.filter.advance
    driven, seen = scipy.signal.lfilter(b, [1.0], error, zi=states[0])
    since = max(at, begin)
    driven, sent = driven[since - at :], states[1]
    if driven.size:
        driven, sent = scipy.signal.lfilter([1.0], a, driven, zi=sent)
    early = max(ahead - since, 0)
    return driven[early:], since + early - ahead, (seen, sent)


def track(scheme: Scheme, reference: ArrayLike, *, disturbance: ArrayLike | None = None) -> Passes:
    """Feedforward instead of learning: one pass, repeated for ever, with the command H r.

    Under a zero-phase law this is zero-phase control: y = G H r (Lee, Oh and Kim, eq. 19).
    Raises ValueError as `simulate` does.
    """
    require_repeating(scheme.law)
    r, w = one_period(scheme, reference, disturbance)
    command = circular(scheme.law.filter, r)
    return one_row(scheme, r, w, command, circular(scheme.plant, command + w))


def one_period(scheme: Scheme, reference, disturbance) -> tuple[np.ndarray, np.ndarray]:
    """One pass of reference and disturbance, coerced."""
    r = signal(reference, "reference", scheme.period)
    w = np.zeros(r.size) if disturbance is None else signal(disturbance, "disturbance", r.size)
    return r, w


def one_row(scheme: Scheme, r, w, command, output) -> Passes:
    """The record of a single pass without noise."""
    return Passes(scheme.dt, r, w[None], np.zeros((1, r.size)), command[None], output[None])
