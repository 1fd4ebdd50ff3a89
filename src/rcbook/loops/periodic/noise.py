"""What white noise does to a periodic loop."""

from __future__ import annotations

import numpy as np

from rcbook.loops.periodic.blocks import Blocks, blocks
from rcbook.loops.periodic.loop import PeriodicLoop
from rcbook.loops.periodic.verdict import decays, verdict
from rcbook.loops.verdict import require_ends, require_stable

_LONG = 300  # samples of a period from which on it pays to follow each sample of the noise
_LONGEST = 2500  # samples of a period; the dense matrices of a longer one fill a small machine
_DROPPED = 1e-9  # of the largest signal, 1e-18 of its power
_PASSES = 100  # periods; what takes longer to fade is summed faster
_SENT = ("command", "repetitive")
_FADED = 1e-12  # of the energy
_SUMMED = 1e-11  # of the variance
_MEND = "choose another design or gain, or shorten q"


def noise_gain(loop: PeriodicLoop, output: str = "output", source: str = "noise") -> float:
    """Stationary standard deviation of an output per unit of white noise, rms over the period.

    It is exact but for 1e-11 of the variance: the noise of every sample is followed period by
    period; or, where that does not fade soon, the covariance of the state is summed by doubling,
    with dense matrices, up to some two thousand samples per period.
    Raises ValueError for a loop that is not stable, for a longer period, and for unknown names.
    """
    require_ends(output, source)
    if not decays(loop.plant):  # it may hide from the noise what grows in it
        require_stable(verdict(loop), _MEND)
    entered = _entered(loop, output, source)
    power = _followed(loop, output, *entered) if loop.period >= _LONG else None
    if power is None and loop.period > _LONGEST:
        raise ValueError(f"period {loop.period}: too long for dense matrices; simulate with noise")
    power = _doubled(loop, output, *entered) if power is None else power
    if power is None:
        require_stable(verdict(loop), _MEND)
        raise ValueError(f"the response to noise does not settle in 2^40 periods; {_MEND}")
    return float(np.sqrt(power / loop.period))


def _entered(loop: PeriodicLoop, output: str, source: str) -> tuple[np.ndarray, np.ndarray]:
    """One period with a unit of the source at every sample: states at its end, and the output."""
    once, ends, seen = loop.recursion, [], []
    for unit in once.units():
        error = unit * ((source == "reference") - (source == "noise"))
        timeline = once.run(
            np.zeros((once.size, unit.shape[1])),
            once.right(error, unit * (source == "disturbance")),
        )
        y, v = once.signals(timeline)
        direct = {"error": unit * (source == "reference"), "measured_error": error}
        answer = {"output": y, "command": v, "repetitive": v}.get(output, -y)
        ends.append(timeline[once.last])
        seen.append(answer + direct.get(output, 0.0))
    return np.hstack(ends), np.hstack(seen)


def _output(inside: Blocks, timeline: np.ndarray, output: str) -> np.ndarray:
    """The output, a row a sample, but for its sign, in a period without inputs."""
    if output in _SENT:
        return timeline[inside.v]  # one signal: the compensator ends the controller
    return timeline[inside.past_u] - timeline[inside.w]  # y(k) = u(k-L) - w(k)


def _followed(loop: PeriodicLoop, output: str, state: np.ndarray, seen: np.ndarray) -> float | None:
    """Energy of the output after units of the source at all samples, period by period.

    None when it will not have faded after so many periods, or grows: what is dropped grows too.
    """
    inside = blocks(loop.recursion, command=output in _SENT)
    timeline = np.zeros((inside.kind.size, loop.period))
    energies, first = [float(np.sum(seen**2))], np.linalg.norm(state[inside.order :])
    while _expected(energies) <= _PASSES:
        inside.run(timeline, state, _DROPPED)
        state = timeline[inside.last]
        energies.append(float(np.sum(_output(inside, timeline, output) ** 2)))
        left = np.linalg.norm(state[inside.order :])
        if not (energies[-1] <= energies[1] and left <= first):
            return None
        recent = sum(energies[-4 - len(energies) // 8 :])
        if len(energies) > 8 and recent <= _FADED * sum(energies) and left <= 1e-4 * first:
            return sum(energies)
    return None


def _expected(energies: list[float]) -> float:
    """Periods until the energy has faded, judged by how it did in the last six."""
    if len(energies) < 13 or not energies[-1]:
        return len(energies)
    rate = np.log(energies[-7] / energies[-1]) / 6
    return len(energies) + np.log(energies[-1] / (_FADED * sum(energies))) / max(rate, 1e-9)


def _doubled(loop: PeriodicLoop, output: str, entry: np.ndarray, seen: np.ndarray) -> float | None:
    """The same energy from the covariance of the state; None when it grows without end.

    With f the sum of squares of M^m the periods from m on add at most f/(1-f) of the trace.
    """
    inside = blocks(loop.recursion, command=output in _SENT)
    timeline = np.zeros((inside.kind.size, loop.recursion.size))
    inside.run(timeline, np.eye(loop.recursion.size), 0.0)
    power, free = timeline[inside.last], _output(inside, timeline, output)
    covariance = _symmetric(entry, entry)
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(40):  # what has not faded then lies on the circle but for rounding
            added = _symmetric(power @ covariance, power)
            covariance = covariance + added
            if not np.all(np.isfinite(covariance)):
                return None
            small = np.trace(added) <= _SUMMED * np.trace(covariance)
            power = power if small else power @ power
            if small or np.sum(power**2) <= _SUMMED:
                return float(np.sum((free @ covariance) * free) + np.sum(seen**2))
    return None


def _symmetric(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """left @ right.T where that is known to be symmetric: half of it is the other, mirrored."""
    product, step = np.empty((len(left), len(right))), 1 + len(left) // 8
    for i in range(0, len(left), step):
        product[i : i + step, i:] = left[i : i + step] @ right[i:].T
        product[i:, i : i + step] = product[i : i + step, i:].T
    return product
