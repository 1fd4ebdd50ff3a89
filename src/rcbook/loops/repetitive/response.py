"""Responses of a repetitive loop: sample by sample, by transfer functions, and in steady state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy.signal
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.loops.repetitive.loop import Loop, Process, as_loop, characteristic_polynomial
from rcbook.loops.repetitive.stability import require_stable
from rcbook.loops.run import BOUND, FREE, Limits, Run
from rcbook.loops.verdict import SOURCES, require_ends
from rcbook.signals import signal
from rcbook.zdomain import Plant, add, multiply

System = Loop | Process | Plant
_SOLVED = ("output", "command", "repetitive")  # the other outputs are differences of these


def transfer(loop: System, source: str, output: str) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator, in z^-1, from a source to an output of the closed loop.

    Sources are reference, disturbance (at the plant input) and noise (on the measured output);
    outputs are output, error, measured_error (with the noise), command and repetitive.
    """
    require_ends(output, source)
    loop = as_loop(loop)
    delta = characteristic_polynomial(loop)
    if output not in ("error", "measured_error"):
        return _numerators(loop)[source, output], delta
    direct = delta * ((source == "reference") - (source == "noise" and output == "measured_error"))
    return add(direct, -_numerators(loop)[source, "output"]), delta


def _numerators(loop: Loop) -> Mapping[tuple[str, str], np.ndarray]:
    """What each source sends to each of the signals that the loop is solved for."""
    plant, path = loop.process.plant, loop.process.command_path
    n, c, feedback = loop.process.parts
    ng, dg, through = loop.parts
    b, reference, both = plant.numerator, add(through, ng), add(ng, feedback * dg)
    return {
        ("reference", "output"): multiply(b, n, reference),
        ("disturbance", "output"): multiply(b, c, dg),
        ("noise", "output"): -multiply(b, n, both),
        ("reference", "command"): multiply(n, plant.a, reference),
        ("disturbance", "command"): -multiply(b, n, both),
        ("noise", "command"): -multiply(n, plant.a, both),
        ("reference", "repetitive"): multiply(path.a, reference),
        ("disturbance", "repetitive"): -multiply(b, c, ng),
        ("noise", "repetitive"): -multiply(c, plant.a, ng),
    }


def simulate(
    loop: System,
    reference: ArrayLike,
    *,
    disturbance: ArrayLike | None = None,
    noise: ArrayLike | None = None,
    limits: Limits = FREE,
) -> Run:
    """Run the loop sample by sample from rest, limits included.

    Source: Horng (1989), eqs 24-28 with eq. 25 corrected.
    Raises ValueError when the signals differ in length or hold NaN.
    """
    loop, inputs = as_loop(loop), _inputs(reference, disturbance, noise)
    n, c, feedback = loop.process.parts
    ng, dg, through = loop.parts
    b, a = loop.process.plant.numerator, loop.process.plant.a
    lags = max(p.size for p in (ng, dg, through, a, b, n, c)) - 1
    r, w, noise = np.pad(inputs, ((0, 0), (lags, 0)))
    y, e, u, v, inner, sent, kept_u, kept_v, asked_u, asked_v = np.zeros((10, r.size))
    bound = _bound(inputs)

    for k in range(lags, r.size):
        y[k] = _recall(b, sent, k) - _recall(a, y, k, 1)
        measured = y[k] + noise[k]
        e[k] = r[k] - measured
        asked = _recall(ng, e, k) + _recall(through, r, k) - _recall(dg, kept_u, k, 1)
        asked_u[k] = asked / dg[0]
        u[k] = np.clip(asked_u[k], -limits.repetitive.value, limits.repetitive.value)
        inner[k] = u[k] - feedback * measured
        asked_v[k] = (_recall(n, inner, k) - _recall(c, kept_v, k, 1)) / c[0]
        v[k] = np.clip(asked_v[k], -limits.command.value, limits.command.value)
        kept_u[k] = u[k] if limits.repetitive.remember_clipped else asked_u[k]
        kept_v[k] = v[k] if limits.command.remember_clipped else asked_v[k]
        sent[k] = v[k] + w[k]
        if not max(abs(y[k]), abs(u[k]), abs(v[k])) <= bound:
            break
    asked = ((asked_v, limits.command.value), (asked_u, limits.repetitive.value))
    acted = (np.abs(s[lags:]) > most for s, most in asked)
    return _run(loop, inputs, (y[lags:], v[lags:], u[lags:]), *acted)


def _recall(p: np.ndarray, s: np.ndarray, k: int, first: int = 0) -> float:
    """p(z^-1) s at sample k, without the `first` powers."""
    return p[first:] @ s[k - p.size + 1 : k - first + 1][::-1]


def respond(
    loop: System,
    reference: ArrayLike,
    *,
    disturbance: ArrayLike | None = None,
    noise: ArrayLike | None = None,
) -> Run:
    """The same run as `simulate` without limits, by filtering through the closed-loop transfers."""
    loop, inputs = as_loop(loop), _inputs(reference, disturbance, noise)
    found = [
        sum(
            scipy.signal.lfilter(*transfer(loop, source, output), s)
            for source, s in zip(SOURCES, inputs, strict=True)
        )
        for output in _SOLVED
    ]
    return _run(loop, inputs, found)


def _inputs(
    reference: ArrayLike, disturbance: ArrayLike | None, noise: ArrayLike | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Reference, disturbance and noise of one length; what is not given is 0."""
    r = signal(reference, "reference")
    w, noise = (
        np.zeros(r.size) if s is None else signal(s, name, r.size)
        for s, name in ((disturbance, "disturbance"), (noise, "noise"))
    )
    return r, w, noise


def _bound(inputs: Sequence[np.ndarray]) -> float:
    return BOUND * float(np.abs(inputs).max())


def _run(
    loop: Loop,
    inputs: Sequence[np.ndarray],
    found: Sequence[np.ndarray],
    clipped_v: np.ndarray | None = None,
    clipped_u: np.ndarray | None = None,
) -> Run:
    """The record up to where a signal exceeds the bound."""
    within = np.abs(found).max(axis=0) <= _bound(inputs)
    n = within.size if within.all() else int(np.argmin(within))
    acted = [0 if s is None else int(np.sum(s[:n])) for s in (clipped_v, clipped_u)]
    signals = (s[:n] for s in (*inputs, *found))
    return Run(loop.dt * np.arange(n), *signals, n < within.size, *acted)


def steady_state(
    loop: System, reference: ArrayLike, *, disturbance: ArrayLike | None = None
) -> Run:
    """Whole periods of the steady state, computed harmonic by harmonic and not by waiting for it.

    The inputs repeat after their common length: whole periods of a controller whose period is
    whole, else any length.
    Raises ValueError when the loop is not stable, because then there is none, and for a length
    that does not fit.
    """
    loop, (r, w, none) = as_loop(loop), _inputs(reference, disturbance, None)
    period = loop.period or 1
    if float(period).is_integer() and r.size % int(period):
        raise ValueError(
            f"the reference has {r.size} samples, no whole periods of {period:g}; cut or repeat it"
        )
    require_stable(loop)
    z, spectra = zdomain.unit_circle(r.size), np.fft.fft([r, w])
    found = [
        np.fft.ifft(
            sum(
                _value(transfer(loop, source, output), z) * s
                for source, s in zip(SOURCES[:2], spectra, strict=True)
            )
        ).real
        for output in _SOLVED
    ]
    return Run(loop.dt * np.arange(r.size), r, w, none, *found)


def _value(fraction: tuple[np.ndarray, np.ndarray], z: np.ndarray) -> np.ndarray:
    numerator, denominator = fraction
    return zdomain.evaluate(numerator, z) / zdomain.evaluate(denominator, z)


def frequency_response(loop: System, source: str, output: str, frequency: ArrayLike) -> np.ndarray:
    """Complex response from a source to an output at frequencies in Hz."""
    loop = as_loop(loop)
    frequency = signal(np.ravel(frequency), "frequency").reshape(np.shape(frequency))
    return _value(transfer(loop, source, output), zdomain.at_frequency(frequency, loop.dt))


def sensitivity(loop: System, frequency: ArrayLike) -> np.ndarray:
    """Complex sensitivity, measured output over a disturbance added to the output, at f in Hz."""
    return -frequency_response(loop, "noise", "measured_error", frequency)


def noise_gain(loop: System, output: str = "output", source: str = "noise") -> float:
    """Standard deviation of an output per unit standard deviation of white noise at a source.

    Raises ValueError when the loop is not stable, and as `zdomain.rms_gain` does.
    """
    loop = as_loop(loop)
    require_ends(output, source)
    require_stable(loop)
    largest = float(np.abs(loop.roots).max(initial=0.0))
    return zdomain.rms_gain(*transfer(loop, source, output), largest)
