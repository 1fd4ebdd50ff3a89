"""The record of a simulation, and the limits that its signals may meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

BOUND = 1e30  # times the largest input, whatever the units: a loop that ran away


@dataclass(frozen=True)
class Limit:
    """A symmetric limit on a signal, and whether its recursion goes on from the clipped value."""

    value: float = np.inf
    remember_clipped: bool = True

    def __post_init__(self) -> None:
        if not self.value > 0:
            raise ValueError(f"limit {self.value!r} must be positive")


@dataclass(frozen=True)
class Limits:
    """Limits on the command to the plant and on what the repetitive controller sends."""

    command: Limit = Limit()
    repetitive: Limit = Limit()


FREE = Limits()


@dataclass(frozen=True, eq=False)
class Run:
    """Signals of one simulation, each of n samples, in the units of the plant.

    It ends early, and is `unbounded`, where a signal exceeds 1e30 times the largest input.
    """

    time: np.ndarray  # s, sampling instants
    reference: np.ndarray
    disturbance: np.ndarray  # at the plant input
    noise: np.ndarray  # on the measured output
    output: np.ndarray
    command: np.ndarray  # what the plant gets, without the disturbance
    repetitive: np.ndarray  # what the repetitive controller sends
    unbounded: bool = False
    command_clipped: int = 0  # samples at which the limit on the command acted
    repetitive_clipped: int = 0

    @property
    def error(self) -> np.ndarray:
        """Reference minus output, without measurement noise."""
        return self.reference - self.output

    @property
    def measured_error(self) -> np.ndarray:
        """Reference minus measured output: what the controller sees."""
        return self.error - self.noise
