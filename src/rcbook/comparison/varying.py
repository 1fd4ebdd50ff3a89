"""A controller that knows of one sampling interval, round a plant whose intervals vary.

The closed loop repeats with the plant, and is a `PeriodicPlant` itself: one for each source.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from rcbook.comparison.rivals import Feedback
from rcbook.loops.periodic import PeriodicPlant
from rcbook.loops.verdict import MARGIN, SOURCES
from rcbook.signals import signal


def closed(plant: PeriodicPlant, controller: Feedback | None, source: str) -> PeriodicPlant:
    """The loop u = r + K (r - y - noise) from a source to the output, without K the plant alone.

    The reference is fed to the plant and corrected, as in the plug-in form of `repetitive.Loop`.
    Raises ValueError for an unknown source.
    """
    if source not in SOURCES:
        raise ValueError(f"source {source!r} is none of {', '.join(SOURCES)}")
    f, g, h, direct = _states(controller)
    n, m, order = plant.period, plant.order, len(g)
    a, b = np.zeros((n, m + order, m + order)), np.zeros((n, m + order))
    a[:, :m, :m] = plant.a - direct * plant.b[:, :, None] * plant.c
    a[:, :m, m:] = plant.b[:, :, None] * h
    a[:, m:, :m] = -np.outer(g, plant.c)
    a[:, m:, m:] = f
    to_plant = {"reference": 1 + direct, "disturbance": 1.0, "noise": -direct}[source]
    to_controller = {"reference": 1.0, "disturbance": 0.0, "noise": -1.0}[source]
    b[:, :m], b[:, m:] = to_plant * plant.b, to_controller * g
    return PeriodicPlant(a, b, np.append(plant.c, np.zeros(order)), plant.intervals)


def commanded(plant: PeriodicPlant, controller: Feedback, loop: PeriodicPlant) -> PeriodicPlant:
    """A loop of `closed`, seen at its command instead of its output, but for what passes directly.

    A reference also passes directly, multiplied by one and the first coefficient of K.
    """
    _, _, h, direct = _states(controller)
    return replace(loop, c=np.append(-direct * plant.c, h))


def _states(controller: Feedback | None) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """f, g, h and direct of a controller: x+ = f x + g e, u = h x + direct e."""
    if controller is None:
        return np.zeros((0, 0)), np.zeros(0), np.zeros(0), 0.0
    size = max(controller.numerator.size, controller.denominator.size, 2)
    b, a = (np.pad(p, (0, size - p.size)) for p in (controller.numerator, controller.denominator))
    b, a = b / a[0], a / a[0]
    companion = np.eye(size - 1, k=1)
    companion[:, 0] = -a[1:]
    f, basis = _modal(companion)
    return f, np.linalg.solve(basis, b[1:] - a[1:] * b[0]), basis[0], float(b[0])


def _modal(companion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same matrix in blocks of one or two rows, and the basis in which it is so.

    Harmonics lie close together, and powers of their companion matrix are nothing but rounding.
    Each mode is scaled to be seen with weight one.
    """
    values, vectors = np.linalg.eig(companion)
    vectors = vectors / np.where(np.abs(vectors[0]) > 0, vectors[0], 1)
    f, basis, at = np.zeros(companion.shape), np.zeros(companion.shape), 0
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag < 0:
            continue
        pair = 2 if value.imag else 1
        own = slice(at, at + pair)
        f[own, own] = np.array([[value.real, value.imag], [-value.imag, value.real]])[:pair, :pair]
        basis[:, own] = np.array([vector.real, vector.imag]).T[:, :pair]
        at += pair
    return f, basis


def one_period(loop: PeriodicPlant, driven: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Matrix of one period, and the state at its end after an input of one period from rest."""
    v, matrix, state = signal(driven, "input", loop.period), np.eye(loop.order), 0.0
    for a, b, at in zip(loop.a, loop.b, v, strict=True):
        matrix, state = a @ matrix, a @ np.broadcast_to(state, loop.order) + b * at
    return matrix, state


def spectral_radius(loop: PeriodicPlant) -> float:
    """Largest growth of a mode over one period."""
    return float(np.abs(np.linalg.eigvals(one_period(loop, np.zeros(loop.period))[0])).max())


def answer(loop: PeriodicPlant, driven: ArrayLike, start: ArrayLike | None = None) -> np.ndarray:
    """Output to an input of whole periods, from rest or from a state."""
    v = signal(driven, "input")
    state = np.zeros(loop.order) if start is None else np.asarray(start, dtype=float)
    output = np.empty(v.size)
    for k in range(v.size):
        output[k] = loop.c @ state
        state = loop.a[k % loop.period] @ state + loop.b[k % loop.period] * v[k]
    return output


def repeated(loop: PeriodicPlant, driven: ArrayLike) -> np.ndarray:
    """Output to an input, of whole periods, that has been repeated for ever.

    Raises ValueError for an input of another length, and for a loop that is not stable.
    """
    v, n = signal(driven, "input"), loop.period
    if v.size % n:
        raise ValueError(f"{v.size} samples are no whole periods of {n}; cut or repeat them")
    radius = spectral_radius(loop)
    if not radius < 1:
        raise ValueError(f"largest multiplier {radius:.9g}: the loop has no steady state")
    total, end = np.eye(loop.order), np.zeros(loop.order)
    for part in v.reshape(-1, n):
        matrix, driven_end = one_period(loop, part)
        total, end = matrix @ total, matrix @ end + driven_end
    return answer(loop, v, np.linalg.solve(np.eye(loop.order) - total, end))


def noise_gain(loop: PeriodicPlant) -> float:
    """Stationary standard deviation of the output per unit of white noise at the input of `closed`.

    Root mean square over the period; infinite for a loop that is not stable.
    """
    radius = spectral_radius(loop)
    if not radius < 1 - MARGIN:
        return np.inf
    covariance, powers = np.zeros((loop.order, loop.order)), []
    for _ in range(int(np.ceil(np.log(1e-12) / np.log(max(radius, 1e-12)))) + 2):
        powers = []
        for a, b in zip(loop.a, loop.b, strict=True):
            powers.append(loop.c @ covariance @ loop.c)
            covariance = a @ covariance @ a.T + np.outer(b, b)
    return float(np.sqrt(np.mean(powers)))
