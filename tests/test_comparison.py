"""The comparison: margins, noise and rivals by second routes, and a rule of tuning that is kept."""

from dataclasses import replace

import control
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import scipy.signal

from rcbook import pictures, signals, zdomain
from rcbook.comparison import contenders, margins, measures, rivals, tuning, varying
from rcbook.comparison.tuning import Budget
from rcbook.loops import learning, memory, periodic, repetitive
from rcbook.loops.learning import Scheme
from rcbook.loops.periodic import PeriodicLoop
from rcbook.loops.repetitive import Loop, RepetitiveController
from rcbook.zdomain import Plant

FIRST = Plant([0.4], [1.0, -0.6], 1, 0.01)  # of unit steady gain
N = 24
SYSTEM = control.ss(control.tf([400.0], [1.0, 30.0, 400.0]))  # well damped, 20 rad/s
DT = 0.02
SECOND = zdomain.zero_order_hold(SYSTEM, DT)


def loop_of(controller, plant=FIRST):
    return Loop(plant, controller, "plug-in")


def filtered(gain=0.3, width=0.2, plant=SECOND, period=N):
    kept = memory.plain(period, contenders.smoothing(width))
    inverse = zdomain.zero_phase_inverse(plant)
    return loop_of(RepetitiveController(inverse, kept, gain), plant)


LOOPS = {
    "PI": loop_of(rivals.proportional_integral(N, 0.15, 0.9), SECOND),
    "peak filter": loop_of(rivals.peak_filter(SECOND, N, [1, 2], 0.02, 0.02), SECOND),
    "observer": loop_of(rivals.disturbance_observer(SECOND, N, 0.8), SECOND),
    "resonators": loop_of(memory.resonators(SECOND, N, [0, 1, 2], 0.02), SECOND),
    "filtered": filtered(),
    "second order": loop_of(
        rivals.second_order(
            zdomain.zero_phase_inverse(SECOND), memory.plain(N, [0.25, 0.5, 0.25]), 0.2, 0.1
        ),
        SECOND,
    ),
}
each = pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS)


def stable(loop):
    return bool(np.abs(loop.roots).max() < 1)


# ---- margins ----


def test_the_delay_margin_of_an_integrator_is_known():
    """k z^-1/(1 - z^-1) crosses one where 2 sin(w/2) = k, with the phase -pi/2 - w/2."""
    still = Plant([1.0], [1.0], 1, 0.01)
    for gain in (0.05, 0.3, 0.8):
        w = 2 * np.arcsin(gain / 2)
        found = margins.delay_margin(loop_of(rivals.Feedback([1.0], [1.0, -1.0], N, gain), still))
        assert found == pytest.approx((np.pi / 2 - w / 2) / w, rel=1e-9)
        found = margins.gain_margin(loop_of(rivals.Feedback([1.0], [1.0, -1.0], N, gain), still))
        assert found == pytest.approx(2 / gain, rel=1e-9)  # the root 1 - k leaves at -1


@each
def test_the_delay_margin_is_where_whole_extra_samples_lose_the_loop(loop):
    margin = margins.delay_margin(loop)
    held = [
        stable(replace(loop, repetitive=rivals.as_feedback(loop.repetitive, late)))
        for late in range(int(margin) + 2)
    ]
    assert held == [True] * (int(margin) + 1) + [False]


@each
def test_the_delay_margin_agrees_with_a_fine_fractional_delay(loop):
    """Ten times as many samples, of which the loop uses every tenth: a delay of tenths is whole.

    In z^(1/10) the loop has the polynomials of z with gaps, and the delay is a shift; the roots of
    the fine polynomial are those of e^(-j w delay) at all the frequencies that matter.
    """
    fine, margin = 10, margins.delay_margin(loop)
    d, n = loop.open_polynomials

    def lost(tenths):
        def spread(p):
            return np.kron(p, np.eye(1, fine)[0])

        polynomial = zdomain.add(spread(d), zdomain.shift(spread(n), tenths))
        roots = np.roots(np.trim_zeros(polynomial, "b"))
        first = np.abs(np.angle(roots)) <= np.pi / fine  # the rest are images of the gaps
        return bool(np.abs(roots[first]).max() > 1 + 1e-9)

    assert not lost(int(np.floor(fine * margin)))
    assert lost(int(np.ceil(fine * margin)))


@each
def test_the_gain_margin_is_the_end_of_the_stable_gains(loop):
    d, n = loop.open_polynomials
    size = max(d.size, n.size)
    d, n = (np.pad(p, (0, size - p.size)) for p in (d, n))
    margin = margins.gain_margin(loop)
    inside, outside = (np.abs(np.roots(d + f * margin * n)).max() for f in (1 - 1e-6, 1 + 1e-6))
    assert inside < 1 < outside
    within = np.linspace(0.05, 1, 20) * margin * (1 - 1e-6)
    assert all(np.abs(np.roots(d + f * n)).max() < 1 for f in within if f >= 1)


def test_a_loop_that_is_lost_has_no_margins():
    lost = filtered(gain=2.5, width=0.9)
    assert not margins.is_stable(lost)
    assert margins.delay_margin(lost) == margins.gain_margin(lost) == 0.0
    assert margins.noise_gain(lost) == np.inf


def schemes():
    law = learning.zero_phase_law(SECOND, 0.4, "peak", contenders.smoothing(0.5))
    optimal = replace(learning.norm_optimal_law(SECOND, 2.0, N), q=contenders.smoothing(0.3))
    return {"zero-phase": Scheme(SECOND, law, N), "norm-optimal": Scheme(SECOND, optimal, N)}


@pytest.mark.parametrize("scheme", schemes().values(), ids=schemes())
def test_margins_of_passes_are_those_of_a_plant_that_is_later_or_stronger(scheme):
    """By the multipliers of passes on another plant, whole samples late, and stronger."""
    margin = margins.pass_delay_margin(scheme)
    held = [
        learning.spectral_radius(replace(scheme, plant=replace(SECOND, delay=SECOND.delay + late)))
        < 1
        for late in range(int(margin) + 2)
    ]
    assert held == [True] * (int(margin) + 1) + [False]
    factor = margins.pass_gain_margin(scheme)
    radii = [
        learning.spectral_radius(replace(scheme, plant=replace(SECOND, b=f * factor * SECOND.b)))
        for f in (1 - 1e-9, 1 + 1e-9)
    ]
    assert radii[0] < 1 < radii[1]


# ---- rivals ----


def test_the_observer_leaves_of_noise_the_low_pass_behind_the_delay():
    """On z^-1 0.4/(1 - 0.6 z^-1): T = F z^-1 with F = (1 - p)/(1 - p z^-1), and nothing else."""
    pole = 0.7
    loop = loop_of(rivals.disturbance_observer(FIRST, N, pole))
    z = zdomain.unit_circle(64, 0.5)
    expected = (1 - pole) / (1 - pole / z) / z
    found = -repetitive.frequency_response(
        loop, "noise", "output", np.angle(z) / (2 * np.pi * 0.01)
    )
    np.testing.assert_allclose(found, expected, atol=1e-12)
    # closed form of the norm of F
    assert margins.noise_gain(loop) == pytest.approx(np.sqrt((1 - pole) / (1 + pole)), rel=1e-12)


def test_the_observer_undoes_a_constant_disturbance_and_says_so_sample_by_sample():
    """Beside the loop stands the observer as it is drawn: estimate, low-pass, subtract."""
    pole, n = 0.7, 80
    w = np.where(np.arange(n) >= 5, 1.0, 0.0)
    loop = loop_of(rivals.disturbance_observer(FIRST, N, pole))
    found = repetitive.respond(loop, np.zeros(n), disturbance=w).output
    y, u, estimate = np.zeros((3, n))
    for k in range(1, n):
        y[k] = 0.6 * y[k - 1] + 0.4 * (u[k - 1] + w[k - 1])
        seen = (y[k] - 0.6 * y[k - 1]) / 0.4 - u[k - 1]  # the disturbance of a sample ago
        estimate[k] = pole * estimate[k - 1] + (1 - pole) * seen
        u[k] = -estimate[k]
    np.testing.assert_allclose(found, y, atol=1e-12)
    assert abs(found[-1]) < 1e-9


def test_an_observer_keeps_zeros_that_cannot_be_cancelled():
    plant = Plant([1.0, 2.0], [1.0, -0.5], 1, 0.01)
    loop = loop_of(rivals.disturbance_observer(plant, N, 0.6), plant)
    z = zdomain.unit_circle(64, 0.5)
    found = -repetitive.frequency_response(
        loop, "noise", "output", np.angle(z) / (2 * np.pi * 0.01)
    )
    np.testing.assert_allclose(found, 0.4 / (1 - 0.6 / z) * (1 + 2 / z) / 3 / z, atol=1e-12)
    assert stable(loop)


def test_a_peak_filter_has_its_poles_and_height_where_it_says():
    gain, damping = 0.02, 0.01
    controller = rivals.peak_filter(FIRST, N, [1, 3], gain, damping)
    angles = 2 * np.pi * np.array([1, 3]) / N
    poles = np.roots(controller.denominator)
    expected = np.exp((1j - damping) * angles)
    np.testing.assert_allclose(
        np.sort_complex(poles), np.sort_complex(np.append(expected, expected.conj())), atol=1e-12
    )
    # one resonator: gain Re{(1 - e^-jw s z^-1)/G}/(1 - 2 s cos w z^-1 + s^2 z^-2), by hand
    single, w = rivals.peak_filter(FIRST, N, [3], gain, damping), angles[1]
    s, g = np.exp(-damping * w), 0.4 / (np.exp(1j * w) - 0.6)
    z = np.exp(1j * np.linspace(0.1, 3, 30))
    top = (1 / g).real - (np.exp(-1j * w) / g).real * s / z
    bottom = 1 - 2 * s * np.cos(w) / z + s**2 / z**2
    found = zdomain.evaluate(single.numerator, z) / zdomain.evaluate(single.denominator, z)
    np.testing.assert_allclose(found, gain * top / bottom, rtol=1e-12)
    at = np.exp(1j * w)
    peak = zdomain.evaluate(single.numerator, at) / zdomain.evaluate(single.denominator, at)
    # the height is exact to first order in damping w; its square is 6e-5
    assert abs(peak * g) == pytest.approx(gain / (2 * damping * w), rel=2e-2)


def test_a_peak_filter_without_damping_is_the_bank_of_resonators():
    peaks = rivals.peak_filter(FIRST, N, [1, 2], 0.03, 1e-9)
    bank = memory.resonators(FIRST, N, [1, 2], 0.03)
    np.testing.assert_allclose(peaks.numerator, bank.numerator, atol=1e-8)
    np.testing.assert_allclose(peaks.denominator, bank.denominator, atol=1e-8)


def test_pi_is_the_controller_of_the_repetitive_room():
    ours, theirs = rivals.proportional_integral(N, 0.3, 0.7), repetitive.pi_controller(0.3, 0.7, 1)
    np.testing.assert_array_equal(ours.numerator, theirs.numerator)
    np.testing.assert_array_equal(ours.denominator, theirs.denominator)


def test_a_second_order_with_full_share_is_the_memory_twice():
    kept, inverse = memory.plain(N, [0.25, 0.5, 0.25]), zdomain.zero_phase_inverse(SECOND)
    both = RepetitiveController(inverse, memory.several(kept, kept), 0.4)
    z = np.exp(1j * np.linspace(0.01, 3.1, 40))
    response = zdomain.evaluate(both.numerator, z) / zdomain.evaluate(both.denominator, z)
    # H of several is 2 h - h^2 = h (1 + (1 - h)): proportion one, and a share of one of the sum
    mine = rivals.second_order(inverse, kept, 0.4, 1.0)
    once = RepetitiveController(inverse, kept, 0.4)
    h = zdomain.evaluate(kept.polynomial, z)
    single = zdomain.evaluate(once.numerator, z) / zdomain.evaluate(once.denominator, z)
    found = zdomain.evaluate(mine.numerator, z) / zdomain.evaluate(mine.denominator, z)
    np.testing.assert_allclose(found, single * (1 + h / (1 - h)), rtol=1e-9)
    np.testing.assert_allclose(response, single * (1 + 1 / (1 - h)), rtol=1e-9)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: rivals.peak_filter(FIRST, N, [0], 0.1, 0.02), "harmonic 0"),
        (lambda: rivals.peak_filter(FIRST, N, [1], 0.1, 0.0), "damping"),
        (lambda: rivals.disturbance_observer(FIRST, N, 1.0), "pole = 1.0"),
        (lambda: rivals.disturbance_observer(Plant([1, -1], [1], 1, 1), N, 0.5), "zero at z = 1"),
        (lambda: rivals.disturbance_observer(Plant([1], [1, -1], 1, 1), N, 0.5), "close a loop"),
        (lambda: rivals.Feedback([1.0], [0.0, 1.0], N), "begins with 0"),
        (lambda: rivals.as_feedback(LOOPS["PI"].repetitive, -1), "late = -1"),
        (lambda: measures.task(2), "period = 2"),
        (lambda: Budget(0.0, 1.0), "noise_gain"),
        (lambda: measures.quantised(LOOPS["PI"], np.ones(9), 0.0), "step"),
        (lambda: varying.closed(periodic.sample(SYSTEM, [DT]), None, "load"), "source 'load'"),
    ],
)
def test_wrong_input_is_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


# ---- noise ----


@each
def test_the_noise_gain_is_that_of_a_long_run(loop):
    """The mean square of 4e5 samples has some 1e4 independent ones or more: within five percent."""
    noise = np.random.default_rng(7).standard_normal(400_000)
    run = repetitive.respond(loop, np.zeros(noise.size), noise=noise)
    assert margins.noise_gain(loop) == pytest.approx(signals.rms(run.output[1000:]), rel=0.05)


@pytest.mark.parametrize("shape", [([1.0], [1.0]), ([1.0], [1.0, -0.9]), ([1.0, -1.0], [1.0])])
def test_coloured_noise_is_that_of_a_long_run(shape):
    numerator, denominator = map(np.array, shape)
    noise = scipy.signal.lfilter(*shape, np.random.default_rng(8).standard_normal(400_000))
    noise /= signals.rms(noise)
    run = repetitive.respond(LOOPS["filtered"], np.zeros(noise.size), noise=noise)
    found = measures.coloured_noise_gain(LOOPS["filtered"], numerator, denominator)
    assert found == pytest.approx(signals.rms(run.output[1000:]), rel=0.05)


# ---- a plant whose intervals vary ----

CONSTANT = periodic.sample(SYSTEM, np.full(N, DT))
UNEVEN = periodic.sample(SYSTEM, DT * (1 + 0.2 * np.sin(2 * np.pi * np.arange(N) / N)))
NOMINAL = ("PI", "peak filter", "observer", "resonators")


@pytest.mark.parametrize("name", NOMINAL)
def test_at_constant_intervals_the_varying_loop_is_the_loop_in_time(name):
    loop, controller = LOOPS[name], rivals.as_feedback(LOOPS[name].repetitive)
    closed = varying.closed(CONSTANT, controller, "noise")
    assert varying.spectral_radius(closed) == pytest.approx(
        repetitive.spectral_radius(loop), rel=1e-6
    )
    assert varying.noise_gain(closed) == pytest.approx(margins.noise_gain(loop), rel=1e-6)
    work = measures.task(N)
    ours, theirs = measures.at_nominal(CONSTANT, controller), measures.in_time(loop)
    pairs = zip(
        ours.settled(work.reference, work.disturbance),
        theirs.settled(work.reference, work.disturbance),
        strict=True,
    )
    for mine, other in pairs:
        np.testing.assert_allclose(mine, other, atol=1e-7)
    started = (x.started(work.reference, work.disturbance, 5) for x in (ours, theirs))
    np.testing.assert_allclose(*started, atol=1e-9)


@pytest.mark.parametrize("name", NOMINAL)
def test_a_varying_loop_settles_to_what_is_computed(name):
    """The steady state against a run from rest, the controller by its own recursion."""
    controller, work = rivals.as_feedback(LOOPS[name].repetitive), measures.task(N)
    error, command = measures.at_nominal(UNEVEN, controller).settled(
        work.reference, work.disturbance
    )
    n = 120 * N
    r, w = np.resize(work.reference, n), np.resize(work.disturbance, n)
    e, u, x = np.zeros(n), np.zeros(n), np.zeros(UNEVEN.order)
    b, a = controller.numerator, controller.denominator
    for k in range(n):
        e[k] = r[k] - UNEVEN.c @ x
        past = sum(b[i] * e[k - i] for i in range(min(b.size, k + 1)))
        past -= sum(a[i] * u[k - i] for i in range(1, min(a.size, k + 1)))
        u[k] = past / a[0]
        x = UNEVEN.a[k % N] @ x + UNEVEN.b[k % N] * (r[k] + u[k] + w[k])
    np.testing.assert_allclose(error, e[-N:], atol=1e-6)
    np.testing.assert_allclose(command, (r + u)[-N:], atol=1e-6)


def test_noise_at_varying_intervals_is_that_of_a_long_run():
    closed = varying.closed(UNEVEN, LOOPS["PI"].repetitive, "noise")
    noise = np.random.default_rng(9).standard_normal(2000 * N)
    found = signals.rms(varying.answer(closed, noise)[50 * N :])
    assert varying.noise_gain(closed) == pytest.approx(found, rel=0.05)


def test_a_periodic_loop_corrects_as_the_loop_in_time_does():
    """At constant intervals, in the plug-in form: the periodic room is given what is left."""
    kept, taps = memory.plain(N, [0.25, 0.5, 0.25]), periodic.zero_phase(SYSTEM, np.full(N, DT))
    inverse = zdomain.zero_phase_inverse(SECOND, 1e-9, "l1")
    loop = loop_of(RepetitiveController(inverse, kept, 0.5), SECOND)
    work = measures.task(N)
    ours = measures.at_angles(PeriodicLoop(CONSTANT, taps, kept, 0.5))
    theirs = measures.in_time(loop)
    for r, w in ((work.reference, work.disturbance), (np.zeros(2 * N), work.between)):
        for mine, other in zip(ours.settled(r, w), theirs.settled(r, w), strict=True):
            np.testing.assert_allclose(mine, other, atol=1e-9)
    started = (x.started(work.reference, work.disturbance, 6) for x in (ours, theirs))
    np.testing.assert_allclose(*started, atol=1e-9)


# ---- measures ----


def test_periods_to_one_percent_are_those_of_a_simulation():
    """Sample by sample, and by the factor: a plain memory on an exact inverse leaves 1 - gain."""
    inverse, work, gain = zdomain.zero_phase_inverse(FIRST), measures.task(N), 0.4
    loop = loop_of(RepetitiveController(inverse, memory.plain(N), gain))
    alone = contenders.uncontrolled(FIRST)
    found = measures.measures(measures.in_time(loop), alone, work, 40)
    run = repetitive.simulate(
        loop, np.tile(work.reference, 40), disturbance=np.tile(work.disturbance, 40)
    )
    by_period = np.sqrt(np.mean(run.error.reshape(40, N) ** 2, axis=1))
    still = signals.rms(alone.settled(work.reference, work.disturbance)[0])
    assert found["periods"] == np.flatnonzero(by_period > 0.01 * still)[-1] + 1
    by_factor = np.ceil(np.log(0.01) / np.log(1 - gain))
    assert abs(found["periods"] - by_factor) <= 1
    assert found["reference"] < 1e-12
    shorter = measures.measures(measures.in_time(loop), alone, work, 5)
    assert shorter["periods"] == np.inf


def test_the_errors_are_those_of_the_sensitivity():
    """In the plug-in form an error without a controller is multiplied by S, also out of step."""
    loop, work = LOOPS["PI"], measures.task(N)
    found = measures.measures(measures.in_time(loop), contenders.uncontrolled(SECOND), work, 5)
    frequency = 1.5 / (N * DT)
    expected = abs(repetitive.sensitivity(loop, [frequency])[0])
    assert found["between"] == pytest.approx(expected, rel=1e-9)
    assert measures.error_at(loop, work) == pytest.approx(found["reference"], rel=1e-9)


def test_an_error_of_the_period_is_that_of_a_longer_period():
    """A change of a quarter makes 24 samples 30: the task of 30 samples, on the loop of 24."""
    loop = LOOPS["filtered"]
    longer = measures.task(30)
    left, without = (
        x.settled(longer.reference, 0 * longer.reference)[0]
        for x in (
            measures.Response(_common(loop), None),
            contenders.uncontrolled(SECOND),
        )
    )
    expected = signals.rms(left) / signals.rms(without)
    assert measures.error_at(loop, measures.task(N), 0.25) == pytest.approx(expected, rel=1e-9)


def _common(loop):
    """Steady state over the common length of both periods, of which the first 30 are kept."""

    def settled(r, w):
        run = repetitive.steady_state(loop, np.resize(r, 120), disturbance=np.resize(w, 120))
        return run.error, run.command

    return settled


def test_the_period_margin_is_met_from_both_sides():
    loop, work = filtered(width=0.9), measures.task(N)
    margin = measures.period_margin(loop, work)
    ends = [measures.error_at(loop, work, sign * margin) for sign in (1, -1)]
    assert max(ends) == pytest.approx(0.1, rel=1e-6)
    assert measures.period_margin(LOOPS["PI"], work) == 0.0


def test_passes_alternate_as_they_are_simulated_and_feedforward_feels_no_disturbance():
    scheme, work = schemes()["zero-phase"], measures.task(N)
    few, many = (
        measures.of_passes(scheme, n).settled(np.zeros(2 * N), work.between)[0] for n in (400, 800)
    )
    np.testing.assert_allclose(few, many, atol=1e-12)
    found = contenders.of_passes(SECOND, N, Budget(0.3, 1.0))["ZPETC"]
    asked = contenders.answers(found, contenders.uncontrolled(SECOND), work)
    assert asked["disturbance"] == pytest.approx(1.0, rel=1e-9)
    assert asked["noise gain"] == 0.0 and asked["delay margin"] == np.inf


def test_a_quantised_run_reads_its_own_output_in_steps():
    """Against a run sample by sample, in which the reading is rounded before it is fed back."""
    loop, step, n = LOOPS["PI"], 0.1, 200
    r = np.resize(measures.task(N).reference, n)
    b, a = loop.repetitive.numerator, loop.repetitive.denominator
    y, e, u, sent = np.zeros((4, n))
    for k in range(n):
        for i, c in enumerate(SECOND.numerator):
            y[k] += c * sent[k - i] if k >= i else 0.0
        y[k] -= sum(c * y[k - i] for i, c in enumerate(SECOND.a) if i and k >= i)
        e[k] = r[k] - step * np.round(y[k] / step)
        u[k] = sum(c * e[k - i] for i, c in enumerate(b) if k >= i)
        u[k] -= sum(c * u[k - i] for i, c in enumerate(a) if i and k >= i)
        sent[k] = r[k] + u[k]
    np.testing.assert_allclose(measures.quantised(loop, r, step), y, atol=1e-9)


# ---- the rule ----

BUDGET = Budget(0.3, 1.0)


@pytest.fixture(scope="module")
def tuned():
    return contenders.in_time(SECOND, N, BUDGET) | contenders.of_passes(SECOND, N, BUDGET)


def test_no_contender_exceeds_the_noise_budget_and_each_spends_what_it_says(tuned):
    for who, result in tuned.items():
        t = result.tuned
        assert t.noise_gain <= 0.3, who
        if t.spends in ("both", "noise"):
            assert t.noise_gain == pytest.approx(0.3, rel=2e-3), who
        if t.spends == "both":
            assert 1.0 <= t.delay_margin < 1.05, who
        if t.spends != "noise, over on delay" and t.loop is not None:
            assert t.delay_margin >= 1.0, who
    assert tuned["filtered"].tuned.spends == "both"
    assert tuned["prototype"].tuned.spends == "noise, over on delay"
    assert tuned["prototype"].tuned.delay_margin < 1.0


def test_learning_from_pass_to_pass_hears_what_the_filtered_memory_hears(tuned):
    one, other = tuned["filtered"].tuned, tuned["pass to pass"].tuned
    assert one.gain == pytest.approx(other.gain, rel=5e-3)


def model(gain, width):
    """A loop of two numbers whose noise is its gain and whose margin falls with both."""
    return gain, 0.0 if np.isnan(width) else width


@pytest.mark.parametrize(
    "slope, has_width, spends, gain, width",
    [
        (0.5, False, "noise", 0.3, np.nan),
        (0.5, True, "noise", 0.3, 0.98),
        (1.5, True, "both", 0.3, 1 / 1.5 - 0.3),
        (6.0, True, "delay", 1 / 6.0, 0.0),
        (6.0, False, "delay", 1 / 6.0, np.nan),
        (1e9, False, "noise, over on delay", 0.3, np.nan),
    ],
)
def test_the_rule_takes_each_of_its_branches(slope, has_width, spends, gain, width):
    """margin = 2 - slope (gain + width): the solutions are read off."""
    found = tuning.tune(
        model, lambda x: x[0], lambda x: 2 - slope * (x[0] + x[1]), BUDGET, has_width
    )
    assert found.spends == spends
    assert found.gain == pytest.approx(gain, rel=2e-3)
    assert found.width == pytest.approx(width, abs=2e-3, nan_ok=True)


def test_a_contender_that_is_always_too_loud_gets_no_loop():
    found = tuning.tune(model, lambda x: np.inf, lambda x: 0.0, BUDGET)
    assert found.loop is None and found.spends == "none"
    asked = contenders.answers(
        contenders.Result(found, None, np.nan), contenders.uncontrolled(SECOND), measures.task(N)
    )
    assert np.all(np.isnan(list(asked.values())))


def test_a_varying_plant_of_constant_intervals_is_tuned_as_the_constant_one(tuned):
    """The loops are the same; PI and observer are quick to compute by both routes."""
    found = contenders.at_angles(SYSTEM, np.full(N, DT), DT, BUDGET)
    for who in ("PI", "disturbance observer", "resonators"):
        ours, theirs = found[who], tuned[who]
        assert ours.tuned.gain == pytest.approx(theirs.tuned.gain, rel=2e-3), who
        assert ours.gain_margin == pytest.approx(theirs.gain_margin, rel=5e-3), who
    # the continuous plant is late, not its samples: whole samples agree, others nearly
    assert found["PI"].tuned.delay_margin == pytest.approx(tuned["PI"].tuned.delay_margin, rel=2e-2)
    assert found["scheduled"].tuned.gain == found["filtered"].tuned.gain


# ---- the picture ----


def test_a_heat_map_says_what_does_not_exist_and_what_never_comes():
    values = pd.DataFrame({"a": [0.5, np.nan], "b": [np.inf, 2e-4]}, index=["x", "y"])
    with plt.style.context("default"):
        _, ax = plt.subplots()
        pictures.draw_heat_map(ax, values, "t", marked={("x", "a"), ("y", "a")}, never="never")
        texts = [text.get_text() for text in ax.texts]
        plt.close("all")
    assert texts == ["0.5*", "never", "–", "<0.001"]
