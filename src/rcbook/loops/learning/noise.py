"""What white noise makes of a learned pass, by the three ways in which a pass begins.

Whatever the start, command and signal of pass L are

    u_(L+1) = F u_L + B s_L,    x_L = C u_L + D s_L

for a source s that is white and new in every pass: a number for each harmonic of passes that
repeat for ever, matrices for passes from rest, and a recursion over samples for a continuous run.
"""

from __future__ import annotations

import numpy as np

from rcbook import zdomain
from rcbook.loops.learning.judgement import factor, require_limit
from rcbook.loops.learning.passes import run_on
from rcbook.loops.learning.scheme import Scheme, answer, one_pass
from rcbook.loops.verdict import require_ends
from rcbook.zdomain import add, multiply


def noise_gain(
    scheme: Scheme, output: str = "output", source: str = "noise", *, passes: int | None = None
) -> float:
    """Standard deviation of an output per unit of white noise at a source, rms over the pass.

    In the end, or after `passes` learnings.  The noise is another in every pass, also that of the
    reference, which the command of pass 0 does not follow.  "repetitive" is the command.  In the
    end commands that answer after a pass from rest are left out.
    Raises ValueError in the end of a scheme that is not stable, and for unknown names.
    """
    require_ends(output, source)
    if passes is None:
        require_limit(scheme)
    else:
        passes = zdomain.whole_number(passes, "passes", 0)
    if scheme.start.before != "previous":
        variance = _apart(scheme, output, source, passes)
    elif passes is None:
        variance = _running(scheme, output, source)
    else:
        variance = _running_for(scheme, output, source, passes)
    return float(np.sqrt(variance))


def _apart(scheme: Scheme, output: str, source: str, passes: int | None) -> float:
    """Variance from F, B and G as stacks of matrices: one by one a harmonic, or a single one."""
    parts = _harmonics if scheme.start.before == "itself" else _lifted
    f, b, g = parts(scheme, source)
    direct = _direct(g, output, source)
    if passes is None and scheme.start.before == "rest":
        k = scheme.corrected
        f, b, g = f[:, :k, :k], b[:, :k], g[:, :, :k]
    spread = b @ b.conj().mT
    if passes is None:
        while np.abs(f).max() > 1e-10:
            spread = spread + f @ spread @ f.conj().mT  # the sum of twice as many powers
            f = f @ f
    else:
        terms, spread = spread, np.zeros_like(spread)
        for _ in range(passes):
            spread = f @ spread @ f.conj().mT + terms
    heard = spread if output in ("command", "repetitive") else g @ spread @ g.conj().mT
    power = sum(np.trace(x, axis1=1, axis2=2).real for x in (heard, direct @ direct.conj().mT))
    return np.mean(power) / len(g[0])


def _harmonics(scheme: Scheme, source: str) -> tuple[np.ndarray, ...]:
    z = zdomain.unit_circle(scheme.period)
    g = zdomain.response(scheme.plant, z)
    once = scheme.controller.memory.gain(z) * zdomain.response(scheme.law.filter, z)
    b = {"reference": once, "disturbance": -once * g, "noise": -once}[source]
    return tuple(x[:, None, None] for x in (factor(scheme, z), b, g))


def _lifted(scheme: Scheme, source: str) -> tuple[np.ndarray, ...]:
    units, nothing = np.eye(scheme.period), np.zeros(scheme.period)
    w, r, n = (units if s == source else nothing for s in ("disturbance", "reference", "noise"))
    b = one_pass(scheme, nothing, w, r, n, 0.0)[1].T
    return scheme.one_pass[None], b[None], answer(scheme, units, 0.0).T[None]


def _direct(g: np.ndarray, output: str, source: str) -> np.ndarray:
    """What reaches an output within the pass, by no command."""
    one = np.broadcast_to(np.eye(g.shape[-1]), g.shape)
    if (output, source) == ("output", "disturbance"):
        return g
    if output in ("error", "measured_error") and source != "noise":
        return one if source == "reference" else -g
    return -one if (output, source) == ("measured_error", "noise") else 0 * g


# ---- a continuous run ----


def _running(scheme: Scheme, output: str, source: str) -> float:
    """Variance of a continuous run in the end."""
    largest = float(np.abs(scheme.roots).max(initial=0.0))
    return zdomain.rms_gain(_numerator(scheme, output, source), scheme.polynomial, largest) ** 2


def _numerator(scheme: Scheme, output: str, source: str) -> np.ndarray:
    """Of the transfer from a source, new in every sample, over the scheme's polynomial."""
    b, a = scheme.plant.numerator, scheme.plant.a
    learning, memory = scheme.controller.numerator, scheme.controller.denominator
    command = {
        "reference": multiply(a, learning),
        "disturbance": -multiply(b, learning),
        "noise": -multiply(a, learning),
    }
    heard = {
        "reference": multiply(b, learning),
        "disturbance": multiply(b, memory),
        "noise": -multiply(b, learning),
    }
    if output in ("command", "repetitive"):
        return command[source]
    if output == "output":
        return heard[source]
    return add(_share(output, source) * scheme.polynomial, -heard[source])


def _share(output: str, source: str) -> int:
    """How much of a source is an error itself: the reference, and the noise that is measured."""
    return {"reference": 1, "disturbance": 0, "noise": -(output == "measured_error")}[source]


def _running_for(scheme: Scheme, output: str, source: str, passes: int) -> float:
    """Variance in one pass of a run, from its answers to one unit of noise at one sample.

    The run answers alike to all units but the first ones, by which the end of pass 0 would have
    been corrected.
    """
    n, ahead = scheme.period, scheme.look_ahead
    variance, units = np.zeros(n), np.eye(ahead + 1, (passes + 1) * n)
    for unit in units[:-1]:
        variance += _answer_to(scheme, output, source, unit)[-n:] ** 2
    variance += np.cumsum(_answer_to(scheme, output, source, units[-1]) ** 2)[-n:]
    return np.mean(variance)


def _answer_to(scheme: Scheme, output: str, source: str, unit: np.ndarray) -> np.ndarray:
    nothing, still = np.zeros(unit.size), np.zeros(scheme.period)
    seen = {"reference": -unit, "disturbance": nothing, "noise": unit}[source]
    w = unit if source == "disturbance" else nothing
    u, y = (s.ravel() for s in run_on(scheme, still, w, seen, still, 0.0))
    if output in ("command", "repetitive"):
        return u
    return y if output == "output" else _share(output, source) * unit - y
