"""A periodic plant with a repetitive controller of its own period round it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.loops import memory as memories
from rcbook.loops.memory import Memory
from rcbook.loops.periodic.compensator import Compensator
from rcbook.loops.periodic.plant import PeriodicPlant
from rcbook.loops.periodic.recursion import Recursion, recursion
from rcbook.loops.periodic.window import Window, window


@dataclass(frozen=True, eq=False)
class PeriodicLoop:
    """Plant, compensator, memory and gain; a number for the memory is the period of a plain one.

    The memory is the plain one of the plant's period unless another is given.  `model` is the
    plant that the compensator was designed on, where that is another one and known.
    Raises ValueError when the periods of plants and compensator differ, and when what looks ahead
    does not fit into the delay of the memory.
    """

    plant: PeriodicPlant
    compensator: Compensator
    memory: Memory | float | None = None
    gain: float = 1.0
    model: PeriodicPlant | None = None

    def __post_init__(self) -> None:
        memory = self.period if self.memory is None else self.memory
        object.__setattr__(self, "memory", memories.as_memory(memory))
        object.__setattr__(self, "gain", zdomain.real_number(self.gain, "gain"))
        if len(self.compensator.taps) != self.period:
            raise ValueError(
                f"the compensator has {len(self.compensator.taps)} rows of taps and the plant "
                f"repeats every {self.period} samples; design both for the same intervals"
            )
        if self.model is not None and self.model.period != self.period:
            raise ValueError(
                f"the model repeats every {self.model.period} samples and the plant every "
                f"{self.period}; sample both at the same intervals"
            )
        if self.memory.first < self.advance:
            raise ValueError(
                f"compensator and memory look {self.look_ahead:g} samples ahead, which a period "
                f"of {self.memory.period:g} cannot hold; sample faster"
            )

    @property
    def period(self) -> int:
        """N, samples per period of plant and compensator."""
        return self.plant.period

    @property
    def advance(self) -> int:
        """L, samples of look-ahead of the compensator."""
        return self.compensator.advance

    @property
    def look_ahead(self) -> float:
        """Samples by which compensator and memory look ahead of a period ago."""
        return self.advance + self.memory.look_ahead

    @property
    def taps(self) -> np.ndarray:
        """(N, m) taps of the compensator, the gain included."""
        return self.gain * self.compensator.taps

    @cached_property
    def recursion(self) -> Recursion:
        """One period of the loop, built once."""
        return recursion(self.plant, self.taps, self.advance, self.memory)

    @property
    def has_window(self) -> bool:
        """Whether the memory is q z^-N, so that the loop is u = z^-N K u with one K."""
        taps, memory = self.memory.taps.size, self.memory
        centred = taps % 2 == 1 and memory.first + taps // 2 == self.period
        return centred and self.look_ahead <= self.period == memory.period

    @cached_property
    def window(self) -> Window:
        """K of a loop whose memory is one period with a short q, built once.

        Raises ValueError for another memory.
        """
        if not self.has_window:
            raise ValueError(
                f"the memory has {self.memory.taps.size} taps from z^-{self.memory.first} on; only "
                f"q z^-N with N = {self.period} is judged so: ask `verdict` or `multipliers`"
            )
        return window(self.plant, self.taps, self.advance, self.memory.taps)


def frozen(plant: PeriodicPlant, z: np.ndarray) -> np.ndarray:
    """Response (N, points) of the plant of each sample as if it lasted."""
    resolvent = np.linalg.inv(z[:, None, None] * np.eye(plant.order) - plant.a[:, None])
    return np.einsum("i,kzij,kj->kz", plant.c, resolvent, plant.b)


def factor(loop: PeriodicLoop, z: ArrayLike) -> np.ndarray:
    """z^N H (1 - gain C G) of each sample as if it lasted, (N, points), on the unit circle.

    Where no row exceeds one in magnitude a slow enough variation is stable.  Where a row winds
    round a point outside the unit circle, the powers of the one-period map grow exponentially
    with N before they decay, wherever the multipliers are.
    """
    z = np.ravel(np.asarray(z, dtype=complex))
    filtered = z**loop.advance * zdomain.evaluate(loop.taps.T, z)
    return memories.factor(loop.memory, filtered * frozen(loop.plant, z), z)


def mismatch(loop: PeriodicLoop, z: ArrayLike) -> np.ndarray:
    """G/G_model - 1 of each sample as if it lasted, (N, points); zero without a model."""
    z = np.ravel(np.asarray(z, dtype=complex))
    if loop.model is None:
        return np.zeros((loop.period, z.size), dtype=complex)
    return frozen(loop.plant, z) / frozen(loop.model, z) - 1
