"""Counts, verdicts and spectral radii of long periods, by eigenvalues and closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from oracles.periodic import bar_loop, closed_form_modes

from rcbook import zdomain
from rcbook.loops import periodic
from rcbook.loops.periodic import Compensator

Q20 = zdomain.symmetric_fir([0.8, 0.1])
QS = ((1.0,), Q20, zdomain.binomial_q())


def sizes(loop):
    """Magnitudes of the dense eigenvalues, of the matrix and of its transpose."""
    matrix = periodic.dense(loop)
    return [np.sort(np.abs(np.linalg.eigvals(m)))[::-1] for m in (matrix, matrix.T)]


def slow_loop(seed):
    """A design on the bar that looks ahead by a fraction of a sample more or less than its plant:
    its largest multipliers are pairs at any angle, each alive near one part of the period."""
    rng = np.random.default_rng(seed)
    loop = bar_loop(int(rng.integers(60, 130)), rng.uniform(0.0, 0.5), q=QS[seed % 3])
    taps, share = np.pad(loop.compensator.taps, ((0, 0), (0, 1))), rng.uniform(0.0, 0.2)
    taps = (1 - share) * taps + share * np.roll(taps, 1, axis=1)
    return replace(
        loop, compensator=Compensator(taps, loop.advance), gain=float(rng.uniform(0.3, 2.3))
    )


@pytest.mark.parametrize("inside", [1e-5, 1e-3])
def test_a_pair_just_outside_is_not_overlooked(inside):
    """It lies a few 1e-5 off the real axis, at the slowest sample: no factor shows it alone."""
    loop = bar_loop(512, 0.3, q=Q20)
    ours, theirs = sizes(loop)
    radius = ours[0] * (1 - inside)
    expected = np.sum(ours > radius)
    assert expected == np.sum(theirs > radius) >= 2
    assert periodic.count_outside(loop, radius).outside == expected
    assert periodic.count_outside(loop, ours[0] * (1 + inside)).outside == 0


@pytest.mark.parametrize("seed", range(6))
def test_counts_near_the_largest_multipliers_are_those_of_the_eigenvalues(seed):
    loop = slow_loop(seed)
    ours, theirs = sizes(loop)
    for share in (1 + 1e-5, 1 - 1e-5, 0.999):
        radius = share * ours[0]
        found = periodic.count_outside(loop, radius, 400)
        assert found.outside in (None, np.sum(ours > radius)), found
        assert np.sum(ours > radius) == np.sum(theirs > radius)
        assert (found.outside is None) <= (found.largest_change > 1e-3 or found.points >= 400)


def at_the_limit(loop):
    """The loop with the gain at which its dense spectral radius is 1, to 1e-4."""
    low, high = 0.02, 6.0
    while high - low > 1e-4:
        middle = (low + high) / 2
        unstable = sizes(replace(loop, gain=middle))[0][0] > 1
        low, high = (low, middle) if unstable else (middle, high)
    return low


@pytest.mark.parametrize("seed", range(10))
def test_no_wrong_verdict_round_the_limit_of_the_gain(seed):
    """Below, at and beyond the gain at which the dense eigenvalues cross the circle."""
    rng = np.random.default_rng(100 + seed)
    loop = bar_loop(int(rng.integers(20, 70)), rng.uniform(0.0, 0.7), q=QS[seed % 3])
    limit = at_the_limit(loop)
    for share in (0.97, 1 - 1e-3, 1 + 1e-3):
        other = replace(loop, gain=share * limit)
        radius = sizes(other)[0][0]
        found = periodic.verdict(other)
        assert found.verdict == ("stable" if radius < 1 else "unstable"), (radius, found)


# ---- the radius ----


@pytest.mark.parametrize(("gain", "q"), [(0.7, (1.0,)), (0.7, Q20), (2.2, (1.0,)), (1.6, Q20)])
def test_radius_of_a_time_invariant_loop_is_that_of_its_modes(gain, q):
    """Modes of z^N = q (1 - gain |B|^2/b) by fixed-point iteration; |m| is good to N roundings."""
    n = 600
    expected = np.abs(closed_form_modes(n, gain, np.asarray(q))[1]).max()
    loop = bar_loop(n, 0.0, q=q, gain=gain)
    assert periodic.spectral_radius(loop) == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize(
    ("n", "gamma", "design", "q"),
    [(512, 0.3, "scheduled", Q20), (400, 0.6, "scheduled", (1.0,)), (320, 0.1, "nominal", (1.0,))],
)
def test_radius_of_a_long_period_is_that_of_the_eigenvalues(n, gamma, design, q):
    """Of the nominal design the frozen factor is largest elsewhere: a first shift finds others."""
    loop = bar_loop(n, gamma, design, q)
    ours, theirs = sizes(loop)
    assert ours[0] == pytest.approx(theirs[0], rel=1e-9)
    assert periodic.spectral_radius(loop) == pytest.approx(ours[0], rel=1e-9)
    low, high = periodic.radius_bounds(loop, 1e-4)
    assert low < ours[0] < high <= low + 1.001e-4


def test_a_radius_that_rounding_decides_is_refused_and_its_bounds_are_wide():
    """The eigenvalues of the matrix and of its transpose differ by more than 1e-3."""
    loop = bar_loop(512, 0.5, "nominal")
    with pytest.raises(ValueError, match="no multiplier of the loop of N = 512 could be held"):
        periodic.spectral_radius(loop)
    low, high = periodic.radius_bounds(loop)
    assert high - low > 0.1
