"""Who takes part, on which plant: each is a function of gain and width, for `tuning.tune`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from rcbook import zdomain
from rcbook.comparison import margins, measures, rivals, varying
from rcbook.comparison.measures import Response, Task
from rcbook.comparison.tuning import Budget, Tuned, tune
from rcbook.loops import learning, memory, periodic
from rcbook.loops.learning import Scheme
from rcbook.loops.periodic import PeriodicLoop, PeriodicPlant
from rcbook.loops.repetitive import Loop, RepetitiveController
from rcbook.loops.verdict import MARGIN
from rcbook.zdomain import Plant

if TYPE_CHECKING:
    from control import StateSpace

MARGINS = ("noise gain", "delay margin", "gain margin", "period margin")
DAMPING = 0.02  # of a peak filter: two percent of a harmonic's frequency to either side
SHARE = 0.1  # of a memory of second order, from period to period
LATEST, STRONGEST = 20.0, 100.0  # samples and factors up to which a varying loop is followed


@dataclass(frozen=True, eq=False)
class Result:
    """A contender as the rule tunes it: its response, and what it forgives."""

    tuned: Tuned
    response: Response | None  # None where no gain holds the noise budget
    gain_margin: float


def answers(result: Result, alone: Response, work: Task) -> dict[str, float]:
    """All measures of a contender, and its margins; relative errors below 1e-5 are given as that.

    NaN where there is no loop, or nothing to ask: only a loop in time has a period to be wrong.
    """
    tuned = result.tuned
    asked = dict.fromkeys(measures.MEASURES, np.nan)
    if result.response is not None:
        asked = measures.measures(result.response, alone, work)
        asked |= {name: max(asked[name], 1e-5) for name in measures.ERRORS}
    period = measures.period_margin(tuned.loop, work) if isinstance(tuned.loop, Loop) else np.nan
    forgiven = (tuned.noise_gain, tuned.delay_margin, result.gain_margin, period)
    return asked | dict(zip(MARGINS, forgiven, strict=True))


def uncontrolled(plant: Plant | PeriodicPlant) -> Response:
    """The response of a plant that is commanded by the reference itself."""
    if isinstance(plant, Plant):
        return measures.in_time(Loop(plant))
    alone = varying.closed(plant, None, "reference")
    return measures.feedforward(lambda u: varying.repeated(alone, u), memory.lead(0))


def smoothing(width: float) -> list[float]:
    """a z + (1 - 2 a) + a z^-1 with a = (1 - width)/4: from one pass of `binomial_q` to none."""
    a = (1 - width) / 4
    return [a, 1 - 2 * a, a]


def harmonics_within(period: float, delay: float) -> list[int]:
    """Those of the harmonics 0 to 3 that turn by less than a right angle in a delay in samples."""
    return [h for h in (0, 1, 2, 3) if 4 * h * delay < period]


def in_time(plant: Plant, period: int, budget: Budget) -> Mapping[str, Result]:
    """The feedback controllers on a constant plant, all corrections of the reference; tuned."""
    inverse = zdomain.zero_phase_inverse(plant)
    chosen = harmonics_within(period, budget.delay_margin)

    def repetitive(kept, gain):
        return RepetitiveController(inverse, kept, gain)

    def filtered(width):
        return memory.plain(period, smoothing(width))

    makers = {
        "PI": (lambda g, w: rivals.proportional_integral(period, g, w), True),
        "disturbance observer": (
            lambda g, w: rivals.disturbance_observer(plant, period, max(1 - g, 0.0)),
            False,
        ),
        "peak filter": (
            lambda g, w: rivals.peak_filter(plant, period, chosen[1:], g, DAMPING),
            False,
        ),
        "resonators": (lambda g, w: memory.resonators(plant, period, chosen, g), False),
        "prototype": (lambda g, w: repetitive(memory.plain(period), g), False),
        "filtered": (lambda g, w: repetitive(filtered(w), g), True),
        "second order": (lambda g, w: rivals.second_order(inverse, filtered(w), g, SHARE), True),
    }
    return {name: of_loop(plant, *maker, budget) for name, maker in makers.items()}


def of_loop(plant: Plant, make: Callable, has_width: bool, budget: Budget) -> Result:
    """The loop of controllers make(gain, width) round a plant, tuned, in the plug-in form."""

    def loop(gain: float, width: float) -> Loop:
        return Loop(plant, make(gain, width), "plug-in")

    tuned = tune(loop, margins.noise_gain, margins.delay_margin, budget, has_width)
    if tuned.loop is None:
        return Result(tuned, None, np.nan)
    return Result(tuned, measures.in_time(tuned.loop), margins.gain_margin(tuned.loop))


def of_passes(plant: Plant, period: int, budget: Budget) -> Mapping[str, Result]:
    """Learning from pass to pass on a constant plant, by two laws; tuned, and zero-phase control.

    The delay margin is that of a plant later than the law thinks; zero-phase control, which has no
    feedback, is not tuned.
    """

    def zero_phase(gain, width):
        return Scheme(plant, learning.zero_phase_law(plant, gain, "peak", smoothing(width)), period)

    def optimal(gain, width):
        law = learning.norm_optimal_law(plant, 1 / gain - 0.5, period)
        return Scheme(plant, replace(law, q=smoothing(width)), period)

    def noise_gain(scheme):
        stable = learning.spectral_radius(scheme) < 1 - MARGIN
        return learning.noise_gain(scheme) if stable else np.inf

    found = {}
    for name, make in (("pass to pass", zero_phase), ("norm-optimal", optimal)):
        tuned = tune(make, noise_gain, margins.pass_delay_margin, budget, has_width=True)
        margin = margins.pass_gain_margin(tuned.loop)
        found[name] = Result(tuned, measures.of_passes(tuned.loop), margin)
    alone = uncontrolled(plant)

    def answer(command):
        return command - alone.settled(command, 0 * command)[0]

    response = measures.feedforward(answer, learning.zero_phase_law(plant).filter)
    return found | {"ZPETC": Result(UNTUNED, response, np.inf)}


UNTUNED = Tuned(None, np.nan, np.nan, 0.0, np.inf, "nothing")


def at_angles(
    system: StateSpace, intervals: np.ndarray, nominal: float, budget: Budget
) -> Mapping[str, Result]:
    """The contenders on a plant sampled at intervals in s that vary, with one nominal interval.

    All but "scheduled" are designed at the nominal interval; all are tuned on the varying plant.
    """
    period, model = len(intervals), zdomain.zero_order_hold(system, nominal)
    scheduled = periodic.zero_phase(system, intervals)
    constant = periodic.zero_phase(system, np.full(period, nominal))
    chosen = harmonics_within(period, budget.delay_margin)
    plant_late = cache(lambda late: periodic.sample(system, intervals, late * nominal))

    def repetitive(inverse, q):
        return lambda g, w: PeriodicLoop(plant_late(0.0), inverse, memory.plain(period, q(w)), g)

    makers = {
        "PI": (lambda g, w: rivals.proportional_integral(period, g, w), True),
        "disturbance observer": (
            lambda g, w: rivals.disturbance_observer(model, period, max(1 - g, 0.0)),
            False,
        ),
        "peak filter": (
            lambda g, w: rivals.peak_filter(model, period, chosen[1:], g, DAMPING),
            False,
        ),
        "resonators": (
            lambda g, w: rivals.as_feedback(memory.resonators(model, period, chosen, g)),
            False,
        ),
        "prototype": (repetitive(constant, lambda w: [1.0]), False),
        "filtered": (repetitive(constant, smoothing), True),
        "scheduled": (repetitive(scheduled, smoothing), True),
    }
    found = {name: _at_angles(plant_late, *maker, budget) for name, maker in makers.items()}
    alone = varying.closed(plant_late(0.0), None, "reference")
    forward = learning.zero_phase_law(model).filter
    response = measures.feedforward(lambda u: varying.repeated(alone, u), forward)
    return found | {"ZPETC": Result(UNTUNED, response, np.inf)}


def _at_angles(plant_late: Callable, make: Callable, has_width: bool, budget: Budget) -> Result:
    """One contender on a varying plant, by the plant that is late by so many samples."""

    def radius(loop: Any, late: float, factor: float = 1.0) -> float:
        plant, stronger = plant_late(late), replace(loop, gain=factor * loop.gain)
        if isinstance(loop, PeriodicLoop):
            return periodic.spectral_radius(replace(stronger, plant=plant))
        return varying.spectral_radius(varying.closed(plant, stronger, "noise"))

    def noise_gain(loop: Any) -> float:
        if isinstance(loop, PeriodicLoop):
            return periodic.noise_gain(loop) if radius(loop, 0.0) < 1 - MARGIN else np.inf
        return varying.noise_gain(varying.closed(plant_late(0.0), loop, "noise"))

    def holds(loop: Any) -> float:
        """The delay margin as far as the rule needs it: infinite where it is above the budget."""
        late = budget.delay_margin * np.array([0.0, 0.5, 1.0])
        return np.inf if all(radius(loop, d) < 1 for d in late) else 0.0

    tuned = tune(make, noise_gain, holds, budget, has_width)
    if tuned.loop is None:
        return Result(tuned, None, np.nan)
    late = np.arange(0.0, LATEST + 0.1, 0.5)
    margin = zdomain.first_crossing(lambda d: radius(tuned.loop, d) - 1, late)
    tuned = replace(tuned, delay_margin=margin)
    factors = np.geomspace(1.0, STRONGEST, 60)
    margin = zdomain.first_crossing(lambda f: radius(tuned.loop, 0.0, f) - 1, factors)
    if isinstance(tuned.loop, PeriodicLoop):
        return Result(tuned, measures.at_angles(tuned.loop), margin)
    return Result(tuned, measures.at_nominal(plant_late(0.0), tuned.loop), margin)
