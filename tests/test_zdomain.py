"""Zero-phase inverse, zero split, zero-order hold and Q filters against other algorithms."""

import math

import control
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import scipy.optimize
import scipy.signal
from oracles.zdomain import (
    exponential_series,
    from_roots,
    held_in_decimals,
    interval_integrals,
    peak_square,
    two_lags,
    value,
    with_integral,
)

from rcbook import zdomain
from rcbook.zdomain import NoncausalFilter, Plant

CIRCLE = np.exp(1j * np.linspace(-np.pi, np.pi, 257))  # both ends: z = -1 and z = 1 included
SEEDS = range(12)


def random_roots(rng, count, low, high):
    """`count` roots of magnitude low..high, closed under conjugation."""
    roots = []
    while len(roots) < count:
        size = low + (high - low) * rng.random()
        if count - len(roots) >= 2 and rng.random() < 0.6:
            root = size * np.exp(1j * np.pi * (0.05 + 0.9 * rng.random()))
            roots += [root, root.conjugate()]
        else:
            roots.append(size * rng.choice([-1.0, 1.0]))
    return np.array(roots)


def random_case(seed, order=None):
    """A plant with known zeros inside 0.8 and outside 1.1, and its true B-."""
    rng = np.random.default_rng(seed)
    order = int(rng.integers(1, 6)) if order is None else order
    outside = int(rng.integers(0, order))
    inner = random_roots(rng, int(rng.integers(0, order - outside)), 0.1, 0.8)
    outer = random_roots(rng, outside, 1.1, 2.5)
    gain = rng.choice([-1, 1]) * 10 ** rng.uniform(-2, 2)
    b = gain * np.convolve(from_roots(inner), from_roots(outer))
    a = from_roots(random_roots(rng, order, 0.05, 0.97))
    return Plant(b, a, int(rng.integers(0, 4)), 0.01), from_roots(outer)


# ---- zero-phase inverse ----


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("normalisation", ["peak", "dc", "l1"])
def test_plant_times_inverse_is_real_and_the_square_of_b_minus(seed, normalisation):
    plant, b_minus = random_case(seed)
    inverse = zdomain.zero_phase_inverse(plant, 1.0, normalisation)
    forward = CIRCLE ** (-float(plant.delay)) * value(plant.b, CIRCLE) / value(plant.a, CIRCLE)
    backward = CIRCLE ** float(inverse.advance) * value(inverse.b, CIRCLE)
    product = forward * backward / value(inverse.a, CIRCLE)
    scale = {
        "peak": peak_square(b_minus),
        "dc": float(np.sum(b_minus)) ** 2,
        "l1": float(np.sum(np.abs(b_minus))) ** 2,
    }[normalisation]
    truth = abs(value(b_minus, CIRCLE)) ** 2 / scale
    # roots of up to degree 5 carry some 1e-12; the search of the peak another 1e-12
    np.testing.assert_allclose(product.real, truth, rtol=0, atol=2e-10 * truth.max())
    assert np.abs(product.imag).max() < 2e-10 * truth.max()
    assert product.real.min() > -2e-10 * truth.max()
    if normalisation == "peak":
        assert product.real.max() <= 1 + 1e-10  # rounding of the product
    if normalisation == "l1":
        assert scale >= peak_square(b_minus) * (1 - 1e-12)  # the triangle inequality


@pytest.mark.parametrize("seed", SEEDS)
def test_plant_then_inverse_in_time_is_the_autocorrelation_of_b_minus_at_the_advance(seed):
    plant, b_minus = random_case(seed)
    inverse = zdomain.zero_phase_inverse(plant, normalisation="dc")
    degree = b_minus.size - 1
    assert inverse.advance == plant.delay + degree
    impulse = np.eye(1, 40)[0]
    y = scipy.signal.lfilter(plant.b, plant.a, np.roll(impulse, plant.delay))
    out = scipy.signal.lfilter(inverse.b, inverse.a, y)
    expected = np.zeros(40)
    centre = inverse.advance
    expected[centre - degree : centre + degree + 1] = np.correlate(b_minus, b_minus, "full")
    expected /= b_minus.sum() ** 2
    # cancelled zeros lie within 0.8: rounding 1e-16 times gains of the inverse, at most 1e5 here
    np.testing.assert_allclose(out, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("slip", [-1, 1])
def test_oracle_notices_an_advance_wrong_by_one_sample(slip):
    plant, _ = random_case(3)
    inverse = zdomain.zero_phase_inverse(plant)
    mutant = NoncausalFilter(inverse.b, inverse.a, inverse.advance + slip)
    product = zdomain.response(plant, CIRCLE) * zdomain.response(mutant, CIRCLE)
    assert np.abs(product.imag).max() > 0.1 * np.abs(product).max()


def test_oracle_notices_b_minus_that_is_not_reflected():
    plant = Plant([1.0, 1.7], [1.0, -0.5], 1, 1.0)
    inverse = zdomain.zero_phase_inverse(plant)
    mutant = NoncausalFilter(
        zdomain.multiply(plant.a, [1.0, 1.7]) / 2.7**2, inverse.a, inverse.advance
    )
    product = zdomain.response(plant, CIRCLE) * zdomain.response(mutant, CIRCLE)
    assert np.abs(product.imag).max() > 0.1


@pytest.mark.parametrize("radius", [0.2, 0.5, 0.75, 0.9, 1.0])
def test_radius_decides_which_stable_zeros_are_cancelled(radius):
    zeros = np.array([0.95, 0.6, -0.3, 1.4])
    plant = Plant(2.5 * from_roots(zeros), from_roots([0.9, 0.2, -0.1]), 2, 0.1)
    inverse = zdomain.zero_phase_inverse(plant, radius, "dc")
    kept = from_roots(zeros[np.abs(zeros) >= radius])
    product = zdomain.response(plant, CIRCLE) * zdomain.response(inverse, CIRCLE)
    truth = abs(value(kept, CIRCLE)) ** 2 / kept.sum() ** 2
    # roots of a quartic with separated zeros: 1e-13
    np.testing.assert_allclose(product, truth, atol=1e-11 * truth.max())
    assert inverse.advance == 2 + np.sum(np.abs(zeros) >= radius)


@pytest.mark.parametrize("zero", [1.0, -1.0, np.exp(0.7j), np.exp(2.1j)])
def test_zeros_on_the_circle_are_not_cancelled(zero):
    pair = [zero] if np.imag(zero) == 0 else [zero, np.conj(zero)]
    plant = Plant(from_roots([*pair, 0.5]), [1.0, -0.5, 0.1], 1, 1.0)
    inverse = zdomain.zero_phase_inverse(plant)
    np.testing.assert_allclose(inverse.a, [1.0, -0.5], atol=1e-12)  # only the zero at 0.5
    gain = zdomain.response(plant, zero) * zdomain.response(inverse, zero)
    assert abs(gain) < 1e-12  # rounding: the zero stays where it was


@pytest.mark.parametrize("angle", [np.pi / 2, np.pi / 3, 2.0])
def test_double_zeros_on_the_circle_are_not_cancelled(angle):
    pair = np.array([1.0, -2 * np.cos(angle), 1.0])
    b_plus, b_minus = zdomain.split_zeros(np.convolve(pair, pair))
    assert b_plus.size == 1 and b_minus.size == 5


def test_triple_zero_on_the_circle_is_not_cancelled():
    b_plus, b_minus = zdomain.split_zeros([1.0, 3.0, 3.0, 1.0])
    assert b_plus.size == 1 and b_minus.size == 4


@pytest.mark.parametrize("seed", SEEDS)
def test_peak_square_finds_the_peak_of_any_polynomial(seed):
    rng = np.random.default_rng(seed)
    p = rng.standard_normal(int(rng.integers(1, 12)))
    # the search stops within 1e-10 rad of a flat top: 1e-18; the rest is rounding
    assert zdomain.inverse._peak_square(p) == pytest.approx(peak_square(p), rel=1e-11)


def test_peak_square_of_closed_forms():
    assert zdomain.inverse._peak_square(np.array([1.0])) == 1.0
    assert zdomain.inverse._peak_square(np.array([1.0, -3.0])) == pytest.approx(16.0, rel=1e-15)
    # |1 + z^-2|^2 = 4 cos(w)^2 and |1 - z^-1 + z^-2|^2 = (2 cos w - 1)^2
    assert zdomain.inverse._peak_square(np.array([1.0, 0.0, 1.0])) == pytest.approx(4.0, rel=1e-15)
    assert zdomain.inverse._peak_square(np.array([1.0, -1.0, 1.0])) == pytest.approx(9.0, rel=1e-15)
    # |1 + z^-1 - z^-2|^2 = 3 - 2 cos 2w = 5 - 4 cos(w)^2, an inner maximum at w = pi/2
    assert zdomain.inverse._peak_square(np.array([1.0, 1.0, -1.0])) == pytest.approx(5.0, rel=1e-14)


@pytest.mark.parametrize("seed", SEEDS)
def test_split_multiplies_back_and_holds_the_right_zeros(seed):
    rng = np.random.default_rng(seed)
    inner = random_roots(rng, int(rng.integers(0, 4)), 0.0, 0.69)
    outer = random_roots(rng, int(rng.integers(0, 4)), 0.71, 3.0)
    b = -4.2 * np.convolve(from_roots(inner), from_roots(outer))
    b_plus, b_minus = zdomain.split_zeros(b, radius=0.7)
    # roots up to degree 6, separated only at random: some 1e-10
    np.testing.assert_allclose(np.convolve(b_plus, b_minus), b, atol=1e-8 * np.abs(b).max())
    np.testing.assert_allclose(b_minus, from_roots(outer), atol=1e-8 * np.abs(b).max())
    assert b_minus[0] == 1.0


def test_split_treats_zeros_at_the_origin_as_cancelled():
    b_plus, b_minus = zdomain.split_zeros([2.0, -1.0, 0.0])
    np.testing.assert_allclose(np.convolve(b_plus, b_minus), [2.0, -1.0, 0.0], atol=1e-15)


# ---- zero-order hold ----


def test_hold_of_first_order_lag_has_the_closed_form():
    gain, tau, dt = 3.0, 0.2, 0.05
    plant = zdomain.zero_order_hold(control.tf([gain], [tau, 1]), dt)
    pole = np.exp(-dt / tau)
    assert plant.delay == 1
    np.testing.assert_allclose(plant.b, [gain * (1 - pole)], rtol=1e-13)  # rounding
    np.testing.assert_allclose(plant.a, [1, -pole], rtol=1e-13)


@pytest.mark.parametrize("dt", [1.0, 0.1, 0.01])
def test_hold_of_double_integrator_has_the_closed_form(dt):
    plant = zdomain.zero_order_hold(control.tf([1], [1, 0, 0]), dt)
    assert plant.delay == 1
    # b = a difference of numbers of size 2, rounded to 4e-16, over dt^2/2
    np.testing.assert_allclose(plant.b, [dt**2 / 2] * 2, rtol=4e-15 / dt**2)
    np.testing.assert_allclose(plant.a, [1, -2, 1], atol=1e-14)


def test_hold_of_underdamped_second_order_has_the_closed_form():
    omega, zeta, dt = 12.0, 0.2, 0.04
    plant = zdomain.zero_order_hold(control.tf([omega**2], [1, 2 * zeta * omega, omega**2]), dt)
    damped = omega * np.sqrt(1 - zeta**2)
    decay, c, s = np.exp(-zeta * omega * dt), np.cos(damped * dt), np.sin(damped * dt)
    slope = zeta * omega / damped
    b1 = 1 - decay * (c + slope * s)
    b2 = decay**2 + decay * (slope * s - c)
    np.testing.assert_allclose(plant.b, [b1, b2], rtol=1e-12)  # rounding
    np.testing.assert_allclose(plant.a, [1, -2 * decay * c, decay**2], rtol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_hold_agrees_with_partial_fractions(seed):
    rng = np.random.default_rng(seed)
    order = int(rng.integers(1, 6))
    poles = -np.arange(1, order + 1) * (1 + 0.3 * rng.random(order))
    num, den, dt = rng.standard_normal(int(rng.integers(1, order + 1))), np.poly(poles), 0.3
    residues, p, _ = scipy.signal.residue(num, den)
    plant = zdomain.zero_order_hold(control.tf(num, den), dt)
    z = 1.3 * np.exp(2j * np.pi * np.arange(50) / 50)
    e = np.exp(p * dt)
    truth = sum(r * (ei - 1) / pi / (z - ei) for r, pi, ei in zip(residues, p, e, strict=True))
    # residues of five real poles lose about four digits, b itself about as many
    np.testing.assert_allclose(
        zdomain.response(plant, z), truth, atol=1e-10 * np.abs(residues).max()
    )
    assert plant.delay == 1


def test_hold_reproduces_the_continuous_step_response_at_the_samples():
    a = np.array([[0, 1.0, 0, 0], [-40, -1, 40, 1], [0, 0, 0, 1], [20, 0.5, -25, -3]])
    b, c = np.array([0, 0, 0, 5.0]), np.array([1.0, 0, 0, 0])
    plant = zdomain.zero_order_hold(control.ss(a, b[:, None], c[None], 0), 0.05)
    t = 0.05 * np.arange(40)
    found = scipy.integrate.solve_ivp(
        lambda _, x: a @ x + b, (0, t[-1]), np.zeros(4), t_eval=t, rtol=1e-11, atol=1e-13
    )
    y = scipy.signal.lfilter(plant.numerator, plant.a, np.ones(t.size))
    # integrator tolerance 1e-11 against a response of order one
    np.testing.assert_allclose(y, c @ found.y, atol=1e-8)
    shifted = np.concatenate([[0.0], y[:-1]])  # the mutant, one sample late
    assert np.abs(shifted - c @ found.y).max() > 1e-2


def test_hold_keeps_the_dc_gain():
    system = control.tf([2.0, 7.0], np.poly([-1, -2, -3.5]))
    plant = zdomain.zero_order_hold(system, 0.1)
    # a(1) = prod(1 - e^(p dt)) = 0.005: rounding of 1e-16 is magnified by 200
    assert plant.b.sum() / plant.a.sum() == pytest.approx(1.0, rel=1e-11)  # 7/(1 2 3.5)


@pytest.mark.parametrize(("num", "delay"), [([2.0, 1.0], 0), ([1.0], 1)])
def test_hold_counts_direct_feedthrough_as_no_delay(num, delay):
    plant = zdomain.zero_order_hold(control.tf(num, [1.0, 3.0]), 0.1)
    assert plant.delay == delay
    if delay == 0:
        assert plant.b[0] == pytest.approx(2.0, rel=1e-15)  # D of the continuous plant


EULERIAN = {2: [1, 1], 3: [1, 4, 1], 4: [1, 11, 11, 1], 5: [1, 26, 66, 26, 1]}


def integrators(n):
    return control.ss(np.eye(n, k=1), np.eye(n)[:, -1:], np.eye(n)[:1], 0)


@pytest.mark.parametrize("n", EULERIAN)
def test_hold_of_integrator_chains_has_eulerian_numerators(n):
    plant = zdomain.zero_order_hold(integrators(n), 1.0)
    factorial = np.prod(np.arange(1, n + 1))
    assert plant.delay == 1
    # differences of binomials up to 10, over 1/120
    np.testing.assert_allclose(plant.b * factorial, EULERIAN[n], atol=1e-10)


@pytest.mark.parametrize("n", [4, 5])
def test_hold_keeps_the_digits_of_small_leading_coefficients(n):
    dt = 0.01
    plant = zdomain.zero_order_hold(integrators(n), dt)
    factorial = np.prod(np.arange(1, n + 1))
    # a numerator by impulse response or by det-free formulas is good to about 1e-9 here
    np.testing.assert_allclose(plant.b * factorial / dt**n, EULERIAN[n], rtol=1e-6)


@pytest.mark.parametrize("scale", [1e-6, 1e-9, 1e-12])
def test_hold_does_not_depend_on_the_unit_of_the_output(scale):
    system = control.tf([1.0], [1.0, 2.0, 3.0])
    one = zdomain.zero_order_hold(system, 0.1)
    scaled = zdomain.zero_order_hold(scale * system, 0.1)
    np.testing.assert_allclose(scaled.b / scale, one.b, rtol=1e-12)  # linearity; rounding


def test_hold_of_a_static_gain_is_the_gain():
    plant = zdomain.zero_order_hold(control.tf([2.0], [1.0]), 0.1)
    assert plant.delay == 0 and plant.b[0] == 2.0


POLES = {
    "one": [-3.0],
    "repeated": [-1.0] * 5,
    "nearly repeated": -1.0 - 1e-7 * np.arange(5),
    "integrators and a lag": [0.0, 0.0, -2.0],
    "undamped": [10j, -10j, 100j, -100j],
    "lightly damped": [-1e-3 + 10j, -1e-3 - 10j, -5.0],
    "stiff": [0.0, -0.1, -1.0, -1e4],
    "unstable": [0.5, -1.0, -3.0],
}
DURATIONS = [1e-4, 0.01, 0.3, 2.0, 0.3 + 1e-9]


def with_poles(name):
    return control.ss(control.tf([1.0], np.poly(POLES[name]).real))


def impulses(matrices, entered, c):
    """Impulse response 1 .. n at each duration, from what one hold does."""
    found = []
    for _ in range(c.size):
        found.append(entered @ c)
        entered = np.einsum("kij,kj->ki", matrices, entered)
    return np.array(found).T


@pytest.mark.parametrize("name", POLES)
def test_held_plants_have_every_digit_of_a_computation_in_80_digits(name):
    """Impulse responses to 1e-13 of the largest, the first to 1e-13 of itself.  Rounding of one
    entry of a moves a fast pole, and with it a numerator, by the stiffness: 1e4, hence 1e-12."""
    system = with_poles(name)
    matrices, entered = zdomain.hold_matrices(system.A, system.B[:, 0], np.array(DURATIONS))
    found = impulses(matrices, entered, system.C[0])
    b, a = zdomain.hold_polynomials(system, np.array(DURATIONS))
    for k, dt in enumerate(DURATIONS):
        impulse, zeros, poles = held_in_decimals(system, dt)
        size = np.abs(impulse).max()
        np.testing.assert_allclose(found[k], impulse[1:], rtol=0, atol=1e-13 * size)
        np.testing.assert_allclose(found[k][0], impulse[1], rtol=1e-13)
        np.testing.assert_allclose(a[k], poles, rtol=0, atol=1e-12)
        np.testing.assert_allclose(b[k], zeros, rtol=0, atol=1e-12 * np.abs(zeros).max())


@pytest.mark.parametrize("seed", SEEDS)
def test_held_plants_at_ten_thousand_durations_are_those_of_one_at_a_time(seed):
    system, rng = stable_system(seed), np.random.default_rng(seed)
    times = np.append(0.0, rng.uniform(0, 3, 9_999) ** 4)  # from nothing to some hundred steps
    matrices, entered = zdomain.hold_matrices(system.A, system.B[:, 0], times)
    n = system.nstates
    joint = np.block([[system.A, system.B], [np.zeros((1, n + 1))]])
    for k in range(0, times.size, 400):
        whole = scipy.linalg.expm(joint * times[k])[:n]
        # both round at each of their steps, some ten of them
        np.testing.assert_allclose(matrices[k], whole[:, :n], atol=1e-12)
        np.testing.assert_allclose(entered[k], whole[:, n], atol=1e-12 * np.abs(whole).max())
    np.testing.assert_array_equal(matrices[0], np.eye(n))


def test_hold_does_not_depend_on_the_units_of_the_states():
    """Powers of ten of 1e9 between neighbours; a Taylor series of the raw matrix has no digits."""
    system, scale = with_poles("nearly repeated"), 1e9 ** np.arange(5.0)
    other = control.ss(
        system.A * scale / scale[:, None], system.B / scale[:, None], system.C * scale, 0
    )
    one, two = (zdomain.zero_order_hold(each, 0.3) for each in (system, other))
    np.testing.assert_allclose(two.b, one.b, rtol=1e-12)
    np.testing.assert_allclose(two.a, one.a, rtol=1e-12)


# ---- plants and polynomials ----


@pytest.mark.parametrize("seed", SEEDS)
def test_plant_agrees_with_python_control_on_the_circle(seed):
    plant, _ = random_case(seed)
    z = 1.2 * CIRCLE
    # rounding of quotients of two polynomials up to degree 8
    np.testing.assert_allclose(zdomain.response(plant, z), plant.to_control()(z), rtol=1e-9)


def test_leading_coefficient_of_the_denominator_is_scaled_away():
    plant = Plant([4.0, 2.0], [2.0, -1.0], 1, 0.1)
    assert plant.a.tolist() == [1.0, -0.5] and plant.b.tolist() == [2.0, 1.0]


def test_poles_and_zeros_come_by_decreasing_magnitude_without_the_origin():
    plant = Plant([1.0, -1.7, 0.6, 0.0], [1.0, 0.2, -0.15, 0.0, 0.0], 3, 1.0)
    # roots of quadratics: z^2 - 1.7 z + 0.6 and z^2 + 0.2 z - 0.15
    np.testing.assert_allclose(plant.zeros, [1.2, 0.5], rtol=1e-13)
    np.testing.assert_allclose(plant.poles, [-0.5, 0.3], rtol=1e-13)


@pytest.mark.parametrize(("pole", "stable"), [(0.999, True), (1.0, False), (-1.0, False)])
def test_stability_of_a_plant_ends_at_the_circle(pole, stable):
    assert Plant([1.0], [1.0, -pole], 1, 1.0).is_stable is stable


@pytest.mark.parametrize("n", [1, 2, 7, 64])
def test_unit_circle_holds_the_roots_of_unity_from_one_on(n):
    z = zdomain.unit_circle(n)
    np.testing.assert_allclose(z**n, 1.0, atol=1e-13)  # rounding times n
    assert z[0] == 1 and np.unique(np.round(z, 9)).size == n
    assert n < 3 or z[1].imag > 0  # counter-clockwise, as np.fft counts


def test_frequencies_are_in_hertz():
    np.testing.assert_allclose(zdomain.at_frequency([0, 15, 30], 1 / 60), [1, 1j, -1], atol=1e-15)


def test_add_and_multiply_and_shift_are_those_of_polynomials():
    p, q = np.array([1.0, 2.0, 3.0]), np.array([5.0, -1.0])
    x = 0.37
    assert np.polyval(zdomain.add(p, q)[::-1], x) == pytest.approx(
        np.polyval(p[::-1], x) + np.polyval(q[::-1], x), rel=1e-14
    )
    assert np.polyval(zdomain.multiply(p, q, q)[::-1], x) == pytest.approx(
        np.polyval(p[::-1], x) * np.polyval(q[::-1], x) ** 2, rel=1e-14
    )
    assert np.polyval(zdomain.shift(q, 3)[::-1], x) == pytest.approx(
        x**3 * np.polyval(q[::-1], x), rel=1e-14
    )


# ---- Q filters ----


@pytest.mark.parametrize("passes", [0, 1, 2, 5])
def test_binomial_q_is_a_power_of_the_cosine_at_half_the_angle(passes):
    gain = zdomain.zero_phase_gain(zdomain.binomial_q(passes), CIRCLE)
    # (z + 2 + 1/z)/4 = cos(w/2)^2
    np.testing.assert_allclose(gain, np.cos(np.angle(CIRCLE) / 2) ** (2 * passes), atol=1e-14)


def test_symmetric_fir_has_the_gain_of_its_cosine_sum():
    half, w = [0.5, 0.2, -0.05], np.angle(CIRCLE)
    taps = zdomain.symmetric_fir(half)
    assert taps.tolist() == [-0.05, 0.2, 0.5, 0.2, -0.05]
    truth = 0.5 + 0.4 * np.cos(w) - 0.1 * np.cos(2 * w)
    np.testing.assert_allclose(zdomain.zero_phase_gain(taps, CIRCLE), truth, atol=1e-14)


def test_q_filters_that_are_symmetric_but_for_rounding_are_accepted():
    """scipy.signal.firwin returns such windows for some lengths (7 taps at 0.3, for one)."""
    zdomain.odd_symmetric([0.25, 0.5, np.nextafter(0.25, 1)])


# ---- modes and integrals over an interval ----


def stable_system(seed, order=None):
    """A continuous system with distinct stable poles, some in pairs, seen in random coordinates."""
    rng = np.random.default_rng(seed)
    order = int(rng.integers(1, 7)) if order is None else order
    blocks, left = [], order
    while left:
        decay = -(10 ** rng.uniform(-1, 1.5))
        if left > 1 and rng.random() < 0.5:
            swing = 10 ** rng.uniform(-1, 1)
            blocks.append([[decay, swing], [-swing, decay]])
        else:
            blocks.append([[decay]])
        left -= len(blocks[-1])
    mix = np.linalg.qr(rng.normal(size=(order, order)))[0]
    a = mix @ scipy.linalg.block_diag(*blocks) @ mix.T
    return control.ss(a, rng.normal(size=(order, 1)), rng.normal(size=(1, order)), 0)


@pytest.mark.parametrize("dt", [0.02, 0.3])
@pytest.mark.parametrize("seed", SEEDS)
def test_interval_integral_answers_as_the_matrix_exponential_does(seed, dt):
    system = stable_system(seed)
    u = np.random.default_rng(seed).standard_normal(30)
    integrals = interval_integrals(system, dt, u)
    plant = zdomain.interval_integral(system, dt)
    assert plant.delay == 1 and plant.dt == dt
    ours = scipy.signal.lfilter(plant.numerator, plant.a, np.append(u, 0))[1:]
    # up to 6 poles close to 1 multiply the rounding of the recursion
    np.testing.assert_allclose(ours, integrals, atol=1e-9 * np.abs(integrals).max())
    late = scipy.signal.lfilter(plant.b, plant.a, u)[:-1]  # a mutant: one interval off
    assert np.abs(late - integrals[1:]).max() > 1e-3 * np.abs(integrals).max()


@pytest.mark.parametrize("seed", SEEDS)
def test_interval_integral_is_the_hold_of_the_integrated_plant_without_its_pole_at_one(seed):
    system = stable_system(seed)
    a, b = with_integral(system)
    c = np.append(np.zeros(system.nstates), 1.0)
    held = zdomain.zero_order_hold(control.ss(a, b, c, 0), 0.2)
    plant = zdomain.interval_integral(system, 0.2)
    assert held.delay == plant.delay
    np.testing.assert_allclose(np.convolve(plant.a, [1, -1]), held.a, atol=1e-10)
    # the hold sums products of its impulse response, which cancel
    np.testing.assert_allclose(plant.b, held.b, atol=1e-10 * np.abs(held.b).max())


@pytest.mark.parametrize("fast, slow, dt", [(800, 2, "0.15"), (300, 40, "0.2"), (3, 1, "0.1")])
def test_interval_integral_keeps_the_digits_of_small_coefficients(fast, slow, dt):
    """The last coefficients are as small as e^-120, and right to many digits all the same."""
    lags = control.ss([[-fast, 0], [1, -slow]], [[1], [0]], [[0, 1]], 0)
    plant = zdomain.interval_integral(lags, float(dt))
    b, a = two_lags(fast, slow, dt)
    # e^x of x = -120 is known to 120 roundings; (3, 1, 0.1): differences of 1e-3 of the terms
    np.testing.assert_allclose(plant.a, a, rtol=1e-12)
    np.testing.assert_allclose(plant.b, b, rtol=1e-11)


def test_interval_integral_of_slow_inputs_is_the_steady_output_times_the_interval():
    for seed in SEEDS:
        system = stable_system(seed)
        plant = zdomain.interval_integral(system, 0.4)
        gain = plant.b.sum() / plant.a.sum()
        assert gain == pytest.approx(0.4 * system(0).real, rel=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_modes_add_up_to_the_frequency_response(seed):
    system = stable_system(seed)
    poles, residues = zdomain.modes(system)
    s = 1j * np.geomspace(1e-2, 1e3, 40)
    found = np.sum(residues / (s[:, None] - poles), axis=-1)
    # straight from the definition C (sI - A)^-1 B
    truth = [
        (system.C @ np.linalg.solve(x * np.eye(poles.size) - system.A, system.B)).item() for x in s
    ]
    np.testing.assert_allclose(found, truth, atol=1e-11 * np.abs(residues).max())
    wrong = np.sum(residues / (s[:, None] - 1.01 * poles), axis=-1)
    assert np.abs(wrong - truth).max() > 1e-4 * np.abs(truth).max()


TURNS = [1, -1, 1j, 0.6 + 0.8j, -0.8 + 0.6j]


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("size", [1e-12, 1e-5, 9.9e-3, 1.01e-2, 0.1, 1.0, 4.0])
def test_phi_functions_are_their_series(size, turn):
    x = np.array([size * turn])
    assert zdomain.phi1(x)[0] == pytest.approx(exponential_series(x[0], 1), rel=1e-14, abs=0)
    # cut off after x^4: 2 (1e-2)^5/7!; from the difference: two roundings over |x|
    assert zdomain.phi2(x)[0] == pytest.approx(exponential_series(x[0], 2), rel=1e-13, abs=0)


def test_phi_functions_at_zero_and_far_out():
    x = np.array([0.0, -700.0, -1e5])
    np.testing.assert_allclose(zdomain.phi1(x), [1, 1 / 700, 1e-5], rtol=1e-15)
    np.testing.assert_allclose(zdomain.phi2(x), [0.5, 699 / 700**2, (1e5 - 1) / 1e10], rtol=1e-15)


TWO = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
NOT_BY_MODES = {
    "two inputs": (TWO, "give one input"),
    "sampled": (control.ss([[0.5]], [[1]], [[1]], 0, 0.1), "give one input"),
    "direct path": (control.ss([[-1]], [[1]], [[1]], 1), "no direct path"),
    "double pole": (control.ss([[-1, 1], [0, -1]], [[0], [1]], [[1, 0]], 0), r"poles \[-1"),
    "no state": (control.ss([], [], [], [[0]]), "poles"),
}


@pytest.mark.parametrize("system, message", NOT_BY_MODES.values(), ids=NOT_BY_MODES)
def test_what_has_no_distinct_modes_is_refused(system, message):
    with pytest.raises(ValueError, match=message):
        zdomain.modes(system)
    with pytest.raises(ValueError, match=message):
        zdomain.interval_integral(system, 0.1)


@pytest.mark.parametrize("dt", [0.0, -0.1, np.nan])
def test_interval_integral_needs_an_interval(dt):
    with pytest.raises(ValueError, match="dt"):
        zdomain.interval_integral(stable_system(0), dt)


def test_interval_integral_refuses_an_output_that_does_not_answer():
    deaf = control.ss([[-1, 0], [0, -2]], [[1], [0]], [[0, 1]], 0)
    with pytest.raises(ValueError, match="does not answer"):
        zdomain.interval_integral(deaf, 0.1)


# ---- points between those of the circle, and models of unstable plants ----


@pytest.mark.parametrize("n", [1, 5, 8])
def test_unit_circle_half_a_step_further_holds_the_roots_of_minus_one(n):
    z = zdomain.unit_circle(n, 0.5)
    np.testing.assert_allclose(z**n, -1, atol=1e-13)
    assert z.size == n and np.unique(z.round(9)).size == n
    np.testing.assert_allclose(z[0], np.cos(np.pi / n) + 1j * np.sin(np.pi / n), atol=1e-15)


def test_an_unstable_plant_is_inverted_only_on_demand():
    plant = Plant([2.0, -0.6], from_roots([1.3, 0.4]), 2, 0.1)  # zero at 0.3
    with pytest.raises(ValueError, match=r"magnitude 1\.3"):
        zdomain.zero_phase_inverse(plant)
    law = zdomain.zero_phase_inverse(plant, cancel_unstable=True)
    np.testing.assert_allclose(
        zdomain.response(plant, CIRCLE) * zdomain.response(law, CIRCLE), 1, atol=1e-12
    )
    outside = Plant([1.0, 2.0], from_roots([1.3, 0.4]), 1, 0.1)  # zero at -2
    law = zdomain.zero_phase_inverse(outside, cancel_unstable=True)
    both = zdomain.response(outside, CIRCLE) * zdomain.response(law, CIRCLE)
    np.testing.assert_allclose(both, np.abs(1 + 2 / CIRCLE) ** 2 / 9, atol=1e-12)
    stable = Plant([1.0, 2.0], from_roots([0.8, 0.4]), 1, 0.1)
    plain, forced = (zdomain.zero_phase_inverse(stable, cancel_unstable=x) for x in (False, True))
    assert np.array_equal(plain.b, forced.b) and np.array_equal(plain.a, forced.a)


@pytest.mark.parametrize("roots", [[0.5], [2.0], [0.5, -0.3j, 1.5], [0.999, 0.98j, 1.001]])
def test_turns_round_the_origin_count_the_roots_inside(roots):
    def around(angle):
        return np.prod([np.exp(1j * angle) - root for root in roots], axis=0)

    turns = zdomain.turns_round_origin(around, 0.0, 2 * np.pi, 5)
    assert turns == pytest.approx(sum(abs(root) < 1 for root in roots), abs=1e-9)


def test_turns_round_the_origin_refuses_a_curve_through_it():
    with pytest.raises(ValueError, match="passes the origin near"):
        zdomain.turns_round_origin(lambda x: x - 0.3 + 0j, 0.0, 1.0, 7)
    with pytest.raises(ValueError, match="NaN or infinity"):
        zdomain.turns_round_origin(lambda x: np.full(x.size, np.nan), 0.0, 1.0, 7)


# ---- where something stops being true ----


@pytest.mark.parametrize("inside, outside", [(0.0, 3.0), (2.0, -3.0), (1.0, 9e3)])
@pytest.mark.parametrize("precision", [0.1, 1e-9])
def test_the_boundary_is_a_root_from_the_inside(inside, outside, precision):
    """x^2 < 2 ends at +-sqrt 2; what is found holds, and a step of the precision farther not."""
    inside = min(inside, 1.0)
    found = zdomain.boundary(lambda x: x * x < 2, inside, outside, precision)
    further = found + math.copysign(precision, outside - inside)
    assert found * found < 2 <= further * further


def test_the_boundary_is_no_farther_than_asked_and_begins_where_it_holds():
    assert zdomain.boundary(lambda x: True, 1.0, 1.0, 1e-3) == 1.0
    assert 2 - 1e-3 <= zdomain.boundary(lambda x: True, 1.0, 2.0, 1e-3) < 2
    with pytest.raises(ValueError, match=r"does not hold at inside = 3\.0; begin where"):
        zdomain.boundary(lambda x: x < 2, 3.0, 9.0, 1e-3)
    for bad in (np.nan, np.inf):
        with pytest.raises(ValueError, match="inside = "):
            zdomain.boundary(lambda x: True, bad, 1.0, 1e-3)
    with pytest.raises(ValueError, match=r"precision = 0\.0"):
        zdomain.boundary(lambda x: x < 2, 1.0, 9.0, 0.0)


def test_a_first_crossing_is_a_root_or_an_edge_or_nowhere():
    edges = (0.0, 1.0, 2.0, 3.0)
    assert zdomain.first_crossing(lambda x: x**2 - 2, edges) == pytest.approx(np.sqrt(2), abs=1e-6)
    assert zdomain.first_crossing(lambda x: 1.0 + x, edges) == 0.0
    assert zdomain.first_crossing(lambda x: -1.0, edges) == np.inf
    with pytest.raises(ValueError, match="all upward"):
        zdomain.first_crossing(lambda x: x, (1.0, 0.0, 0.5))


def test_the_first_of_several_crossings_is_found_going_either_way():
    edges = np.arange(-1.0, 20, 0.5)  # the sine rises through 0 and 2 pi and falls through pi
    assert zdomain.first_crossing(np.sin, edges) == pytest.approx(0, abs=1e-11)
    assert zdomain.first_crossing(np.sin, np.arange(5.0, 0, -0.5)) == pytest.approx(np.pi)
    assert zdomain.first_crossing(np.sin, [4.0, 7.0]) == pytest.approx(2 * np.pi)


@pytest.mark.parametrize("pole", [0.0, 0.3, -0.9, 0.999])
def test_white_noise_through_one_pole_has_the_variance_of_a_geometric_series(pole):
    found = zdomain.rms_gain(np.array([2.0]), np.array([1.0, -pole]), abs(pole))
    # rounding of a mean over as many points as the response is long
    assert found == pytest.approx(2 / np.sqrt(1 - pole**2), rel=1e-12)


def test_a_response_that_does_not_end_is_refused():
    with pytest.raises(ValueError, match="too near 1"):
        zdomain.rms_gain(np.ones(1), np.array([1.0, -1.0]), 1 - 1e-9)
