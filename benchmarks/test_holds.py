"""Plants held at many different intervals, and their inverses."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

from rcbook.loops import periodic
from rcbook.machines.boring_bar import HANSON_TSAO2000

STAGE = HANSON_TSAO2000.plant
SCALED = periodic.balanced(STAGE)
LATE = 0.4 * HANSON_TSAO2000.sampling_interval
GOALS = {32: 1.0, 1200: 20.0, 20_000: 20.0}


def intervals(n: int) -> np.ndarray:
    """n of them, no two alike."""
    unit = HANSON_TSAO2000.sampling_interval
    return unit * np.random.default_rng(0).uniform(0.7, 1.3, n)


def joint() -> np.ndarray:
    """The continuous plant with its held input as one more state."""
    n = SCALED.nstates
    matrix = np.zeros((n + 1, n + 1))
    matrix[:n, :n], matrix[:n, n] = SCALED.A, SCALED.B[:, 0]
    return matrix


@pytest.mark.parametrize("n", GOALS)
def test_sampled_at_different_intervals(row, n):
    spans, matrix = intervals(n), joint()
    row.faster(
        lambda: periodic.sample(STAGE, spans),
        lambda: [scipy.linalg.expm(matrix * span) for span in spans],
        GOALS[n],
        rounds=3 if n > 10_000 else 7,
        question=f"sampled at {n} different intervals, plant order 6",
        against="scipy.linalg.expm of each",
    )


def test_sampled_behind_a_delay(row):
    spans, matrix = intervals(1200), joint()

    def each() -> list[np.ndarray]:
        expm, found = scipy.linalg.expm, []
        for span in spans:
            early, rest = expm(matrix * LATE), expm(matrix * (span - LATE))
            found.append((expm(matrix * span), rest @ early, rest))
        return found

    row.faster(
        lambda: periodic.sample(STAGE, spans, LATE),
        each,
        10.0,
        question="the same behind a delay, 1200 intervals",
        against="scipy.linalg.expm, three for each",
    )


@pytest.mark.parametrize("n", [1200, 20_000])
def test_zero_phase_inverses(row, n):
    spans = intervals(n)
    row.floors(
        lambda: periodic.zero_phase(STAGE, spans),
        lambda: periodic.sample(STAGE, spans),
        5.0,
        question=f"zero-phase inverses at {n} different intervals",
        against="periodic.sample at the same intervals",
    )
