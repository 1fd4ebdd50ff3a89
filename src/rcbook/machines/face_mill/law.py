"""The controllers of several experiments side by side, and what they are shown."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rcbook import zdomain
from rcbook.machines.face_mill.experiment import Controller, Experiment
from rcbook.machines.face_mill.readings import LOGGED, MEASURES


class Law(NamedTuple):
    """The controllers side by side: coefficients (reach, runs), latest sample last."""

    numerator: np.ndarray
    denominator: np.ndarray  # of the samples before, sign reversed
    reach: int  # samples of memory
    first: np.ndarray  # sample from which the controller is at work
    target: np.ndarray
    base: np.ndarray  # V, command of the nominal speed
    row: np.ndarray  # of the log that is controlled
    window: np.ndarray  # 0 sample, 1 interval, 2 pitch
    windows: set  # those that occur
    every: int  # steps per sample
    holds: np.ndarray  # whether the velocity integral stops at the limit

    def sample(
        self, signals: tuple[np.ndarray, ...], log: np.ndarray, number: int, moving: bool
    ) -> np.ndarray:
        """What the controllers add to the command at a sample, from the log of the last pitch.

        What they saw, the error and what they sent is read from and written to the `signals`.
        """
        k, (seen, error, sent) = self.reach + number, signals
        seen[k] = self.measure(log)
        error[k] = np.where(moving & (number >= self.first), self.target - seen[k], 0.0)
        sent[k] = self.answer(error, sent, k)
        return sent[k]

    def measure(self, log: np.ndarray) -> np.ndarray:
        """What the controllers are shown, from the log of the last tooth pitch."""
        runs = np.arange(self.row.size)
        shown = log[-1, self.row, runs]
        for window, part in ((1, log[-self.every :]), (2, log)):
            if window in self.windows:
                largest = part[:, self.row, runs].max(axis=0)
                shown = np.where(self.window == window, largest, shown)
        return shown

    def answer(self, error: np.ndarray, sent: np.ndarray, k: int) -> np.ndarray:
        """What the controllers add to the command at row k of errors and earlier answers."""
        errors, answers = error[k - self.reach + 1 : k + 1], sent[k - self.reach : k]
        by_error = np.einsum("kr,kr->r", self.numerator, errors)
        return by_error + np.einsum("kr,kr->r", self.denominator, answers)


def law_of(group: list[Experiment]) -> Law:
    samples = group[0].mill.samples_per_turn
    numerators, denominators = [], []
    for one in group:
        n, d = (np.zeros(1), np.ones(1)) if one.controller is None else _fraction(one.controller)
        numerators.append(n / d[0])
        denominators.append(-d[1:] / d[0])
    reach = max(map(len, numerators + denominators))
    stacked = (
        np.array([np.pad(p, (0, reach - len(p)))[::-1] for p in ps]).T
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
        windows={MEASURES.index(one.measure) for one in group},
        every=group[0].substeps,
        holds=np.array([one.limit == "hold" for one in group]),
    )


def _fraction(controller: Controller) -> tuple[np.ndarray, np.ndarray]:
    numerator = zdomain.polynomial(controller.numerator, "controller numerator")
    denominator = zdomain.polynomial(controller.denominator, "controller denominator")
    if denominator[0] == 0:
        raise ValueError(f"controller denominator {denominator} begins with 0; it is not causal")
    return numerator, denominator
