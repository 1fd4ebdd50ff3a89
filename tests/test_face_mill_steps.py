"""The parts of a step of the face mill, each by itself, and runs alone and abreast."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
from test_face_mill import FAST, LIMITED, MILL

from rcbook.machines import face_mill, spindle_drive
from rcbook.machines.face_mill import cut, drive, simulation
from rcbook.machines.face_mill.abreast import MANY, ONE


@pytest.mark.parametrize("a, b, c", [(0.2, 1, -0.1), (-0.7, 1, 0.2), (0.1, -0.8, 0.3), (0, 1, 0)])
def test_the_parabola_of_a_clipped_chip_has_its_mean_and_its_first_moments(a, b, c):
    x = np.linspace(-1, 1, 200_001)
    clipped = np.maximum(0, a + b * x + c * x**2)
    level, slope, curve = cut._positive_part(ONE, a, b, c)
    error = level + slope * x + curve * x**2 - clipped
    for power in range(3):
        moment = scipy.integrate.trapezoid(error * x**power, x)
        assert abs(moment) < 5e-5  # the root is taken to two steps, its square is left
    arrays = [np.array([value, 1.0]) for value in (a, b, c)]
    for many, one in zip(cut._positive_part(MANY, *arrays), (level, slope, curve), strict=True):
        assert many[0] == pytest.approx(one, abs=1e-15)


@pytest.mark.parametrize("x", [-60.0, -3.0, -0.3, -0.02, -0.0099, -1e-4, -1e-9, 0.0])
def test_weights_of_a_mode_are_their_series(x):
    exact, terms = Fraction(x), {}
    for n in (1, 2, 3, 4):
        term = total = Fraction(1, [1, 1, 2, 6, 24][n])
        for k in range(n + 1, 260):
            term = term * exact / k
            total += term
        terms[n] = float(total)
    one = drive._weights(ONE, x)
    many = drive._weights(MANY, np.array([x, -5.0, -1e-3]))
    for n in (1, 2, 3, 4):
        # differences lose a digit for each in 1/x, down to the series at 0.01
        lost = 1e-15 / max(abs(x), 1e-2) ** (n - 1)
        assert one[n - 1] == pytest.approx(terms[n], rel=1e-13, abs=10 * lost)
        assert many[n - 1][0] == pytest.approx(one[n - 1], rel=1e-12, abs=lost)


@pytest.mark.parametrize("which", ["control", "limited", "held"])
def test_the_drive_moves_as_the_exponential_of_its_matrix(which):
    """Under a parabola of torque, which is a state of order three of its own."""
    d, h = MILL.drive, 2e-3
    level, slope, curve, command, current = 4.0, -1.5, 2.5, 0.6, 2.0
    modes = getattr(drive.drive_of(d, ONE), which)
    begun = spindle_drive.steady_state(d, MILL.speed) * 1.1
    push = drive.pushes(modes, command, current)
    state = drive.modal(modes, begun.tolist())
    after, speed, turned = drive.move(ONE, modes, state, push, (level, slope, curve), h)
    closed, inner = spindle_drive.speed_driven(d), spindle_drive.current_driven(d)
    whole = np.zeros((9, 9))  # five states, torque and its two derivatives, the angle
    if which == "control":
        whole[:5, :5], torque, driven = closed.A, closed.B[:, 1], closed.B[:, 0] * command
    else:
        driven = inner.B[:, 0] * current + np.array([0, 0, 0, 0, d.velocity_integral * command])
        whole[:5, :5], torque = inner.A, inner.B[:, 1]
        if which == "held":
            whole[4], driven[4] = 0, 0
    whole[:5, 5], whole[5, 6], whole[6, 7], whole[8, 0] = torque, 1, 1, 1
    start = np.concatenate([begun, [level, slope / h, curve / h**2, 0]])
    augmented = np.zeros((10, 10))
    augmented[:9, :9], augmented[:5, 9] = whole * h, driven * h
    truth = (scipy.linalg.expm(augmented) @ np.append(start, 1))[:9]
    assert speed == pytest.approx(truth[0], rel=1e-10)
    assert turned == pytest.approx(truth[8], rel=1e-10)
    found = [drive.read(ONE, row, after) for row in modes.right]
    np.testing.assert_allclose(found, truth[:5], rtol=1e-8)


@pytest.mark.parametrize("limit", face_mill.LIMITS)
def test_extremes_within_a_step_are_those_of_its_parts(limit):
    """At four points of a step, alone and abreast; a run of four times the steps has them too.

    Points of time are there points of the angle, which differ where the current hardly does.
    """
    one = replace(LIMITED[limit], substeps=4, inner=4, turns=2)
    alone, *abreast = (
        face_mill.simulate(one),
        *face_mill.simulate_all([one] * simulation.FEW),
    )
    for run in abreast:
        for name in ("lowest_current", "highest_current"):
            ours, single = getattr(run, name), getattr(alone, name)
            np.testing.assert_allclose(ours, single, rtol=0, atol=1e-6)
    assert np.all(alone.lowest_current <= np.minimum(alone.current, alone.highest_current))
    free = replace(one, mill=replace(FAST, drive=replace(FAST.drive, current_limit=500.0)))
    coarse, fine = (
        face_mill.simulate(replace(free, **s)) for s in ({}, {"substeps": 16, "inner": 1})
    )
    parts = fine.current[1:].reshape(-1, 4)
    np.testing.assert_allclose(coarse.highest_current[1:], parts.max(axis=1), atol=0.02)
    np.testing.assert_allclose(coarse.lowest_current[1:], parts.min(axis=1), atol=0.02)
    assert np.abs(coarse.current[1:] - parts.max(axis=1)).max() > 0.2  # a mutant: the end alone
