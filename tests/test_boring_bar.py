"""The boring bar against eq. 16 as printed, and its sampling against closed forms in the angle."""

import re

import control
import numpy as np
import pytest

from rcbook.machines import boring_bar
from rcbook.machines.boring_bar import HANSON_TSAO2000 as BAR

SPEED = 1000 * 2 * np.pi / 60  # rad/s


def test_plant_is_eq_16_scaled_to_unit_dc_gain():
    s = 2j * np.pi * np.array([0.0, 10.0, 941.0, 6000.0, 50e3])
    b0, a0, a1, a2, a3 = 3.34e18, 2.18e18, 3.30e14, 1.04e10, 1.79e5
    printed = b0 / (s**4 + a3 * s**3 + a2 * s**2 + a1 * s + a0) / (0.365 * s**2 + 208 * s + 12.8e6)
    found = np.array([BAR.plant(point) for point in s])
    np.testing.assert_allclose(found * BAR.dc_gain, printed, rtol=1e-9)
    assert found[0] == pytest.approx(1, rel=1e-12)
    assert BAR.dc_gain == pytest.approx(3.34 / (2.18 * 12.8e6), rel=1e-12)


def test_plant_is_stable_with_the_bar_as_its_slowest_mode():
    poles = BAR.plant.poles()
    slow = poles[np.argsort(np.abs(poles))][:2]
    assert np.all(poles.real < 0)
    np.testing.assert_allclose(slow.real, -208 / (2 * 0.365), rtol=1e-6)
    np.testing.assert_allclose(np.abs(slow), np.sqrt(12.8e6 / 0.365), rtol=1e-6)


def test_both_forms_of_the_speed_are_one():
    t = np.linspace(0, 0.6, 301)
    rva, rvf = 0.2, 0.15
    with_units = boring_bar.speed_law(t, SPEED, rva * SPEED, rvf * SPEED / (2 * np.pi))
    np.testing.assert_allclose(
        boring_bar.relative_speed_law(t, SPEED, rva, rvf), with_units, rtol=1e-13
    )


@pytest.mark.parametrize(("rva", "rvf"), [(0.2, 0.2), (0.3, 0.1), (0.0, 0.5)])
def test_samples_are_equally_spaced_in_angle(rva, rvf):
    """The speed integrates to w0 t + rva/rvf (1 - cos(rvf w0 t)); the integrator works to 1e-12
    per step, some hundred steps."""
    n = boring_bar.samples_per_period(SPEED, 250e-6, rvf)
    step = SPEED * 250e-6
    intervals = boring_bar.angle_triggered_intervals(
        lambda t: boring_bar.relative_speed_law(t, SPEED, rva, rvf), step, n
    )
    t = np.concatenate([[0.0], np.cumsum(intervals)])
    angle = SPEED * t + rva / rvf * (1 - np.cos(rvf * SPEED * t))
    np.testing.assert_allclose(angle, step * np.arange(n + 1), atol=1e-9)
    assert t[-1] == pytest.approx(2 * np.pi / (rvf * SPEED), rel=1e-10)  # one period of the speed
    assert intervals.mean() == pytest.approx(250e-6, rel=1e-10)


def test_intervals_may_start_anywhere_in_the_profile():
    def law(t):
        return boring_bar.relative_speed_law(t, SPEED, 0.2, 0.2)

    step = SPEED * 250e-6
    whole = boring_bar.angle_triggered_intervals(law, step, 40)
    late = boring_bar.angle_triggered_intervals(law, step, 30, start=whole[:10].sum())
    np.testing.assert_allclose(late, whole[10:], rtol=1e-9)


def test_sinusoidal_intervals_are_eq_18():
    found = boring_bar.sinusoidal_intervals(250e-6, 0.2, 4)
    np.testing.assert_allclose(found, [250e-6, 300e-6, 250e-6, 200e-6], rtol=1e-14)


def test_numbers_of_the_experiment_fit_together():
    """240 samples per turn and five turns per speed period are the 1200 of the paper; ten waves
    in them are two per turn, an ellipse."""
    assert boring_bar.samples_per_period(SPEED, BAR.sampling_interval, 0.2) == 1200
    reference = BAR.reference(10, 1200)
    np.testing.assert_allclose(reference[:960], reference[240:], atol=1e-18)
    np.testing.assert_allclose(reference[:120], reference[120:240], atol=1e-18)
    assert np.ptp(reference) == pytest.approx(25e-6, rel=1e-3)


def test_plant_is_a_continuous_state_space():
    assert isinstance(BAR.plant, control.StateSpace)
    assert BAR.plant.isctime()
    assert BAR.plant.nstates == 6


REFUSED = [
    ("gamma", lambda: boring_bar.sinusoidal_intervals(1.0, 1.0, 8), "gamma = 1.0.*stay between"),
    ("nominal", lambda: boring_bar.sinusoidal_intervals(0.0, 0.1, 8), "nominal = 0.0"),
    (
        "stop",
        lambda: boring_bar.angle_triggered_intervals(lambda t: 1.0 - t, 0.1, 10),
        "Does the spindle stop",
    ),
    (
        "backward",
        lambda: boring_bar.angle_triggered_intervals(lambda t: -1.0, 0.1, 10),
        r"speed = -1\.0 rad/s at 0 s: the spindle must not stop",
    ),
    ("step", lambda: boring_bar.angle_triggered_intervals(lambda t: 1.0, 0.0, 3), "step = 0.0"),
    ("n", lambda: boring_bar.angle_triggered_intervals(lambda t: 1.0, 1.0, 0), "n = 0"),
    (
        "samples",
        lambda: boring_bar.samples_per_period(SPEED, 251e-6, 0.2),
        "239.*samples per turn is no whole number; change the speed",
    ),
    (
        "turns",
        lambda: boring_bar.samples_per_period(SPEED, 250e-6, 0.3),
        "3.33333333 turns per period of the speed is no whole number; choose rvf",
    ),
    ("reference", lambda: BAR.reference(2, 0), "n = 0"),
    ("width", lambda: boring_bar.nose(0.0, 0.0, 0.0, 1.0), r"width = 0\.0"),
    ("period", lambda: boring_bar.nose(0.0, 0.0, 1.0, -1.0), r"period = -1\.0"),
]


@pytest.mark.parametrize(("call", "message"), [r[1:] for r in REFUSED], ids=[r[0] for r in REFUSED])
def test_bad_input_is_refused(call, message):
    with pytest.raises(ValueError) as caught:
        call()
    assert re.search(message, str(caught.value)), caught.value
