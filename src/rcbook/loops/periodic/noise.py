"""What white noise does to a periodic loop."""

from __future__ import annotations

import numpy as np

from rcbook.loops.periodic.blocks import blocks
from rcbook.loops.periodic.loop import PeriodicLoop
from rcbook.loops.periodic.verdict import verdict
from rcbook.loops.verdict import require_ends, require_stable

_LONG = 300  # samples of a period from which on it pays to follow each sample of the noise
_LONGEST = 2500  # samples of a period; the dense matrices of a longer one fill a small machine
_DROPPED = 1e-9  # of the largest signal, 1e-18 of its power
_PASSES = 100  # periods after which doubling is faster
_MEND = "choose another design or gain, or shorten q"


def noise_gain(loop: PeriodicLoop, output: str = "output", source: str = "noise") -> float:
    """Stationary standard deviation of an output per unit of white noise, rms over the period.

    It is exact but for 1e-11 of the variance: the noise of every sample is followed period by
    period; or, where that does not fade soon, the covariance of the state is summed by doubling,
    with dense matrices, up to some two thousand samples per period.
    Raises ValueError for a loop that is not stable, for a longer period, and for unknown names.
    """
    require_ends(output, source)
    found = verdict(loop)
    if found.verdict == "unstable":
        require_stable(found, _MEND)
    power = _followed(loop, output, source) if loop.period >= _LONG else None
    if power is None and loop.period > _LONGEST:
        raise ValueError(f"period {loop.period}: too long for dense matrices; simulate with noise")
    power = _doubled(loop, output, source) if power is None else power
    if power is None:
        raise ValueError(f"the response to noise does not settle: the loop is {found}; {_MEND}")
    return float(np.sqrt(power / loop.period))


def _followed(loop: PeriodicLoop, output: str, source: str) -> float | None:
    """Energy of the output after units of the source at all samples, period by period.

    None when it has not faded after so many periods, or grows: then what is dropped grows too.
    """
    once = loop.recursion
    sent = output in ("command", "repetitive")  # one signal: the compensator ends the controller
    inside = blocks(once, command=sent)
    timeline = np.zeros((inside.kind.size, loop.period))
    rows = inside.v if sent else inside.w
    state, seen = _answers(loop, output, source, once.size)
    energies = [float(np.sum(seen**2))]
    while len(energies) < _PASSES:
        inside.run(timeline, state, _DROPPED)
        signal = timeline[rows]
        if rows is inside.w:
            signal -= timeline[inside.past_u]  # y(k) = u(k-L) - w(k)
        energies.append(float(np.vdot(signal, signal)))
        if not energies[-1] <= energies[1]:
            return None
        if len(energies) > 8 and sum(energies[-4 - len(energies) // 8 :]) <= 1e-12 * sum(energies):
            return sum(energies)
        state = timeline[inside.last]
    return None


def _doubled(loop: PeriodicLoop, output: str, source: str) -> float | None:
    """The same energy from the covariance of the state; None when it grows without end."""
    states = loop.recursion.size
    ends, seen = _answers(loop, output, source)
    power, entry = ends[:, :states], ends[:, states:]
    free, driven = seen[:, :states], seen[:, states:]
    covariance = entry @ entry.T
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(60):
            added = power @ covariance @ power.T
            covariance = covariance + added
            if not np.all(np.isfinite(covariance)):
                return None
            if np.trace(added) <= 1e-11 * np.trace(covariance):
                return float(np.sum((free @ covariance) * free) + np.sum(driven**2))
            power = power @ power
    return None


def _answers(
    loop: PeriodicLoop, output: str, source: str, first: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """One period from every unit state, then from a unit of the source at every sample.

    Returns the states at its end and the output on the way, columns from the `first` on.
    """
    once, ends, seen = loop.recursion, [], []
    for state, unit in once.units(first):
        error = unit * ((source == "reference") - (source == "noise"))
        timeline = once.run(state, once.right(error, unit * (source == "disturbance")))
        y, v = once.signals(timeline)
        direct = {"error": unit * (source == "reference"), "measured_error": error}
        answer = {"output": y, "command": v, "repetitive": v}.get(output, -y)
        ends.append(timeline[once.last])
        seen.append(answer + direct.get(output, 0.0))
    return np.hstack(ends), np.hstack(seen)
