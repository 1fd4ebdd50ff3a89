"""Periodic loops: stability

What a user would do: form the matrix of one period and take all its eigenvalues.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rcbook import zdomain
from rcbook.loops import periodic
from rcbook.machines.boring_bar import HANSON_TSAO2000, sinusoidal_intervals

Q20 = zdomain.symmetric_fir([0.8, 0.1])
PERIOD, LONG = 1200, 100_000
ALL = "all eigenvalues of the one-period matrix"


def loop_of(n, gamma=0.3, q=(1.0,), nominal=False):
    """The design on the boring bar, gain-scheduled or for the mean interval."""
    bar = HANSON_TSAO2000
    intervals = sinusoidal_intervals(bar.sampling_interval, gamma, n)
    designed = np.full(n, bar.sampling_interval) if nominal else intervals
    plant = periodic.sample(bar.plant, intervals)
    return periodic.PeriodicLoop(
        plant, periodic.zero_phase(bar.plant, designed), periodic.plain(n, q)
    )


def by_matrix(loop):
    """Largest eigenvalue of the matrix of the appendix, formed in the fastest of three ways."""
    return np.abs(np.linalg.eigvals(periodic.lifted(loop))).max()


BY = {"energy": loop_of(PERIOD), "count": loop_of(PERIOD, 0.1, nominal=True)}


@pytest.mark.parametrize("method", BY)
def test_verdict(row, method):
    loop = BY[method]
    assert periodic.verdict(replace(loop)).method == method
    row.faster(
        lambda: periodic.verdict(replace(loop)),  # a loop that has not been judged
        lambda: by_matrix(loop),
        goal=10,
        rounds=3,
        question=f"periodic verdict, N = 1200, by {method}",
        against=ALL,
    )


@pytest.mark.long
@pytest.mark.parametrize("method", BY)
def test_design_and_verdict_of_a_long_period(row, method):
    """Long to run: one round.  The peer is what a short period takes."""
    gamma, nominal = (0.3, False) if method == "energy" else (0.1, True)
    row.floors(
        lambda: periodic.verdict(loop_of(LONG, gamma, nominal=nominal)),
        lambda: by_matrix(BY["energy"]),
        goal=60,
        rounds=1,
        question=f"design and verdict, N = 1e5, by {method}",
        against="all eigenvalues at N = 1200",
    )


@pytest.mark.parametrize("method", BY)
def test_growth_of_a_verdict(row, method):
    gamma, nominal = (0.3, False) if method == "energy" else (0.1, True)

    def make(n):
        loop = loop_of(n, gamma, nominal=nominal)
        return lambda: periodic.verdict(replace(loop))

    row.growth(
        (1000, 3000, 10_000, 30_000),
        make,
        goal=1.2,
        rounds=2,
        question=f"growth of a verdict with N, by {method}",
        against="N = 1e3 .. 3e4",
    )


@pytest.mark.parametrize(
    ("n", "goal"), [(PERIOD, 1.0), pytest.param(LONG, 60.0, marks=pytest.mark.long)]
)
def test_spectral_radius(row, n, goal):
    loop = loop_of(n, q=Q20)
    row.seconds(
        lambda: periodic.spectral_radius(replace(loop)),
        goal,
        rounds=3 if n == PERIOD else 1,
        question=f"spectral radius held by counts, N = {n}",
        against="",
    )
