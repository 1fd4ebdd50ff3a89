"""Least squares: exact without noise, honest with it, biased where theory says so."""

import numpy as np
import pytest
import scipy.signal
from oracles.identify import difference_equation

from rcbook import identify

A7, B7 = np.array([1, -0.7537, -0.2404]), np.array([9.0452, -7.8975])  # thesis, eq. 7


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("na", [0, 1, 2, 3])
@pytest.mark.parametrize("nb", [1, 2, 4])
@pytest.mark.parametrize("delay", [0, 1, 3])
def test_noise_free_records_give_back_the_plant(na, nb, delay, seed):
    rng = np.random.default_rng(seed)
    a = np.poly(rng.uniform(0.1, 0.9, na) * rng.choice([-1, 1], na)) if na else np.ones(1)
    b = rng.uniform(1, 5, nb) * rng.choice([-1, 1], nb)
    u = identify.prbs(8, 0.7, seed)
    fit = identify.arx(u, difference_equation(a, b, delay, u), na, nb, delay)
    # condition of three nearby poles squared stays below 1e6
    np.testing.assert_allclose(fit.theta, [*a[1:], *b], atol=1e-9)
    plant = fit.plant(0.1)
    assert (plant.delay, plant.dt) == (delay, 0.1)
    np.testing.assert_allclose(plant.a, a, atol=1e-9)
    np.testing.assert_allclose(plant.b, b, atol=1e-9)


def test_a_delay_wrong_by_one_sample_is_noticed():
    u = identify.prbs(8)
    y = difference_equation(A7, B7, 1, u)
    right, wrong = (identify.arx(u, y, 2, 2, delay) for delay in (1, 2))
    assert np.abs(right.residual).max() < 1e-11  # rounding of a force of order 10
    assert np.abs(wrong.residual).max() > 1.0


@pytest.mark.parametrize(("na", "nb", "delay"), [(2, 2, 1), (1, 3, 0), (0, 2, 2), (3, 1, 1)])
def test_regressors_are_those_of_equation_1_row_by_row(na, nb, delay):
    rng = np.random.default_rng(1)
    u, y = rng.standard_normal((2, 12))
    first = max(na, delay + nb - 1)
    rows = [
        [-y[k - i] for i in range(1, na + 1)] + [u[k - delay - i] for i in range(nb)]
        for k in range(first, 12)
    ]
    assert identify.regressors(u, y, na, nb, delay).tolist() == rows


@pytest.mark.parametrize("seed", range(3))
def test_printed_equations_3_and_5_return_what_their_algebra_says(seed):
    """Plus signs flip a1, a2; F(k-1) on the right of eq. 5 is its own first regressor."""
    u = identify.prbs(9, seed=seed)
    y = difference_equation(A7, B7, 1, u)
    phi = np.column_stack([y[1:-1], y[:-2], u[1:-1], u[:-2]])  # eq. 3 as printed
    normal = phi.T @ phi
    eq3_alone = np.linalg.solve(normal, phi.T @ y[2:])
    both = np.linalg.solve(normal, phi.T @ y[1:-1])
    # normal equations of condition 1e6: 1e-10
    np.testing.assert_allclose(eq3_alone, [0.7537, 0.2404, 9.0452, -7.8975], atol=1e-8)
    np.testing.assert_allclose(both, [1, 0, 0, 0], atol=1e-8)
    # the library's regressors, and its estimate, have the signs of eq. 1
    ours = identify.regressors(u, y, 2, 2, 1)
    assert np.array_equal(ours * [-1, -1, 1, 1], phi)
    theta = identify.arx(u, y, 2, 2, 1).theta
    np.testing.assert_allclose(theta, [-0.7537, -0.2404, 9.0452, -7.8975], atol=1e-10)


def test_estimate_and_standard_error_are_those_of_the_normal_equations():
    rng = np.random.default_rng(5)
    u = rng.standard_normal(60)
    y = difference_equation([1, -0.6], [2.0, 1.0], 1, u, rng.standard_normal(60))
    fit = identify.arx(u, y, 1, 2, 1)
    phi = np.array([[-y[k - 1], u[k - 1], u[k - 2]] for k in range(2, 60)])
    theta = np.linalg.solve(phi.T @ phi, phi.T @ y[2:])
    residual = y[2:] - phi @ theta
    variance = residual @ residual / (58 - 3)
    error = np.sqrt(variance * np.diag(np.linalg.inv(phi.T @ phi)))
    # condition below 10: rounding
    np.testing.assert_allclose(fit.theta, theta, rtol=1e-12)
    np.testing.assert_allclose(fit.standard_error, error, rtol=1e-12)
    np.testing.assert_allclose(fit.residual, residual, atol=1e-12)


def coverage(noise_enters_equation, draws=300):
    a, b, u = np.array([1, -1.2, 0.35]), np.array([2.0, -1.0]), identify.prbs(9)
    truth = np.array([-1.2, 0.35, 2.0, -1.0])
    clean = scipy.signal.lfilter([0, *b], a, u)
    inside = np.zeros(4)
    for seed in range(draws):
        e = 0.5 * np.random.default_rng(seed).standard_normal(u.size)
        y = clean + (scipy.signal.lfilter([1.0], a, e) if noise_enters_equation else e)
        fit = identify.arx(u, y, 2, 2, 1)
        inside += np.abs(fit.theta - truth) <= 1.96 * fit.standard_error
    return inside / draws


def test_standard_errors_cover_the_truth_nineteen_times_in_twenty():
    # binomial: sqrt(0.95 0.05/300) = 0.0126; four of them, and 0.01 for the 1/n bias of ARX
    assert np.all(np.abs(coverage(True) - 0.95) < 4 * 0.0126 + 0.01)


def test_coverage_check_notices_noise_on_the_output():
    assert coverage(False, draws=60).min() < 0.2


@pytest.mark.parametrize("seed", range(4))
def test_bias_under_output_error_is_that_of_theory(seed):
    """White u, y = x + n: the pole shrinks by var x/(var x + var n), b0 is not biased."""
    rng = np.random.default_rng(seed)
    n, pole, b0, sigma = 100_000, 0.8, 1.5, 1.2
    u = rng.standard_normal(n)
    x = scipy.signal.lfilter([0, b0], [1, -pole], u)
    fit = identify.arx(u, x + sigma * rng.standard_normal(n), 1, 1, 1)
    variance = b0**2 / (1 - pole**2)
    expected = -pole * variance / (variance + sigma**2)
    # five standard deviations of sample moments: 5/sqrt(1e5) = 0.016 at most, times spread/var
    assert fit.theta[0] == pytest.approx(expected, abs=0.016)
    assert fit.theta[1] == pytest.approx(b0, abs=5 * 3.0 / np.sqrt(n))
    assert abs(expected + pole) > 0.1  # the bias is far larger than the tolerance


@pytest.mark.parametrize("scale", [1e-3, 1e-6, 1e-9])
def test_estimate_does_not_depend_on_the_units(scale):
    u = identify.prbs(8)
    y = difference_equation(A7, B7, 1, u)
    theta = identify.arx(scale * u, y, 2, 2, 1).theta
    np.testing.assert_allclose(theta * [1, 1, scale, scale], [*A7[1:], *B7], atol=1e-8)


def test_a_command_in_tiny_units_is_not_called_poor_excitation():
    u = identify.prbs(8)
    y = difference_equation(A7, B7, 1, u)
    theta = identify.arx(1e-12 * u, y, 2, 2, 1).theta
    np.testing.assert_allclose(theta * [1, 1, 1e-12, 1e-12], [*A7[1:], *B7], atol=1e-8)


def test_standard_error_does_not_depend_on_the_units():
    rng = np.random.default_rng(0)
    u = identify.prbs(8)
    y = difference_equation(A7, B7, 1, u, 1e-2 * rng.standard_normal(u.size))
    one = identify.arx(u, y, 2, 2, 1).standard_error
    small = identify.arx(1e-9 * u, y, 2, 2, 1).standard_error
    np.testing.assert_allclose(small * [1, 1, 1e-9, 1e-9], one, rtol=1e-6)  # rounding 1e-16/1e-9


@pytest.mark.parametrize("seed", range(4))
def test_standard_error_survives_nearly_equal_columns(seed):
    rng = np.random.default_rng(seed)
    ripple = 2.0**-32
    u = 1 + ripple * identify.prbs(8, seed=seed)
    y = u + rng.standard_normal(u.size)
    fit = identify.arx(u, y, 0, 2, 0)
    # the same space spanned by u(k) and the exact difference (u(k-1) - u(k))/ripple
    phi = np.column_stack([u[1:], (u[:-1] - u[1:]) / ripple])
    well = np.linalg.inv(phi.T @ phi)
    back = np.array([[1, -1 / ripple], [0, 1 / ripple]])
    variance = fit.residual @ fit.residual / (u.size - 1 - 2)
    expected = np.sqrt(variance * np.diag(back @ well @ back.T))
    # a stable triangular inverse loses cond * eps = 1e10 * 1e-16
    np.testing.assert_allclose(fit.standard_error, expected, rtol=1e-4)


# ---- the binary sequence ----


@pytest.mark.parametrize("bits", range(2, 17))
def test_prbs_is_a_maximal_length_sequence(bits):
    u = identify.prbs(bits, amplitude=3.0)
    n = 2**bits - 1
    assert u.size == n and set(np.abs(u)) == {3.0}
    assert u.sum() == 3.0  # one more high than low
    correlation = np.fft.ifft(np.abs(np.fft.fft(u / 3.0)) ** 2).real
    expected = np.full(n, -1.0)
    expected[0] = n
    # rounding of an FFT of n ones: eps n log n < 1e-9 for n = 65535
    np.testing.assert_allclose(correlation, expected, atol=1e-8)


def test_correlation_check_notices_one_flipped_bit():
    u = identify.prbs(6)
    u[17] *= -1
    correlation = np.fft.ifft(np.abs(np.fft.fft(u)) ** 2).real
    assert np.abs(correlation[1:] + 1).max() > 1


@pytest.mark.parametrize("bits", [2, 5, 7])
def test_seed_of_prbs_only_chooses_where_the_period_begins(bits):
    first = identify.prbs(bits, seed=0).tolist()
    starts = set()
    for seed in range(20):
        other = identify.prbs(bits, seed=seed).tolist()
        assert other == identify.prbs(bits, seed=seed).tolist()
        starts |= {i for i in range(len(first)) if first[i:] + first[:i] == other}
    assert len(starts) > 1


def test_prbs_accepts_a_whole_float_as_every_other_count_does():
    assert identify.prbs(4.0).size == 15
