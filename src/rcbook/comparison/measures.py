"""What every controller is asked, whatever loop it is in; errors are relative to none at all.

A task is one period of a reference and of a disturbance at the plant input, and a disturbance that
does not keep step.  A `Response` says what error and what command they leave.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rcbook import zdomain
from rcbook.comparison import varying
from rcbook.comparison.rivals import Feedback
from rcbook.loops import learning, periodic, repetitive
from rcbook.loops.learning import Scheme
from rcbook.loops.periodic import PeriodicLoop, PeriodicPlant
from rcbook.loops.repetitive import Loop
from rcbook.signals import rms
from rcbook.zdomain import NoncausalFilter

ERRORS = ("reference", "peak", "disturbance", "between")
MEASURES = (*ERRORS, "command", "periods")
_FEW = 0.01  # of the error without a controller, at which it counts as gone


@dataclass(frozen=True, eq=False)
class Task:
    """Signals of one period of N samples, and one of two periods that is out of step."""

    reference: np.ndarray  # harmonics h = 1, 2, 3 below N/2, of amplitude 1/h
    disturbance: np.ndarray  # at the plant input, of the same class
    between: np.ndarray  # at the plant input, three cycles in two periods

    @property
    def period(self) -> int:
        """N, samples."""
        return self.reference.size


def task(period: int) -> Task:
    """The task of a period in samples.  Raises ValueError for one below 3."""
    period = zdomain.whole_number(period, "period", 3, "below 3 it has no harmonic; sample faster")
    angle = 2 * np.pi * np.arange(2 * period) / period
    orders = [h for h in (1, 2, 3) if 2 * h < period]
    sine, cosine = (sum(np.cos(h * angle - h * p) / h for h in orders) for p in (1.0, 0.3))
    return Task(sine[:period], cosine[:period], np.cos(1.5 * angle))


Signals = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Response:
    """Error and command of a loop, given whole periods of reference and disturbance.

    `settled` is the answer to signals repeated for ever; `started` that from rest, with one period
    given and so many periods answered; of passes the first one is not corrected.
    """

    settled: Signals
    started: Callable[[np.ndarray, np.ndarray, int], np.ndarray]


def in_time(loop: Loop) -> Response:
    """The response of a repetitive loop."""

    def settled(r, w):
        run = repetitive.steady_state(loop, r, disturbance=w)
        return run.error, run.command

    def started(r, w, periods):
        return repetitive.respond(loop, np.tile(r, periods), disturbance=np.tile(w, periods)).error

    return Response(settled, started)


def at_angles(loop: PeriodicLoop) -> Response:
    """The response of a periodic loop, the reference fed to the plant and corrected.

    The loop is given what the plant alone leaves of the reference and the disturbance.
    """
    alone = varying.closed(loop.plant, None, "reference")

    def settled(r, w):
        run = periodic.steady_state(loop, r - varying.repeated(alone, r + w))
        return run.error, r + run.command

    def started(r, w, periods):
        r, w = np.tile(r, periods), np.tile(w, periods)
        return periodic.simulate(loop, r - varying.answer(alone, r + w)).error

    return Response(settled, started)


def at_nominal(plant: PeriodicPlant, controller: Feedback) -> Response:
    """The response of a plant whose intervals vary, under a controller that knows of one."""
    parts = [varying.closed(plant, controller, source) for source in ("reference", "disturbance")]
    sent = [varying.commanded(plant, controller, part) for part in parts]
    direct = 1 + controller.numerator[0] / controller.denominator[0]

    def settled(r, w):
        output, command = (
            sum(varying.repeated(part, s) for part, s in zip(each, (r, w), strict=True))
            for each in (parts, sent)
        )
        return r - output, command + direct * r

    def started(r, w, periods):
        r, w = np.tile(r, periods), np.tile(w, periods)
        return r - sum(varying.answer(part, s) for part, s in zip(parts, (r, w), strict=True))

    return Response(settled, started)


def of_passes(scheme: Scheme, enough: int = 400) -> Response:
    """The response of passes that repeat for ever; what alternates is followed for `enough`."""
    n = scheme.period

    def settled(r, w):
        if r.size == n:
            passes = learning.steady_state(scheme, r, disturbance=w)
            return passes.error[0], passes.command[0]
        rows = np.tile(w.reshape(-1, n), (enough // (r.size // n), 1))
        run = learning.simulate(scheme, r[:n], passes=len(rows) - 1, disturbance=rows)
        return run.error[-(r.size // n) :].ravel(), run.command[-(r.size // n) :].ravel()

    def started(r, w, periods):
        return learning.simulate(scheme, r, passes=periods - 1, disturbance=w).error.ravel()

    return Response(settled, started)


def feedforward(answer: Callable[[np.ndarray], np.ndarray], filter: NoncausalFilter) -> Response:
    """The response of a plant, by its answer to a repeated command, that is commanded C r."""

    def settled(r, w):
        z = zdomain.unit_circle(r.size)
        command = np.fft.ifft(zdomain.response(filter, z) * np.fft.fft(r)).real
        return r - answer(command + w), command

    return Response(settled, lambda r, w, periods: np.tile(settled(r, w)[0], periods))


def measures(response: Response, alone: Response, work: Task, periods: int = 200) -> dict:
    """Errors under a controller over those without, and how long it takes; a number each.

    "reference", "disturbance" and "between" are rms errors in the steady state, "peak" the largest
    one of the reference, "command" the rms command over that without a controller, and "periods"
    the first period from which on the error of reference and disturbance together stays below one
    percent; infinite when so many `periods` do not show that.
    """
    r, w, none = work.reference, work.disturbance, np.zeros(work.period)
    found, twice = {}, np.zeros(2 * work.period)
    (tracked, command), (missed, plain) = (x.settled(r, none) for x in (response, alone))
    found["reference"] = rms(tracked) / rms(missed)
    found["peak"] = float(np.abs(tracked).max() / np.abs(missed).max())
    for name, zero, signal in (("disturbance", none, w), ("between", twice, work.between)):
        left, without = (rms(x.settled(zero, signal)[0]) for x in (response, alone))
        found[name] = left / without
    found["command"] = rms(command) / rms(plain)
    by_period = response.started(r, w, periods).reshape(periods, -1)
    large = np.sqrt(np.mean(by_period**2, axis=1)) > _FEW * rms(alone.settled(r, w)[0])
    last = np.flatnonzero(large)[-1] + 1 if large.any() else 0
    found["periods"] = float(last) if last < periods else np.inf
    return found


def error_at(loop: Loop, work: Task, change: float = 0.0) -> float:
    """What a loop leaves of the reference error when the period is longer by a relative change."""
    spectrum = np.fft.rfft(work.reference)[1:4]
    angles = 2 * np.pi * np.arange(1, 1 + spectrum.size) / work.period
    z, sizes = np.exp(1j * angles / (1 + change)), []
    for each in (loop, replace(loop, repetitive=None)):
        numerator, denominator = repetitive.transfer(each, "reference", "error")
        answer = zdomain.evaluate(numerator, z) / zdomain.evaluate(denominator, z)
        sizes.append(np.linalg.norm(answer * spectrum))
    return float(sizes[0] / sizes[1])


def period_margin(loop: Loop, work: Task, level: float = 0.1) -> float:
    """Relative change of the period up to which `error_at` stays below `level`.

    Of both signs the smaller, looked for up to a tenth; 0 where more is left without any change.
    """

    def excess(change: float) -> float:
        return error_at(loop, work, change) - level

    edges = np.append(0.0, np.geomspace(1e-4, 0.1, 61))
    return min(abs(zdomain.first_crossing(excess, sign * edges)) for sign in (1, -1))


def quantised(loop: Loop, reference: np.ndarray, step: float, **inputs: np.ndarray) -> np.ndarray:
    """Output of a loop that reads its output to the nearest multiple of `step`.

    What the reading is off acts as noise that depends on the output up to now; a plant that answers
    later than at once lets it be found sample by sample.
    Raises ValueError for a step that is not positive, and as `repetitive.respond` does.
    """
    step = zdomain.real_number(step, "step", positive=True)
    free = repetitive.respond(loop, reference, **inputs).output
    top, bottom = repetitive.transfer(loop, "noise", "output")
    output, lags = free.copy(), max(top.size, bottom.size)
    top, bottom = (np.pad(p, (0, lags - p.size)) / bottom[0] for p in (top, bottom))
    extra, noise = np.zeros(free.size + lags), np.zeros(free.size + lags)
    for k in range(free.size):
        at = slice(k, k + lags)  # the last `lags` samples, oldest first, before k + lags
        past = top[:0:-1] @ noise[at][1:] - bottom[:0:-1] @ extra[at][1:]
        extra[k + lags], output[k] = past, free[k] + past
        noise[k + lags] = step * np.round(output[k] / step) - output[k]
    return output


def coloured_noise_gain(loop: Loop, numerator: np.ndarray, denominator: np.ndarray) -> float:
    """Standard deviation of the output per unit of noise numerator/denominator, at the sensor.

    The noise is white noise through a filter, both polynomials in z^-1, and is scaled to unit
    standard deviation.
    """
    top, bottom = repetitive.transfer(loop, "noise", "output")
    own = float(np.abs(np.roots(denominator)).max(initial=0.0))
    largest = max(own, float(np.abs(loop.roots).max(initial=0.0)))
    heard = zdomain.rms_gain(
        zdomain.multiply(top, numerator), zdomain.multiply(bottom, denominator), largest
    )
    return heard / zdomain.rms_gain(numerator, denominator, own)
