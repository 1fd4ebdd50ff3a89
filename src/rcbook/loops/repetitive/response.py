"""Responses of a repetitive loop: sample by sample, by transfer functions, and in steady state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.loops.repetitive import recursion
from rcbook.loops.repetitive.loop import Loop, Process, as_loop, characteristic_polynomial
from rcbook.loops.repetitive.stability import require_stable, spectral_radius
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
    return _run(loop, inputs, *recursion.signals(loop, inputs, limits, _bound(inputs)))


def respond(
    loop: System,
    reference: ArrayLike,
    *,
    disturbance: ArrayLike | None = None,
    noise: ArrayLike | None = None,
) -> Run:
    """The same run as `simulate` without limits."""
    return simulate(loop, reference, disturbance=disturbance, noise=noise)


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
    return BOUND * max(map(_largest, inputs))


def _largest(s: np.ndarray) -> float:
    return float(max(s.max(), -s.min()))


def _run(loop: Loop, inputs: Sequence[np.ndarray], found: np.ndarray, held: np.ndarray) -> Run:
    """The record up to where a signal exceeds the bound."""
    bound, n = _bound(inputs), found.shape[1]
    if not max(map(_largest, found)) <= bound:
        n = int(np.argmin(np.abs(found).max(axis=0) <= bound))
    y, u, v = found[:, :n]
    _, clipped_u, clipped_v = np.count_nonzero(held[:, :n], axis=1).tolist()
    time, unbounded = loop.dt * np.arange(n), n < found.shape[1]
    return Run(time, *(s[:n] for s in inputs), y, v, u, unbounded, clipped_v, clipped_u)


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
    largest = spectral_radius(loop) ** (1 / (loop.period or 1))
    return zdomain.rms_gain(*transfer(loop, source, output), largest)
