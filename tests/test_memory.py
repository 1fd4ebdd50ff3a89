"""Memories and controllers: what they learn, what they cost, and what they refuse."""

import numpy as np
import pytest
import scipy.signal

from rcbook import zdomain
from rcbook.loops import memory
from rcbook.loops.memory import Memory, RepetitiveController
from rcbook.zdomain import NoncausalFilter, Plant

# First-order lag with a delay of two samples, stable and minimum phase.
PLANT = Plant([0.3, 0.1], [1.0, -0.6], 2, 0.01)
INVERSE = zdomain.zero_phase_inverse(PLANT)
KINDS = {
    "plain": memory.plain(12),
    "plain with q": memory.plain(12, [0.25, 0.5, 0.25]),
    "fractional": memory.plain(12.4),
    "fractional with q": memory.plain(12.4, [0.25, 0.5, 0.25]),
    "odd": memory.odd_harmonic(16),
    "odd, fractional": memory.odd_harmonic(16.6),
    "two periods": memory.several(memory.plain(9), memory.plain(14)),
    "second order": memory.several(memory.plain(11), memory.plain(11)),
    "fractional and odd": memory.several(memory.plain(10.3), memory.odd_harmonic(16)),
}
each = pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS.keys())


def remembered(kind: Memory, x: np.ndarray) -> np.ndarray:
    """H x by its sum, sample by sample."""
    y = np.zeros(x.size)
    for k in range(x.size):
        for j, tap in enumerate(kind.taps):
            if k >= kind.first + j:
                y[k] += tap * x[k - kind.first - j]
    return y


# ---- what a memory is ----


@each
def test_the_polynomial_is_the_sum_over_the_past(kind):
    x = np.random.default_rng(1).standard_normal(80)
    found = scipy.signal.lfilter(kind.polynomial, [1.0], x)
    # rounding of sums of fewer than 30 terms of order one
    np.testing.assert_allclose(found, remembered(kind, x), atol=1e-13)


@each
def test_the_gain_is_that_of_a_long_sine(kind):
    w = 0.37
    x = np.exp(1j * w * np.arange(120))
    y = scipy.signal.lfilter(kind.polynomial, [1.0], x)
    found = kind.gain(np.exp(1j * w))
    # once all taps are filled the response to a sine is exact
    assert y[-1] / x[-1] * np.exp(1j * w * kind.period) == pytest.approx(complex(found), abs=1e-12)


@pytest.mark.parametrize("period", [9, 9.5, 46.875, 5.01])
@pytest.mark.parametrize("degree", [1, 3, 5])
def test_a_fractional_delay_is_exact_for_polynomials_up_to_its_degree(period, degree):
    kind = memory.plain(period, degree=degree)
    k = np.arange(200.0)
    for power in range(degree + 1):
        x = ((k - 100) / 100) ** power
        # rounding of an interpolation of numbers of order one
        later = remembered(kind, x)[80:]
        np.testing.assert_allclose(later, ((k - period - 100) / 100)[80:] ** power, atol=1e-12)


def test_a_whole_period_needs_no_interpolator():
    assert memory.plain(6).taps == pytest.approx([1.0])
    assert memory.plain(6.0).first == 6


@pytest.mark.parametrize("n", [12, 25])
def test_the_plain_memory_learns_every_harmonic_of_its_period(n):
    z = zdomain.unit_circle(n)
    left = zdomain.evaluate(memory.plain(n).generator, z)
    np.testing.assert_allclose(left, 0, atol=1e-13)


def test_the_odd_memory_learns_odd_harmonics_only_and_in_half_the_time():
    kind = memory.odd_harmonic(16)
    left = zdomain.evaluate(kind.generator, zdomain.unit_circle(16))
    np.testing.assert_allclose(left[1::2], 0, atol=1e-13)
    np.testing.assert_allclose(left[::2], 2, atol=1e-13)
    assert kind.first == 8


def test_several_periods_are_learned_by_one_memory():
    """The generator of the product vanishes wherever one of the two does."""
    kind = memory.several(memory.plain(6), memory.plain(10))
    for n in (6, 10):
        left = zdomain.evaluate(kind.generator, zdomain.unit_circle(n))
        np.testing.assert_allclose(left, 0, atol=1e-12)
    # H1 + H2 - H1 H2, term by term
    expected = np.zeros(17)
    expected[[6, 10, 16]] = 1, 1, -1
    assert kind.polynomial == pytest.approx(expected)


def test_a_memory_of_second_order_forgives_an_error_of_the_period():
    """Near a harmonic |1 - H| is (period error)^order times the angle: slope 1 against slope 2."""
    angle = 2 * np.pi / 20 * np.array([1.001, 1.002])
    z = np.exp(1j * angle)
    first, second = memory.plain(20), memory.several(memory.plain(20), memory.plain(20))
    slopes = [
        np.log2(np.abs(np.divide(*zdomain.evaluate(kind.generator, z)[::-1])))
        for kind in (first, second)
    ]
    # next terms of the expansion are a thousandth of these
    assert slopes == pytest.approx([1, 2], abs=1e-3)


# ---- the factor ----


@each
@pytest.mark.parametrize("gain", [0.4, 1.0])
def test_the_closed_loop_has_the_roots_of_one_minus_the_factor(kind, gain):
    """1 - z^-N factor, from products, against a (1 - H) + n from the controller's fraction."""
    controller = RepetitiveController(INVERSE, kind, gain)
    z = np.exp(1j * np.linspace(0.1, 3.0, 7))
    plant = zdomain.response(PLANT, z)
    compensated = gain * plant * zdomain.response(INVERSE, z)
    found = 1 - z**-kind.period * memory.factor(kind, compensated, z)
    fraction = [zdomain.evaluate(p, z) for p in (controller.numerator, controller.denominator)]
    expected = (fraction[1] + fraction[0] * plant) / zdomain.evaluate(controller.compensator.a, z)
    np.testing.assert_allclose(found, expected, atol=1e-12)


@each
def test_the_zero_phase_inverse_makes_the_plain_factor_real(kind):
    z = np.exp(1j * np.linspace(0.1, 3.0, 7))
    compensated = zdomain.response(PLANT, z) * zdomain.response(INVERSE, z)
    found = memory.factor(kind, compensated, z)
    # all that turns is what the memory itself turns
    np.testing.assert_allclose(found / kind.gain(z) - (1 - compensated.real), 0, atol=1e-12)


def test_the_gain_bound_is_taken_along_the_first_axis_alone():
    """|1 - k g| < 1 up to k = 2 Re g/|g|^2: 2 for one, 1 for 1 + j, never for -1."""
    g = np.array([[1.0, 1.0, 1.0], [1.0, 1 + 1j, -1.0]])
    np.testing.assert_allclose(memory.gain_bound(g), [2, 1, 0], atol=1e-15)


# ---- controllers ----


@each
def test_the_controller_waits_no_longer_than_its_memory(kind):
    controller = RepetitiveController(INVERSE, kind, 0.5)
    assert controller.delay == kind.first - INVERSE.advance
    assert controller.look_ahead == pytest.approx(kind.period - controller.delay)
    assert np.flatnonzero(controller.numerator)[0] == controller.delay


def test_a_number_is_the_period_of_a_plain_memory():
    controller = RepetitiveController(INVERSE, 12, 0.5)
    assert controller.memory.taps == pytest.approx([1.0])
    assert controller.period == 12


def test_a_lead_is_a_shift():
    z = np.exp(1j * np.array([0.2, 1.1]))
    np.testing.assert_allclose(zdomain.response(memory.lead(3, 0.5), z), 0.5 * z**3, atol=1e-14)


def impulse(controller, n: int) -> np.ndarray:
    return scipy.signal.lfilter(controller.numerator, controller.denominator, np.eye(1, n)[0])


@pytest.mark.parametrize("period", [12, 12.4])
def test_resonators_are_cosines_turned_by_the_plants_phase(period):
    """Impulse response against the sum of cosines it stands for."""
    chosen, k = [0, 1, 3], np.arange(60)
    expected = np.zeros(60)
    for h in chosen:
        g = complex(zdomain.response(PLANT, np.exp(2j * np.pi * h / period)))
        expected += 0.2 / abs(g) * np.cos(2 * np.pi * h * k / period - np.angle(g))
    found = impulse(memory.resonators(PLANT, period, chosen, 0.2), 60)
    # poles on the circle add up rounding over 60 samples
    np.testing.assert_allclose(found, expected, atol=1e-11)


def test_a_resonator_at_half_the_sampling_frequency_alternates():
    g = float(zdomain.response(PLANT, np.array([-1.0 + 0j]))[0].real)
    found = impulse(memory.resonators(PLANT, 12, [6], 0.2), 9)
    np.testing.assert_allclose(found, 0.2 / g * (-1.0) ** np.arange(9), atol=1e-13)


def test_a_small_gain_shrinks_each_harmonic_by_half_the_gain_a_sample():
    gain = 1e-4
    controller = memory.resonators(PLANT, 12, [1, 3, 6], gain)
    polynomial = zdomain.add(
        zdomain.multiply(PLANT.a, controller.denominator),
        zdomain.multiply(PLANT.numerator, controller.numerator),
    )
    roots = np.roots(polynomial)
    rates = [
        1 - np.abs(roots[np.argmin(np.abs(roots - np.exp(2j * np.pi * h / 12)))]) for h in (1, 3, 6)
    ]
    # the harmonic at half the sampling frequency is one real pole and shrinks by the whole gain;
    # second-order terms are of the size of the gain squared times the number of harmonics
    assert rates == pytest.approx([gain / 2, gain / 2, gain], rel=2e-3)


# ---- bad input ----


@pytest.mark.parametrize(
    "call, error, message",
    [
        (lambda: memory.plain(0), ValueError, "0"),
        (lambda: memory.plain(float("nan")), ValueError, "nan"),
        (lambda: memory.plain("6"), ValueError, "'6'"),
        (lambda: memory.plain(1, [0.25, 0.5, 0.25]), ValueError, "lengthen the period"),
        (lambda: memory.plain(6, [0.5, 0.5]), ValueError, "symmetric"),
        (lambda: memory.plain(6.5, degree=2), ValueError, "odd"),
        (lambda: memory.several(), ValueError, "no memory"),
        (lambda: memory.several(6), TypeError, "plain"),
        (lambda: memory.odd_harmonic(1), ValueError, "lengthen the period"),
        (lambda: Memory([0.0], 3, 3), ValueError, "remembers nothing"),
        (lambda: Memory([1.0], 0, 3), ValueError, "first"),
        (lambda: Memory([1.0], 3, -3), ValueError, "-3"),
        (lambda: memory.as_memory("6"), TypeError, "period in samples"),
        (lambda: memory.as_memory(True), TypeError, "True"),
        (lambda: RepetitiveController(INVERSE, 1, 0.5), ValueError, "lengthen the period"),
        (lambda: RepetitiveController(INVERSE, 12, 0), ValueError, "repetitive gain"),
        (lambda: RepetitiveController(memory.lead(13), 12, 1), ValueError, "13 samples ahead"),
        (lambda: RepetitiveController(PLANT, 12, 1), TypeError, "lead"),
        (lambda: memory.gain_bound([1.0, np.nan]), ValueError, "leave out the poles"),
        (lambda: memory.lead(-2), ValueError, "samples = -2.*looks ahead"),
        (lambda: memory.resonators(PLANT, 12, [], 1), ValueError, "name each"),
        (lambda: memory.resonators(PLANT, 12, [1, 1], 1), ValueError, "once"),
        (lambda: memory.resonators(PLANT, 12, [7], 1), ValueError, "harmonic 7"),
        (lambda: memory.resonators(PLANT, 12, [0.5], 1), ValueError, "0.5"),
        (
            lambda: memory.resonators(Plant([1.0, -1.0], [1.0], 1, 1.0), 12, [0], 1),
            ValueError,
            "stops harmonic 0",
        ),
        (lambda: memory.resonators(PLANT, 12, [1], 0), ValueError, "gain"),
    ],
)
def test_bad_input_names_value_and_mend(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_a_noncausal_filter_is_no_plant_to_resonate_with():
    with pytest.raises(TypeError, match="Plant"):
        memory.resonators(NoncausalFilter([1.0], [1.0], 1), 12, [1], 0.1)
