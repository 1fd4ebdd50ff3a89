"""References, disturbances and measures against their definitions."""

import numpy as np
import pytest
from oracles.signals import loop_settling

from rcbook import signals

SEEDS = range(8)


# ---- references and disturbances ----


def test_step_is_zero_before_its_start_and_high_from_there():
    assert signals.step(20.0, 5, start=2).tolist() == [0, 0, 20, 20, 20]
    assert signals.step(-3.0, 3).tolist() == [-3, -3, -3]
    assert signals.step(1.0, 3, start=3).tolist() == [0, 0, 0]


def test_sinusoid_counts_frequency_in_hertz_and_phase_in_radians():
    y = signals.sinusoid(0.3, 10.0, 1 / 60, 7, 2 * np.pi / 3)
    # sin(120, 180, 240, 300, 0, 60, 120 degrees)
    half = np.sqrt(3) / 2
    np.testing.assert_allclose(y, 0.3 * half * np.array([1, 0, -1, -1, 0, 1, 1]), atol=1e-15)


def test_triangle_starts_at_a_lower_tip_and_counts_hertz_and_radians():
    """4 Hz at 10 ms, 2.5 about 2.5: 25 samples hold one period, 0.4 per sample up from 0."""
    y = signals.triangle(2.5, 4.0, 0.01, 25, bias=2.5)
    rise = 5 * np.arange(13) / 12.5
    # rounding of an angle of 2 pi, times the slope
    np.testing.assert_allclose(y, [*rise, *rise[:0:-1]], atol=1e-14)
    assert signals.triangle(3.0, 1.0, 0.25, 5).tolist() == [-3, 0, 3, 0, -3]
    late = signals.triangle(3.0, 1.0, 0.25, 4, 1.0, np.pi / 2)
    np.testing.assert_allclose(late, [1, 4, 1, -2], atol=1e-14)


@pytest.mark.parametrize("seed", SEEDS)
def test_triangle_is_the_arcsine_of_a_cosine(seed):
    amplitude, f, bias, phase = np.random.default_rng(seed).uniform(0.5, 3, 4)
    y = signals.triangle(amplitude, f, 0.013, 200, bias, phase)
    angle = 2 * np.pi * f * 0.013 * np.arange(200) + phase
    wave = -2 / np.pi * np.arcsin(np.cos(angle))
    # arcsin loses half of the digits beside a tip
    np.testing.assert_allclose(y, bias + amplitude * wave, atol=1e-7)
    slipped = signals.triangle(amplitude, f, 0.013, 201, bias, phase)[1:]  # the mutant
    assert np.abs(slipped - bias - amplitude * wave).max() > 0.01


@pytest.mark.parametrize("arguments, message", [
    ((np.nan, 4.0, 0.01, 5), r"amplitude = nan must be"),
    (("2.5", 4.0, 0.01, 5), r"amplitude = '2\.5' must be"),
    ((2.5, np.nan, 0.01, 5), r"triangle holds nan at sample 0; give finite"),
    ((2.5, 4.0, np.nan, 5), r"triangle holds nan at sample 0; give finite"),
    ((2.5, 4.0, 0.01, 5, np.nan), r"triangle holds nan at sample 0; give finite"),
    ((2.5, 4.0, 0.01, 5, 0.0, np.nan), r"triangle holds nan at sample 0; give finite"),
    ((2.5, 4.0, 0.01, 5.5), r"n = 5\.5 .*round"),
    ((2.5, 4.0, 0.01, 0), r"n = 0 .*round"),
])  # fmt: skip
def test_triangle_refuses_bad_input(arguments, message):
    with pytest.raises(ValueError, match=message):
        signals.triangle(*arguments)


@pytest.mark.parametrize("n", [1, 3, 7, 8])
def test_periodic_repeats_its_shape(n):
    shape = [1.0, -2.0, 5.0]
    assert signals.periodic(shape, n).tolist() == [shape[k % 3] for k in range(n)]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("period", [2, 6, 61])
def test_random_period_has_zero_mean_and_the_asked_amplitude(seed, period):
    shape = signals.random_period(period, 0.25, np.random.default_rng(seed))
    assert shape.shape == (period,)
    # rounding of a mean and of a quotient, times the period
    assert shape.sum() == pytest.approx(0.0, abs=1e-13)
    assert shape.max() - shape.min() == pytest.approx(0.5, rel=1e-13)
    again = signals.random_period(period, 0.25, np.random.default_rng(seed))
    assert np.array_equal(shape, again)


# ---- measures ----


@pytest.mark.parametrize("seed", SEEDS)
def test_settling_time_is_the_first_instant_after_which_nothing_leaves_the_band(seed):
    rng = np.random.default_rng(seed)
    for _ in range(30):
        y = 20 + 10 * rng.standard_normal(25) * np.exp(-0.2 * np.arange(25))
        band = rng.choice([0.02, 0.5, 2.0, 30.0])
        expected = loop_settling(y, 20.0, band, 1 / 60)
        assert signals.settling_time(y, 20.0, band, 1 / 60) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    ("y", "expected"),
    [
        ([1, 1, 1], 0.0),  # never outside
        ([0, 1, 1], 0.5),
        ([1, 0, 1], 1.0),  # the last entry counts, not the first
        ([1, 1, 0], np.inf),  # leaves at the last sample
        ([0, 0, 1], 1.0),  # enters at the last sample
        ([0, 0, 0], np.inf),
        ([0.75, 1.25, 0.75], 0.0),  # exactly on the band, which belongs to it
        ([0.7499999, 1, 1], 0.5),
        ([1], 0.0),
        ([0], np.inf),
    ],
)
def test_settling_time_at_the_edges_of_its_definition(y, expected):
    assert signals.settling_time(y, 1.0, 0.25, 0.5) == expected


def test_settling_time_accepts_a_moving_target():
    assert signals.settling_time([0, 2, 3, 5], [1.0, 2.0, 3.0, 5.0], 0.1, 1.0) == 1.0


@pytest.mark.parametrize(
    ("y", "target", "expected"),
    [
        ([0, 24, 20], 20, 20.0),
        ([0, -24, -20], -20, 20.0),  # beyond a negative target
        ([24, 0], -20, 0.0),  # far on the other side is no overshoot
        ([0, 19.9], 20, 0.0),
        ([0, 20], 20, 0.0),
    ],
)
def test_overshoot_is_in_percent_of_a_target_of_either_sign(y, target, expected):
    assert signals.overshoot(y, target) == pytest.approx(expected, abs=1e-12)  # rounding


def test_spread_and_rms_of_a_known_record():
    assert signals.spread([3.0, -4.0, 1.0]) == 7.0
    assert signals.rms([3.0, -4.0]) == pytest.approx(np.sqrt(12.5), rel=1e-15)


@pytest.mark.parametrize("period", [2, 3, 6, 60, 61])
@pytest.mark.parametrize("seed", SEEDS)
def test_harmonics_put_the_signal_together_again(period, seed):
    shape = np.random.default_rng(seed).standard_normal(period)
    y = np.tile(shape, 3)
    k = np.arange(period)
    rebuilt = sum(
        (c := signals.harmonic(y, period, order)).real * np.cos(2 * np.pi * order * k / period)
        - c.imag * np.sin(2 * np.pi * order * k / period)
        for order in range(period // 2 + 1)
    )
    np.testing.assert_allclose(rebuilt, shape, atol=1e-12)  # rounding of an inverse DFT


@pytest.mark.parametrize("lag", [-150.0, -90.0, 0.0, 30.0, 179.0])
def test_phase_of_a_lagging_signal_is_negative(lag):
    k = np.arange(120)
    x = np.cos(2 * np.pi * k / 12 + 0.4) + 0.7  # a mean does not disturb the fundamental
    y = 3 * np.cos(2 * np.pi * k / 12 + 0.4 + np.radians(lag))
    assert signals.phase_between(y, x, 12) == pytest.approx(lag, abs=1e-10)  # rounding, in degrees
    assert signals.phase_between(x, y, 12) == pytest.approx(-lag, abs=1e-10)


def test_one_sample_of_delay_at_six_per_turn_is_sixty_degrees_of_lag():
    x = signals.sinusoid(1.0, 10.0, 1 / 60, 60)
    assert signals.phase_between(np.roll(x, 1), x, 6) == pytest.approx(-60.0, abs=1e-10)
    assert abs(signals.phase_between(-x, x, 6)) == pytest.approx(180.0, abs=1e-10)


def test_signal_names_the_first_bad_sample():
    with pytest.raises(ValueError, match=r"force .* sample 2"):
        signals.signal([0.0, 1.0, np.nan, np.inf], "force")


def test_a_beat_that_ends_inside_the_band_has_not_settled():
    """|sin| leaves the band 0.5 for ever; only the place where the record is cut hides it."""
    y = np.sin(2 * np.pi * np.arange(121) / 12)
    assert y[-1] == pytest.approx(0, abs=1e-12)
    assert np.isfinite(signals.settling_time(y, 0.0, 0.5, 1.0))
    assert signals.settling_time(y, 0.0, 0.5, 1.0, hold=12) == np.inf
    assert signals.settling_time(np.append(y, np.zeros(12)), 0.0, 0.5, 1.0, hold=12) < np.inf


# ---- periods that are no whole number of samples ----


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("period", "turns"), [(7.5, 2), (46.875, 8), (6.4, 5), (7 + 1 / 3, 3)])
def test_harmonics_of_a_fractional_period_are_those_put_in(seed, period, turns):
    rng = np.random.default_rng(seed)
    orders = np.arange(1, 4)
    put_in = rng.standard_normal(3) + 1j * rng.standard_normal(3)
    k = np.arange(round(turns * period))
    y = 0.7 + (put_in @ np.exp(2j * np.pi * np.outer(orders, k) / period)).real
    for order, c in zip(orders, put_in, strict=True):
        # rounding of a mean of at most 375 terms of order one
        assert signals.harmonic(y, period, int(order)) == pytest.approx(c, abs=1e-12)
    assert signals.harmonic(y, period, 0) == pytest.approx(0.7, abs=1e-12)
    cut = y[:-1]
    with pytest.raises(ValueError, match="not whole periods"):
        signals.harmonic(cut, period)


@pytest.mark.parametrize("lag", [-150.0, -30.0, 0.0, 90.0])
def test_phase_at_a_fractional_period(lag):
    k = np.arange(375)
    x = np.cos(2 * np.pi * k / 46.875 + 0.4)
    y = 3 * np.cos(2 * np.pi * k / 46.875 + 0.4 + np.radians(lag)) - 0.2
    # rounding, in degrees
    assert signals.phase_between(y, x, 46.875) == pytest.approx(lag, abs=1e-10)


@pytest.mark.parametrize("size", [2, 5, 6, 24, 25])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_period_of_its_own_length_repeats_the_shape(size, seed):
    shape = np.random.default_rng(seed).standard_normal(size)
    assert signals.periodic(shape, 60).tolist() == np.resize(shape, 60).tolist()
    # rounding of sums of 24 terms of order one
    found = signals.periodic(shape, 60, float(size))
    np.testing.assert_allclose(found, np.resize(shape, 60), atol=1e-12)


@pytest.mark.parametrize("period", [6.4, 12.0, 24.3, 46.875, 400.5])
def test_a_shape_of_few_harmonics_is_that_signal_at_any_period(period):
    def wave(turn):
        return 0.3 + np.sin(2 * np.pi * turn + 0.2) - 0.5 * np.cos(6 * np.pi * turn)

    found = signals.periodic(wave(np.arange(24) / 24), 200, period)
    # rounding: three harmonics, all below half the sampling frequency of 6.4 samples a period
    np.testing.assert_allclose(found, wave(np.arange(200) / period), atol=1e-12)
    late = wave(np.arange(1, 201) / period)
    assert np.abs(found - late).max() > 1e-3


def test_harmonics_beyond_half_the_sampling_frequency_are_left_out():
    """cos 3 x in a shape of 24 samples, at 5 samples a period: it would look like cos 2 x."""
    turn = np.arange(24) / 24
    found = signals.periodic(np.cos(2 * np.pi * turn) + np.cos(6 * np.pi * turn), 50, 5.0)
    np.testing.assert_allclose(found, np.cos(2 * np.pi * np.arange(50) / 5), atol=1e-12)


def test_a_period_that_is_not_positive_is_refused():
    for verb in (
        lambda p: signals.periodic([1.0, 2.0], 4, p),
        lambda p: signals.harmonic([1.0], p),
    ):
        with pytest.raises(ValueError, match=r"period = -2\.5 must be a positive"):
            verb(-2.5)
