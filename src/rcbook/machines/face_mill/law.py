"""The controllers of several experiments side by side, and what they are shown."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rcbook import zdomain
from rcbook.machines.face_mill.experiment import Controller, Experiment
from rcbook.machines.face_mill.readings import LOGGED, MEASURES


class Law(NamedTuple):
    """The controllers side by side: coefficients (reach, runs), latest sample first."""

    numerator: np.ndarray
    denominator: np.ndarray  # of the samples before, sign reversed
    reach: int  # samples of memory
    first: np.ndarray  # sample from which the controller is at work
    target: np.ndarray
    base: np.ndarray  # V, command of the nominal speed
    row: np.ndarray  # of the log that is controlled
    window: np.ndarray  # 0 sample, 1 interval, 2 pitch
    holds: np.ndarray  # 1 where the velocity integral stops at the limit

    def measure(self, log: np.ndarray, every: int) -> np.ndarray:
        """What the controllers are shown, from the log of the last tooth pitch."""
        runs = np.arange(self.row.size)
        recent = (log[-1:], log[-every:], log)
        return np.choose(self.window, [part[:, self.row, runs].max(axis=0) for part in recent])

    def answer(self, error: np.ndarray, sent: np.ndarray, k: int) -> np.ndarray:
        """What the controllers add to the command at row k of errors and earlier answers."""
        errors = error[k - self.reach + 1 : k + 1][::-1]
        answers = sent[k - self.reach : k][::-1]
        return (self.numerator * errors).sum(axis=0) + (self.denominator * answers).sum(axis=0)


def law_of(group: list[Experiment]) -> Law:
    samples = group[0].mill.samples_per_turn
    numerators, denominators = [], []
    for one in group:
        n, d = (np.zeros(1), np.ones(1)) if one.controller is None else _fraction(one.controller)
        numerators.append(n / d[0])
        denominators.append(-d[1:] / d[0])
    reach = max(map(len, numerators + denominators))
    stacked = (
        np.array([np.pad(p, (0, reach - len(p))) for p in ps]).T
        for ps in (numerators, denominators)
    )
    return Law(
        *stacked,
        reach,
        first=np.array([(one.controlled - 1) * samples for one in group]),
        target=np.array([one.target for one in group]),
        base=np.array([one.mill.drive.tacho_gain * one.mill.speed for one in group]),
        row=np.array([LOGGED.index(one.output) for one in group]),
        window=np.array([MEASURES.index(one.measure) for one in group]),
        holds=np.array([one.limit == "hold" for one in group], dtype=int),
    )


def _fraction(controller: Controller) -> tuple[np.ndarray, np.ndarray]:
    numerator = zdomain.polynomial(controller.numerator, "controller numerator")
    denominator = zdomain.polynomial(controller.denominator, "controller denominator")
    if denominator[0] == 0:
        raise ValueError(f"controller denominator {denominator} begins with 0; it is not causal")
    return numerator, denominator
