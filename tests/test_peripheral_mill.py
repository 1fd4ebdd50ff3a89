"""The mill of the thesis: its printed tables, its runout, and the plant at another rate."""

from dataclasses import replace

import control
import numpy as np
import pytest
import scipy.signal
from oracles.peripheral_mill import (
    EXACT,
    continuous_modal_system,
    recursion,
    step_with_a_sine_part,
)

from rcbook.loops import repetitive
from rcbook.loops.repetitive import Process
from rcbook.machines import peripheral_mill
from rcbook.machines.peripheral_mill import HORNG1989, resample
from rcbook.zdomain import Plant

PLANT = HORNG1989.plant
SLOW, FAST = 0.9952, -0.2415  # thesis, text after eq. 8
HALF_DIGIT = 0.00005  # four printed decimals
CUT = 0.0001  # the same, cut instead of rounded


def closed():
    pi = repetitive.pi_controller(0.064, 1.5, PLANT.dt)
    return Process(PLANT, pi).command_path


# ---- printed tables ----


def test_plant_has_the_printed_poles_and_zero():
    # eq. 6 is rounded to half a digit; dp/da of the slow pole is p/(p - p2) < 1 for each of two
    np.testing.assert_allclose(PLANT.poles, [SLOW, FAST], atol=HALF_DIGIT)
    np.testing.assert_allclose(PLANT.zeros, [0.8731], atol=HALF_DIGIT)


def test_recursion_of_the_plant_is_equation_8():
    v = np.random.default_rng(0).standard_normal(50)
    ours = scipy.signal.lfilter(PLANT.numerator, PLANT.a, v)
    np.testing.assert_allclose(ours, recursion(v), atol=1e-12)  # rounding


def test_closed_loop_is_the_printed_equation_12():
    path = closed()
    assert path.delay == 1
    np.testing.assert_allclose(path.b[0], 0.5789, atol=HALF_DIGIT)
    # bracket: ratios of rounded numbers, the thesis may cut (notes, convention 1)
    np.testing.assert_allclose(path.b / path.b[0], [1, -0.3731, -0.4365], atol=CUT)
    np.testing.assert_allclose(path.a, [1, -1.1748, 0.2973, -0.0123], atol=CUT)
    np.testing.assert_allclose(path.zeros, [0.8731, -0.5], atol=HALF_DIGIT)


def test_closed_loop_poles_are_those_of_the_printed_polynomial():
    # each coefficient is off by up to CUT, and a root moves by that over |P'(p)| > 0.1
    np.testing.assert_allclose(closed().poles, [0.8373, 0.2862, 0.0513], atol=2e-3)


def test_equation_24_is_the_printed_controller():
    loop = repetitive.design(Process(PLANT, repetitive.pi_controller(0.064, 1.5, PLANT.dt)), 6, 0.8)
    numerator, denominator = loop.repetitive.numerator, loop.repetitive.denominator
    numerator, denominator = numerator / denominator[0], denominator / denominator[0]
    assert not numerator[:5].any()  # eq. 23: z^-5
    # 0.8/0.5789 = 1.38 magnifies what is cut
    np.testing.assert_allclose(numerator[5:9], [1.3819, -1.6234, 0.4108, -0.0169], atol=2 * CUT)
    expected = [1, -0.3731, -0.4365, 0, 0, 0, -1, 0.3731, 0.4365]
    np.testing.assert_allclose(denominator, expected, atol=CUT)


def test_cutting_conditions_are_those_of_chapter_2():
    assert HORNG1989.samples_per_turn == 6
    assert HORNG1989.cutter_diameter == pytest.approx(9.525e-3, rel=1e-12)  # 3/8 in
    assert HORNG1989.feed_speed == pytest.approx(1.905e-3, rel=1e-12)  # 4.5 in/min
    assert HORNG1989.depth_of_cut == pytest.approx(0.762e-3, rel=1e-12)  # 0.03 in
    assert HORNG1989.flutes == 4 and HORNG1989.filter_corner == 30.0


def test_runout_is_the_sine_before_equation_13_with_hertz_turned_into_radians():
    half = np.sqrt(3) / 2  # sin 120, 180, 240, 300, 0, 60 degrees
    expected = 0.30 * half * np.array([1, 0, -1, -1, 0, 1, 1])
    np.testing.assert_allclose(HORNG1989.runout(7), expected, atol=1e-15)
    np.testing.assert_allclose(HORNG1989.runout(7, 1.0), expected / 0.3, atol=1e-15)
    assert not HORNG1989.runout(6, 0.0).any()


def test_runout_sampled_twice_a_turn_depends_on_its_phase():
    slow = replace(HORNG1989, plant=resample(PLANT, 1 / 20))
    assert slow.samples_per_turn == 2
    np.testing.assert_allclose(
        slow.runout(4), 0.3 * np.sqrt(3) / 2 * np.array([1, -1, 1, -1]), atol=1e-14
    )


def test_a_turn_that_is_not_a_whole_number_of_samples_is_refused():
    with pytest.raises(ValueError, match=r"8\.57"):
        _ = replace(HORNG1989, spindle_frequency=7.0).samples_per_turn


# ---- the plant at another rate ----

MODES = peripheral_mill.FAST_MODES
RATES = [20.0, 40.0, 60.0, 80.0, 100.0, 120.0]  # N = 2 .. 12 at 10 Hz


def step_response(plant, n):
    return scipy.signal.lfilter(plant.numerator, plant.a, np.ones(n))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("rate", RATES)
def test_resampling_keeps_the_steady_gain_and_the_delay(mode, rate):
    plant = resample(PLANT, 1 / rate, mode)
    truth = (9.0452 - 7.8975) / (1 - 0.7537 - 0.2404)
    # 1 - a(1) is 0.0059/(...): rounding magnified by some 1e3
    assert plant.b.sum() / plant.a.sum() == pytest.approx(truth, rel=1e-10)
    assert plant.delay == 1 and plant.dt == 1 / rate


@pytest.mark.parametrize("mode", ["keep sign", "damped cosine"])
def test_resampling_at_the_same_rate_changes_nothing(mode):
    plant = resample(PLANT, PLANT.dt, mode)
    np.testing.assert_allclose(plant.a, PLANT.a, atol=1e-13)  # roots and back
    np.testing.assert_allclose(plant.b, PLANT.b, atol=1e-10)  # times gains of some 200


@pytest.mark.parametrize("mode", ["keep sign", "damped cosine"])
@pytest.mark.parametrize("every", [3, 5])
def test_an_odd_subsampling_is_exact(mode, every):
    """Every third sample of a held step is what a plant at a third of the rate answers."""
    slow = resample(PLANT, every * PLANT.dt, mode)
    truth = step_response(PLANT, 20 * every)[::every]
    ours = step_response(slow, 20)
    np.testing.assert_allclose(ours, truth, rtol=1e-10, atol=1e-12)  # rounding of slow pole
    late = step_response(PLANT, 20 * every + 1)[1::every]
    assert np.abs(ours - late).max() > 1


def test_an_even_subsampling_tells_the_mappings_apart():
    truth = step_response(PLANT, 40)[::2]
    error = {
        m: np.abs(step_response(resample(PLANT, 2 * PLANT.dt, m), 20) - truth).max() for m in MODES
    }
    assert error["positive"] < 1e-9 and error["damped cosine"] < 1e-9  # (-p)^2 = p^2
    assert error["keep sign"] > 0.1


@pytest.mark.parametrize("rate", [20.0, 37.3, 60.0, 80.0, 100.0, 120.0, 1000.0])
def test_damped_cosine_samples_lie_on_one_continuous_response(rate):
    system = continuous_modal_system(PLANT)
    t = np.arange(30) / rate
    truth = control.step_response(system, t).outputs
    ours = step_response(resample(PLANT, 1 / rate, "damped cosine"), 30)
    # gains of some 200 lb/mV, matrix exponential and recursion: 1e-10
    np.testing.assert_allclose(ours, truth, atol=1e-8)
    if rate not in (20.0, 60.0):
        other = step_response(resample(PLANT, 1 / rate, "keep sign"), 30)
        assert np.abs(other - truth).max() > 0.05  # another system; the check tells them apart


@pytest.mark.parametrize("mode", MODES)
def test_poles_after_resampling_are_powers_of_the_poles_before(mode):
    tau = 0.6
    plant = resample(PLANT, tau * PLANT.dt, mode)
    size = abs(min(EXACT)) ** tau
    fast = {
        "keep sign": [-size],
        "positive": [size],
        "damped cosine": [size * np.exp(1j * np.pi * tau), size * np.exp(-1j * np.pi * tau)],
    }[mode]
    expected = np.poly([max(EXACT) ** tau, *fast]).real
    np.testing.assert_allclose(plant.a, expected, atol=1e-13)  # rounding of powers


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("tau", [0.5, 1.0, 2.0])
def test_positive_modes_agree_with_the_hold_of_a_continuous_plant(mode, tau):
    """All poles positive: the plant is a sampled sum of lags, whatever the mapping."""
    p, g, dt = np.array([0.9, 0.3]), np.array([2.0, -0.7]), 0.1

    def sampled(interval):
        e = p ** (interval / dt)
        b = [np.sum(g * (1 - e)), -np.sum(g * (1 - e) * e[::-1])]
        return Plant(b, np.poly(e), 1, interval)

    ours, truth = resample(sampled(dt), tau * dt, mode), sampled(tau * dt)
    np.testing.assert_allclose(ours.b, truth.b, atol=1e-13)  # rounding
    np.testing.assert_allclose(ours.a, truth.a, atol=1e-13)


def test_a_mill_resampled_to_twelve_per_turn_counts_twelve():
    assert replace(HORNG1989, plant=resample(PLANT, 1 / 120)).samples_per_turn == 12


@pytest.mark.parametrize("sine", [-1.0, -0.5, 0.5, 1.0])
@pytest.mark.parametrize("rate", [20.0, 90.0, 120.0])
def test_sine_part_belongs_to_a_continuous_machine_that_sixty_hertz_does_not_show(sine, rate):
    """Step response of the modes in continuous time, written down and sampled."""
    assert np.allclose(resample(PLANT, 1 / 60, "damped cosine", sine).b, PLANT.b, atol=1e-9)
    truth = step_with_a_sine_part(PLANT, rate, sine, 30)
    found = step_response(resample(PLANT, 1 / rate, "damped cosine", sine), 30)
    np.testing.assert_allclose(found, truth, atol=1e-9 * np.abs(truth).max())  # slow gain 200
