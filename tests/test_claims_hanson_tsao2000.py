"""Numbers of the boring bar's chapter against values that come from elsewhere.

Where a test says "oracle", the value is from a program written from the paper alone, without sight
of this one: a plant balanced by its Gramians, taps checked with 60 digits, Brent's method on the
spectral radius, impulses followed sample by sample, chatter by Runge and Kutta in angle.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg
from scipy.optimize import brentq, minimize_scalar

from rcbook import signals, zdomain
from rcbook.loops import periodic
from rcbook.machines import boring_bar, chatter

BAR = boring_bar.HANSON_TSAO2000
STAGE, T0, N = BAR.plant, BAR.sampling_interval, 1200
Q20, Q21 = zdomain.symmetric_fir([0.8, 0.1]), zdomain.binomial_q()
CUT = chatter.HANSON_TSAO2000
K0 = chatter.least_limit(CUT.mode)


def loop_of(design, gamma, n=32, q=(1.0,), late=0.0, machine=STAGE, gain=1.0):
    intervals = boring_bar.sinusoidal_intervals(T0, gamma, n)
    known = periodic.sample(STAGE, intervals)
    compensator = {
        "nominal": lambda: periodic.zero_phase(STAGE, np.full(n, T0)),
        "scheduled": lambda: periodic.zero_phase(STAGE, intervals),
        "previous": lambda: periodic.zero_phase(STAGE, intervals).shifted(-1),
        "squares": lambda: periodic.least_squares(known, 12, 3),
        "at output": lambda: periodic.least_squares(known, 12, 3, at_output=True),
        "four ahead": lambda: periodic.least_squares(known, 12, 4),
    }[design]()
    plant = periodic.sample(machine, intervals, late)
    return periodic.PeriodicLoop(plant, compensator, periodic.plain(n, q), gain)


def radius(*args, **more):
    return periodic.spectral_radius(loop_of(*args, **more))


# ---- thresholds ----

LIMITS = [
    ("scheduled", (1.0,), 0.8381433797),
    ("scheduled", Q21, 0.8584509887),
    ("previous", (1.0,), 0.6768631),
    ("nominal", (1.0,), 0.3390391543),
    ("nominal", Q20, 0.7067828313),
    ("at output", (1.0,), 0.3756875),
]


@pytest.mark.parametrize(("design", "q", "oracle"), LIMITS)
def test_limits_of_gamma_are_roots(design, q, oracle):
    """The oracle gives seven digits or more; roots to 1e-9."""
    root = brentq(lambda g: radius(design, g, 32, q) - 1, oracle - 0.02, oracle + 0.02, xtol=1e-9)
    assert root == pytest.approx(oracle, abs=2e-7)


def test_a_tie_of_look_aheads_is_a_tie():
    """At the end of the search both are stable by a hair: 2.39074e-8 and 5.485e-9 by the oracle in
    40 digits; double precision keeps two digits of that."""
    assert 1 - radius("squares", 0.99) == pytest.approx(2.39e-8, rel=0.02)
    assert 1 - radius("four ahead", 0.99) == pytest.approx(5.5e-9, rel=0.05)


def test_the_gain_limit_at_a_given_period_is_two_over_the_gain_at_its_lowest_odd_frequency():
    """1 - k g(w) = z^N = -1 at w = pi/N, where g = |B|^2/b is real: k = 2/g, by hand."""
    b = zdomain.zero_order_hold(periodic.balanced(STAGE), T0).b
    for n in (8, 32):
        g = np.abs(zdomain.evaluate(b, np.exp(1j * np.pi / n))) ** 2 / np.abs(b).sum() ** 2
        limit = brentq(lambda k, n=n: radius("nominal", 0.0, n, gain=k) - 1, 1.5, 2.5, xtol=1e-10)
        assert limit == pytest.approx(2 / g, rel=1e-7)
    assert np.all(b > 0)  # so that g is one at zero frequency and two is sharp


# ---- noise ----

POWER = [  # of the output per unit of noise; oracle: energies of all impulses summed
    ("squares", 0.1, 0.6648313173),
    ("nominal", 0.1, 0.4170977590),
    ("scheduled", 0.1, 0.3164723324),
    ("scheduled", 0.2, 0.3163386111),
    ("scheduled", 0.3, 0.3157332737),
    ("scheduled", 0.4, 0.3146086665),
    ("scheduled", 0.5, 0.3137328180),
]
PRINTED = np.array([0.156, 0.156, 0.152, 0.152, 0.151, 0.154, 0.169])  # µm, table 1


@pytest.mark.parametrize(("design", "gamma", "oracle"), POWER[:3] + POWER[-1:])
def test_noise_amplified_at_the_true_period(design, gamma, oracle):
    """The sum is broken off at 1e-11 of itself; the oracle gives ten digits."""
    found = periodic.noise_gain(loop_of(design, gamma, N, Q20))
    assert found**2 == pytest.approx(oracle, rel=1e-9)


def test_the_nominal_design_is_stable_and_cannot_be_run():
    """7.536395e8 by the oracle; rounding grows by the same factor, hence three digits."""
    loop = loop_of("nominal", 0.2, N, Q20)
    assert periodic.verdict(loop).verdict == "stable"
    assert periodic.noise_gain(loop) == pytest.approx(7.536e8, rel=1e-3)


def test_the_measured_error_contains_the_noise():
    """Every entry time followed by itself in a plain run: e = r - y - noise, energies summed."""
    loop = loop_of("scheduled", 0.3, 24, Q20)
    power = 0.0
    for entered in range(24):
        noise = np.zeros(40 * 24)
        noise[entered] = 1.0
        run = periodic.simulate(loop, np.zeros(noise.size), noise=noise)
        power += np.sum(run.measured_error**2) / 24
    assert periodic.noise_gain(loop, "measured_error") == pytest.approx(np.sqrt(power), rel=1e-9)


def test_one_level_of_noise_explains_the_nominal_and_most_scheduled_rows():
    """0.1324 µm as the machine measures, not 0.25; the oracle counts the error without noise in,
    some 6e-4 µm in squares, which lowers its levels by 1e-6 and 4e-6."""
    gains = np.sqrt(1 + np.array([power for *_, power in POWER]))
    level = gains @ PRINTED / (gains @ gains)
    assert level == pytest.approx(0.13244419, abs=2e-6)
    np.testing.assert_allclose(level * gains[1:6], PRINTED[1:6], atol=0.003)
    true = np.sqrt(gains**2 - 1)
    assert true @ PRINTED / (true @ true) == pytest.approx(0.25004666, abs=1e-5)


def test_without_noise_the_model_has_no_error_to_speak_of():
    """1 - Q at five waves in 1200 samples, of an amplitude of 12.5 µm: 6.06e-4 µm by hand."""
    loop = loop_of("scheduled", 0.1, N, Q20)
    found = signals.rms(periodic.steady_state(loop, BAR.reference(5, N)).error)
    by_hand = 0.2 * (1 - np.cos(2 * np.pi * 5 / N)) * 12.5e-6 / np.sqrt(2)
    assert found == pytest.approx(by_hand, rel=1e-3)


# ---- what would explain table 1 ----


def test_a_delay_is_an_exact_shift_of_what_is_held():
    """Against matrix exponentials from one switching instant to the next, delay over intervals."""
    intervals, late = boring_bar.sinusoidal_intervals(T0, 0.6, 12), 2.2 * T0
    plant = periodic.sample(STAGE, intervals, late)
    command = np.random.default_rng(0).standard_normal(24)
    state, found = np.zeros(plant.order), []
    for k, v in enumerate(command):
        found.append(plant.c @ state)
        state = plant.a[k % 12] @ state + plant.b[k % 12] * v
    at = np.concatenate([[0.0], np.cumsum(np.tile(intervals, 2))])
    system, joint = periodic.balanced(STAGE), np.zeros((7, 7))
    joint[:6, :6], joint[:6, 6] = system.A, system.B[:, 0]
    switches = np.concatenate([at, at + late])
    instants, x, outputs = np.unique(switches[switches <= at[-1] + 1e-12]), np.zeros(6), {}
    for begin, end in pairwise(instants):
        outputs[round(begin * 1e12)] = system.C[0] @ x
        held = np.searchsorted(at + late, begin + 1e-12) - 1
        step = scipy.linalg.expm(joint * (end - begin))
        x = step[:6, :6] @ x + step[:6, 6] * (command[held] if held >= 0 else 0.0)
    expected = [outputs[round(t * 1e12)] for t in at[:-1]]
    np.testing.assert_allclose(found, expected, atol=1e-11)


def test_no_delay_is_the_plant_itself():
    intervals = boring_bar.sinusoidal_intervals(T0, 0.3, 8)
    tiny, none = (periodic.sample(STAGE, intervals, late) for late in (1e-15, 0.0))
    np.testing.assert_allclose(tiny.a[:, :6, :6], none.a, rtol=1e-12)
    np.testing.assert_allclose(tiny.b[:, :6], none.b, rtol=1e-8, atol=1e-12)


def test_one_sample_of_unknown_delay_is_refuted_by_the_first_nominal_entry():
    """One impulse alone grows 7.5e10 times in 60 periods by the oracle: a lower bound."""
    loop = loop_of("nominal", 0.1, N, Q20, late=T0)
    assert periodic.transient_growth(loop, [60], 2)[0] > 7e10


RINGS_HIGHER = replace(BAR, stiffness=BAR.stiffness * 1.06**2, damping=BAR.damping * 1.06).plant
TOGETHER = [
    ("squares", 0.1, 2.156),
    ("squares", 0.2, 60.06),
    ("nominal", 0.1, 0.6692),
    ("scheduled", 0.5, 0.7706),
    ("scheduled", 0.6, 1.27e8),
]


@pytest.mark.parametrize(("design", "gamma", "oracle"), TOGETHER)
def test_a_delay_and_a_resonance_meet_the_stable_and_unstable_entries_of_table_1(
    design, gamma, oracle
):
    """The oracle follows every twelfth impulse and gives four digits, three of the last."""
    loop = loop_of(design, gamma, N, Q20, late=145e-6, machine=RINGS_HIGHER)
    assert periodic.noise_gain(loop) == pytest.approx(oracle, rel=2e-3)


# ---- growth ----


def test_growth_peaks_after_seventy_periods_and_is_exponential_in_n():
    """Oracle, in the norm of the memory alone: 5.70716e9 after 70 periods at N = 1200; in that of
    the whole state 102.5377, 37449.46 and 5.707878e9, all 3 percent more at most."""
    peaks = {}
    for n, oracle in ((300, 102.5377), (600, 37449.46), (1200, 5.707878e9)):
        periods = np.arange(int(0.054 * n), int(0.061 * n) + 1)
        growth = periodic.transient_growth(loop_of("nominal", 0.2, n, Q20), periods, 3)
        peaks[n] = growth.max()
        assert 0.97 * oracle < growth.max() < oracle
    assert periods[np.argmax(growth)] == 70
    assert growth.max() == pytest.approx(5.70716e9, rel=1e-4)
    rate = np.diff(np.log(list(peaks.values()))) / np.diff(list(peaks))
    np.testing.assert_allclose(rate, 0.0199, atol=2e-4)  # per sample, both halves alike


# ---- counting ----


def test_counted_multiplications_have_their_closed_form():
    """N - 1 products of matrices of N + 17 rows; and for the blocks, each transition matrix anew,
    sums of 17^3 over products, 17^2 and 17 over vectors, done here by hand."""
    tally = []

    def counting(left, right):
        tally.append(periodic.multiplications(left, right))
        return left @ right

    def counted(method, *args, **how):
        tally.clear()
        method(*args, **how)
        return sum(tally)

    n, loop = 18, loop_of("nominal", 0.1, 18)
    assert counted(periodic.product_of_matrices, loop, counting) == (n - 1) * (n + 17) ** 3
    products = [i for i in range(n - 1)]  # of matrices, to reach over i + 1 samples
    matrices, vectors = sum(products) * 17**3, (n - 1) * 17**2
    entries = n * (n - 1) // 2
    chains = sum(i for last in range(n) for i in range(last - 1))
    expected = {
        "A": (n - 1) * 17**3,
        "B": matrices + vectors,
        "C": matrices + vectors,
        "D": chains * 17**3 + (entries - (n - 1)) * 17**2 + entries * 17,
    }
    found = {each: counted(periodic.lift_by_products, loop, each, counting) for each in expected}
    assert found == expected


def test_the_printed_counts_cross_once_and_then_part():
    """N(N + 17)^3 against 17^3 (N + 2 N^2 + N^3/2), divided by N and moved to one side: its
    coefficients change their sign once, so that there is one crossing, and it lies here."""

    def ratio(n):
        return n * (n + 17) ** 3 / (17**3 * (n + 2 * n**2 + n**3 / 2))

    for times, first in ((1, 2410), (2, 4866)):
        assert ratio(first - 1) < times <= ratio(first)
        cubic = np.polyadd(np.poly([-17] * 3), -times * 17**3 * np.array([0.5, 2, 1]))
        assert np.sum(np.diff(np.sign(cubic[cubic != 0])) != 0) == 1
    assert ratio(1200) == pytest.approx(0.508, abs=5e-4)


def test_the_counts_of_the_run_part_earlier():
    """Each transition matrix anew, by the closed form of the test above; what is beside it (m1, m2
    and the inversion) moves the crossings by less than half a percent."""

    def anew(n):
        vectors, entries = (n - 1) * 17**2, n * (n - 1) // 2
        matrices = (n - 1) * (n - 2) // 2 * 17**3
        chains = sum((last - 1) * (last - 2) // 2 for last in range(1, n))
        lower = chains * 17**3 + (entries - (n - 1)) * 17**2 + entries * 17
        return (n - 1) * 17**3 + 2 * (matrices + vectors) + lower

    for times, first in ((1, 768), (2, 1588)):
        product = (first - 1) * (first + 17) ** 3
        assert product == pytest.approx(times * anew(first), rel=5e-3)


@pytest.mark.parametrize("carried", [True, False])
def test_the_blocks_of_the_appendix_are_those_of_the_recursion(carried):
    loop = loop_of("scheduled", 0.4, 14)
    for block, expected in zip("ABCD", periodic.lift(loop), strict=True):
        found = periodic.lift_by_products(loop, block, carried=carried)
        np.testing.assert_allclose(found, expected, atol=1e-13)
    np.testing.assert_allclose(
        periodic.lifted(loop, carried=carried), periodic.lifted(loop), atol=1e-13
    )


# ---- between the samples ----


def test_between_the_samples_is_the_plant_run_to_its_steady_state():
    """Run for fifty periods of twice as many, half as long intervals instead of solved for."""
    loop = loop_of("scheduled", 0.3, 16)
    command = periodic.steady_state(loop, BAR.reference(2, 16)).command
    time, found = periodic.between_samples(STAGE, loop.plant.intervals, command, 2)
    halves = np.repeat(loop.plant.intervals / 2, 2)
    plant, x, outputs = periodic.sample(STAGE, halves), np.zeros(6), []
    for k in range(50 * 32):
        outputs.append(plant.c @ x)
        x = plant.a[k % 32] @ x + plant.b[k % 32] * command[k % 32 // 2]
    np.testing.assert_allclose(found, outputs[-32:], atol=1e-12)
    np.testing.assert_allclose(time, np.cumsum(halves) - halves, rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(found[::2], BAR.reference(2, 16), atol=1e-12)


def test_the_nose_is_where_and_as_wide_as_it_says():
    t = np.array([0.0, 0.3, 1.0, 1.3, 0.5])
    found = boring_bar.nose(t, 1.3, 0.1, 1.0)
    np.testing.assert_allclose(found, [np.exp(-4.5), 1, np.exp(-4.5), 1, np.exp(-2)], rtol=1e-9)


# ---- chatter ----

BY_ANGLE = [(0.2, 3575723), (0.3225, 2617741), (0.5, 2748852), (1.0, 1298652)]


@pytest.mark.parametrize(("rvf", "oracle"), BY_ANGLE)
def test_limits_under_a_speed_that_is_a_sine_in_angle(rvf, oracle):
    """The oracle's law is in angle and its limits are converged to six digits; 1e-3 is the
    precision asked for here."""
    found = float(chatter.stability_limit(replace(CUT, law="angle", rvf=rvf)))
    assert found == pytest.approx(oracle, rel=2e-3)


DIPS = [((0.3, 0.34), 0.322, 2.03), ((0.46, 0.505), 0.48, 1.262), ((0.93, 0.975), 0.949, 1.227)]


@pytest.mark.parametrize(("within", "at", "limit"), DIPS)
def test_a_dip_is_a_minimum_of_a_converged_limit(within, at, limit):
    """Under eq. 15.  Steps of the integration half as long again move the places by up to 4e-4 and
    the limits by 2e-4 of themselves; a grid of 0.0025 found the same dips."""

    def limit_at(rvf, per_cycle=8):
        one = replace(CUT, rvf=rvf)
        return float(chatter.stability_limit(one, precision=1e-4, per_cycle=per_cycle)) / K0

    found = minimize_scalar(limit_at, bounds=within, method="bounded", options={"xatol": 2e-4})
    assert found.x == pytest.approx(at, abs=1e-3)
    assert found.fun == pytest.approx(limit, rel=1e-3)
    assert limit_at(found.x, 16) == pytest.approx(found.fun, rel=1e-3)


def test_half_is_no_dip_and_one_turn_gains_nothing():
    """At one period a turn the delay is constant again, 2 pi/(w0 sqrt(1 - rva^2)) in angle or
    2 pi/w0 in time: the limit is that of constant speed, in closed form."""
    half, once = chatter.stability_limit(replace(CUT, rvf=np.array([0.5, 1.0]))) / K0
    assert 2.0 < half < 2.2
    constant = float(chatter.lobes(CUT.mode, CUT.speed)[0]) / K0
    assert once == pytest.approx(constant, rel=2e-3)
