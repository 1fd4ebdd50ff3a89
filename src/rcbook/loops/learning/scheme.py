"""A learning scheme: a plant, a law, and how a pass begins; and what one pass makes of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # its signal is loaded when asked for, and takes half a second

from rcbook import zdomain
from rcbook.loops.learning.laws import LearningLaw
from rcbook.loops.memory import RepetitiveController, plain
from rcbook.zdomain import NoncausalFilter, Plant, add, multiply


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
class Scheme:
    """u_(L+1) = q (u_L + H e_L) on a plant, in passes of `period` samples that begin by `start`.

    `model` is the plant that the law was designed on (None: unknown, or the same);
    `dataclasses.replace` puts the same law on another plant.
    Raises ValueError when the law looks ahead as far as a pass is long, when the plant is not
    stable, when passes are to repeat for ever under a law that is not, and for a start that is
    none; TypeError for a plant or law that is none.
    """

    plant: Plant
    law: LearningLaw
    period: int  # samples of a pass
    start: Start = PERIODIC
    model: Plant | None = None

    def __post_init__(self) -> None:
        for each in (self.plant, self.model or self.plant):
            if not isinstance(each, Plant):
                raise TypeError(f"{each!r} is no Plant; give one to plant and model")
        if not isinstance(self.law, LearningLaw):
            raise TypeError(f"law = {self.law!r}: make one with zero_phase_law or another")
        if not isinstance(self.start, Start):
            message = "give PERIODIC, CONTINUOUS, RESET or another Start"
            raise ValueError(f"start = {self.start!r}: {message}")
        object.__setattr__(self, "period", zdomain.whole_number(self.period, "period"))
        if self.look_ahead >= self.period:
            raise ValueError(
                f"the law looks {self.look_ahead} samples ahead and a pass has {self.period}; "
                "sample faster, or shorten the law"
            )
        if not self.plant.is_stable:
            raise ValueError(f"the plant has poles {self.plant.poles}; close a loop round it first")
        if self.start.before == "itself":
            require_repeating(self.law)

    @property
    def dt(self) -> float:
        """Sampling interval in s."""
        return self.plant.dt

    @property
    def look_ahead(self) -> int:
        """Samples of error beyond k that the new command at k needs."""
        return self.law.look_ahead

    @property
    def corrected(self) -> int:
        """Commands of a pass that learning can tell: from rest the last ones answer too late.

        Where a filter q or a plant run on connects them with others they count nevertheless.
        """
        lost = self.start.before == "rest" and self.start.after != "on" and self.law.q.size == 1
        return max(self.period - self.plant.delay * lost, 0)

    @cached_property
    def controller(self) -> RepetitiveController:
        """The repetitive controller that the scheme is when passes follow without a break."""
        return RepetitiveController(self.law.filter, plain(self.period, self.law.q), 1.0)

    @cached_property
    def polynomial(self) -> np.ndarray:
        """Exact polynomial in z^-1 whose roots are those of the scheme run on continuously."""
        controller = self.controller
        memory = multiply(self.plant.a, controller.denominator)
        return add(memory, multiply(self.plant.numerator, controller.numerator))

    @cached_property
    def roots(self) -> np.ndarray:
        """Roots of `polynomial`, one step of them a sample, by decreasing magnitude."""
        return zdomain.sorted_roots(self.polynomial)

    @cached_property
    def one_pass(self) -> np.ndarray:
        """Matrix from the command of one pass to that of the next, (period, period)."""
        units, nothing = np.eye(self.period), np.zeros(self.period)
        return one_pass(self, units, units, nothing, nothing, 0.0)[1].T


def require_repeating(law: LearningLaw) -> None:
    """Raise ValueError unless the law gives passes that repeat for ever."""
    if not np.all(np.abs(law.poles) < 1):
        raise ValueError(f"the law has poles {law.poles} and no pass repeats; start otherwise")


# ---- one pass that hands no state on, along the last axis of its signals ----


def one_pass(scheme, u, sent, reference, noise, rest) -> tuple[np.ndarray, np.ndarray]:
    """Output of a pass and command of the next.

    `u` is the command that is remembered, `sent` what the plant gets.
    """
    output = answer(scheme, sent, rest)
    error = _beyond(scheme, reference - output - noise, sent, reference, rest)
    return output, _corrected(scheme, u, error)


def answer(scheme: Scheme, sent: np.ndarray, rest: float) -> np.ndarray:
    """Output of the plant, after command and output were `rest` or repeated for ever."""
    plant = scheme.plant
    if scheme.start.before == "itself":
        return circular(plant, sent)
    state = resting(plant, rest)
    state = np.broadcast_to(state, (*sent.shape[:-1], state.size))
    return scipy.signal.lfilter(plant.numerator, plant.a, sent, zi=state)[0]


def resting(plant: Plant, rest: float) -> np.ndarray:
    """State of the plant after command and output were `rest`."""
    b, a = plant.numerator, plant.a
    return scipy.signal.lfiltic(b, a, np.full(a.size, rest), np.full(b.size, rest))


def circular(filter: Plant | NoncausalFilter, x: np.ndarray) -> np.ndarray:
    """A filter's answer to signals that have repeated for ever."""
    gain = zdomain.response(filter, zdomain.unit_circle(x.shape[-1]))
    return np.fft.ifft(gain * np.fft.fft(x)).real


def _beyond(scheme, error, sent, reference, rest) -> np.ndarray:
    """The error of a pass, and behind it what the look-ahead sees."""
    ahead, after, n = scheme.look_ahead, scheme.start.after, scheme.period
    if after == "on":
        longer = answer(scheme, np.append(sent, sent[..., :ahead], axis=-1), rest)
        tail = reference[..., :ahead] - longer[..., n:]
        tail = np.broadcast_to(tail, (*error.shape[:-1], ahead))
    else:
        tail = error[..., :ahead] if after == "itself" else 0 * error[..., :ahead]
    return np.append(error, tail, axis=-1)


def _corrected(scheme: Scheme, u: np.ndarray, error: np.ndarray) -> np.ndarray:
    """q (u + H e), where `error` is longer than u by the look-ahead."""
    law, start, n = scheme.law, scheme.start, scheme.period
    half = law.q.size // 2
    u = np.broadcast_to(u, (*error.shape[:-1], n))
    if start.before == "itself":
        moved = u + circular(law.filter, error[..., :n])
        return circular(NoncausalFilter(law.q, [1.0], half), moved)
    beyond = u[..., :half] if start.after != "nothing" else u[..., -1:].repeat(half, axis=-1)
    moved = np.append(u, beyond, axis=-1) + _correction(law, error, start)[..., : n + half]
    moved = np.append(u[..., :1].repeat(half, axis=-1), moved, axis=-1)
    return scipy.signal.lfilter(law.q, [1.0], moved)[..., 2 * half :]


def _correction(law: LearningLaw, error: np.ndarray, start: Start) -> np.ndarray:
    """H e from sample 0 on, for an error that was zero before; shorter than it by the advance."""
    ahead = law.filter.advance
    begin = ahead if start.forgets else 0
    driven = scipy.signal.lfilter(law.filter.b, [1.0], error)[..., begin:]
    return scipy.signal.lfilter([1.0], law.filter.a, driven)[..., ahead - begin :]
