"""Stability of a repetitive loop: its factor, its roots, and the gains that keep them inside."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.loops import memory
from rcbook.loops import verdict as judging
from rcbook.loops.memory import RepetitiveController, Resonators
from rcbook.loops.repetitive.loop import Loop, Process, as_loop, characteristic_polynomial
from rcbook.loops.repetitive.radii import SHORT, spectral_radii
from rcbook.loops.verdict import MARGIN, Verdict
from rcbook.zdomain import Plant, multiply
from rcbook.zdomain.crossings import crossings, outside

Gains = list[tuple[float, float]]


def factor(loop: Loop, z: ArrayLike) -> np.ndarray:
    """z^N H (1 - gain C G) at points z: what a period leaves of an error; see `loops.memory`.

    Below one in magnitude on the whole unit circle it makes a loop round a stable process stable.
    With resonators, whose C H is their numerator over the gain, 1 - H is their denominator.
    Raises ValueError when the loop has no repetitive controller.
    """
    controller, z = loop.require_controller(), np.asarray(z)
    response = zdomain.response(loop.process.command_path, z)
    if isinstance(controller, RepetitiveController):
        compensated = controller.gain * zdomain.response(controller.compensator, z) * response
        return memory.factor(controller.memory, compensated, z)
    remembered = 1 - zdomain.evaluate(controller.denominator, z)
    return z**controller.period * (
        remembered - zdomain.evaluate(controller.numerator, z) * response
    )


def mismatch(loop: Loop, z: ArrayLike) -> np.ndarray:
    """G/G_model - 1 at points z, G from u to the output; 0 where no other model is known."""
    if loop.model is None:
        return np.zeros(np.shape(z), dtype=complex)
    ours, model = (zdomain.response(p.command_path, z) for p in (loop.process, loop.model))
    return ours / model - 1


def roots(loop: Loop | Process | Plant) -> np.ndarray:
    """Closed-loop roots, one step of them a sample, by decreasing magnitude.

    They come from exact coefficients, never from a rebuilt transfer function; that holds for
    periods up to some thousand samples.
    """
    return as_loop(loop).roots


def spectral_radius(loop: Loop | Process | Plant) -> float:
    """Largest growth of a mode over one period; over one sample without a controller."""
    loop = as_loop(loop)
    if loop.repetitive is not None and characteristic_polynomial(loop).size > SHORT:
        return float(spectral_radii(loop, loop.repetitive.gain))
    largest = np.abs(loop.roots).max(initial=0.0)
    with np.errstate(over="ignore"):
        return float(largest ** (loop.period or 1))


def verdict(loop: Loop | Process | Plant) -> Verdict:
    """Whether a loop is stable: its roots outside of the unit circle are counted, not found.

    A root within 1e-9 of the circle makes it "undecided", unless others lie outside, and so does a
    root of several orders there, which double precision does not see.
    """
    polynomial = np.trim_zeros(characteristic_polynomial(loop), "b")
    method, degree = "argument principle", polynomial.size - 1
    try:
        perhaps, surely = (outside(polynomial, 1 + side * MARGIN) for side in (-1, 1))
    except ZeroDivisionError:
        return Verdict("undecided", method, "a multiple root on the unit circle, or next to it")
    known = perhaps == surely
    word = "unstable" if surely else "stable" if known else "undecided"
    certificate = f"{surely} of {degree} roots outside the unit circle"
    if not known:
        certificate += f", {perhaps - surely} within {MARGIN:g} of it"
    return Verdict(word, method, certificate, surely if known else None)


def require_stable(loop: Loop | Process | Plant) -> None:
    """Raise ValueError, with grounds and mend, unless the loop is stable."""
    loop = as_loop(loop)
    mend = "stabilise the process"
    if loop.repetitive is not None:
        gain = loop.repetitive.gain
        mend = f"its repetitive gain is {gain!r}, `stable_gains` lists those that hold"
    judging.require_stable(verdict(loop), mend)


def stable_gains(loop: Loop, highest: float = 100.0) -> Gains:
    """Every interval of repetitive gains up to `highest` in which the loop is stable.

    Between the gains that put a root on the unit circle, which are all found, the number of roots
    outside does not change; it is counted at two gains, and again where there is none.
    Raises ValueError when the loop has no repetitive controller.
    """
    return _stable_factors(*loop.with_gain(1.0).open_polynomials, highest)


def gain_limit(loop: Loop) -> float:
    """Largest gain up to which the loop is stable from zero on; 0 when small gains are unstable.

    A result of 100 means that the search of `stable_gains` found no end.
    """
    intervals = stable_gains(loop)
    return intervals[0][1] if intervals and intervals[0][0] == 0 else 0.0


def controller_gains(process: Process, highest: float = 100.0) -> Gains:
    """Every interval of factors up to `highest` on the inner controller that leave it stable.

    Raises ValueError when the process has no controller.
    """
    return _stable_factors(*controller_polynomials(process), highest)


def controller_polynomials(process: Process) -> tuple[np.ndarray, np.ndarray]:
    """d and n, in z^-1 and equally long, of the closed loop d + k n at k times the controller.

    Raises ValueError when the process has no controller.
    """
    if process.controller is None:
        raise ValueError("the process has no controller whose gain could be changed; give it one")
    n, c, _ = process.parts
    d, n = multiply(c, process.plant.a), multiply(process.plant.numerator, n)
    length = max(d.size, n.size)
    return np.pad(d, (0, length - d.size)), np.pad(n, (0, length - n.size))


def _stable_factors(d: np.ndarray, n: np.ndarray, highest: float) -> Gains:
    """Every interval of factors k up to `highest` for which d + k n has all roots inside."""
    highest = zdomain.real_number(highest, "highest", positive=True)
    length = max(d.size, n.size)
    d, n = (np.pad(p, (0, length - p.size)) for p in (d, n))

    def count(gain: float, radius: float = 1.0) -> int | None:
        """Roots outside of a circle; None when there is one on it."""
        try:
            return outside(np.trim_zeros(d + gain * n, "b"), radius)
        except ZeroDivisionError:
            return None

    for points in (8, 64, 512):
        edges, more = _intervals(*crossings(d, n, points), highest)
        middles = (edges[1:] + edges[:-1]) / 2
        one, other = np.argsort(-np.diff(edges), kind="stable")[[0, min(1, more.size - 1)]]
        known = count(middles[one])
        if known is None:
            return []
        counts = more - more[one] + known
        if count(middles[other]) == counts[other]:
            break
    else:
        raise ValueError("the roots that cross the unit circle are not those that lie outside")

    def stable(gain: float) -> bool:
        settled = counts[np.searchsorted(edges, gain) - 1] == 0
        return bool(settled and count(gain, 1 - MARGIN) == 0)

    return _merge(edges, stable)


def _intervals(
    gains: np.ndarray, more: np.ndarray, highest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Edges from 0 to `highest`, and how many more roots than at first lie outside between them."""
    # Where d has double roots on the circle, rounding puts crossings at gains of some 1e-9.
    within = (gains > 1e-7) & (gains < highest)
    edges = np.concatenate([[0.0], gains[within], [highest]])
    more = np.cumsum(np.append(0, more[within]))
    apart = np.append(True, np.diff(edges) > 1e-9)
    return edges[apart], more[np.flatnonzero(apart)[1:] - 1]


def _merge(edges: np.ndarray, stable: Callable[[float], bool]) -> Gains:
    """Stable intervals; neighbours are joined where the circle is touched and not crossed."""
    intervals: list[list[float]] = []
    for low, high in pairwise(edges):
        if not stable((low + high) / 2):
            continue
        if intervals and intervals[-1][1] == low and stable(low):
            intervals[-1][1] = float(high)
        else:
            intervals.append([float(low), float(high)])
    return [(low, high) for low, high in intervals]


def unstable_roots(
    repetitive: RepetitiveController | Resonators, plant: Callable[[np.ndarray], np.ndarray]
) -> int:
    """Closed-loop roots outside the unit circle, counted from the plant's frequency response.

    `plant` gives the response, model or measurement, of a real and stable plant at an array of
    points z of the upper half of the circle.  The turns round the origin of 1 - H (1 - gain C G)
    are counted, on a grid that is refined until no step turns by more than 1 rad.
    Raises ValueError when a root lies on the circle, or too close to tell.
    """
    numerator, denominator = repetitive.numerator, repetitive.denominator
    stable = repetitive.compensator.a if isinstance(repetitive, RepetitiveController) else [1.0]

    def around(angle: np.ndarray) -> np.ndarray:
        z, response = np.exp(1j * angle), np.asarray(plant(np.exp(1j * angle)))
        if response.shape != z.shape:
            raise ValueError(f"plant(z) has shape {response.shape} for {z.size} points z")
        whole = zdomain.evaluate(denominator, z) + zdomain.evaluate(numerator, z) * response
        return whole / zdomain.evaluate(np.asarray(stable), z)

    # The ends, next to z = 1 and z = -1, are closed by their mirror images.
    inset = np.pi * 1e-6
    turned = zdomain.turns_round_origin(around, inset, np.pi - inset, 16 * denominator.size)
    first, last = around(np.array([inset, np.pi - inset]))
    closing = np.angle(first / first.conj()) + np.angle(last.conj() / last)
    return -round(2 * turned + closing / (2 * np.pi))
