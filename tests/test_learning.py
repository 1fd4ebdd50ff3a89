"""Learning from pass to pass by several routes: definition, matrices, FFT, repetitive loop."""

from dataclasses import replace

import numpy as np
import pytest
from learning_cases import LAG, Q1, Q2, RESTS, SEEDS, SERVO, each_plant, each_seed
from oracles.learning import (
    by_definition,
    circulant,
    circulant_law,
    free_response,
    lifted_pass,
    papers_loop,
    spectral_error,
)

from rcbook.loops import learning, repetitive
from rcbook.loops.learning import CONTINUOUS, PERIODIC, RESET, LearningLaw, Scheme, Start
from rcbook.loops.repetitive import Loop, RepetitiveController
from rcbook.loops.run import BOUND, Limit, Limits
from rcbook.machines import lathe
from rcbook.zdomain import NoncausalFilter, Plant

FORGETFUL = [Start(s.before, s.after, True) for s in (CONTINUOUS, *RESTS)]
STARTS = [PERIODIC, CONTINUOUS, *RESTS, *FORGETFUL]
each_start = pytest.mark.parametrize("start", STARTS, ids=str)


def make(q=(1.0,), gain=0.7, plant=None):
    """A plant, and a law designed on a slightly wrong idea of it."""
    plant = SERVO.plant if plant is None else plant
    believed = Plant(1.1 * plant.b, [1.0, plant.a[1] - 0.03, *plant.a[2:]], plant.delay, plant.dt)
    return plant, learning.zero_phase_law(believed, gain, "peak", q)


def run(plant, law, r, passes, start=PERIODIC, **options):
    scheme = Scheme(plant, law, len(r), start)
    return learning.simulate(scheme, r, passes=passes, **options)


# ---- the definition, sample by sample ----


def check_definition(simulate, start, q, seed, plant=None, n=13, rest=0.4, own=False):
    rng = np.random.default_rng(seed)
    plant, law = make(q, plant=plant)
    r, noise = rng.standard_normal(n), 0.3 * rng.standard_normal((4, n))
    first = r if not own else rng.standard_normal(n)
    found = simulate(Scheme(plant, law, n, start), r, passes=3, rest=rest, noise=noise,
                     first=None if not own else first)  # fmt: skip
    u, y = by_definition(plant, law, r, first, noise, start, rest)
    # rounding of some hundred operations on numbers of size 10
    np.testing.assert_allclose(found.command, u, atol=1e-11 * np.abs(u).max())
    np.testing.assert_allclose(found.output, y, atol=1e-11 * np.abs(y).max())
    np.testing.assert_array_equal(found.error, r - found.output)
    np.testing.assert_array_equal(found.measured_error, r - found.output - noise)
    np.testing.assert_array_equal(found.largest_error, [max(abs(e)) for e in found.error])
    np.testing.assert_array_equal(found.time, [k * plant.dt for k in range(n)])
    assert (found.unbounded, found.command_clipped) == (False, 0)


@each_start
@pytest.mark.parametrize("q", [[1.0], Q1, Q2], ids=["q = 1", "short q", "long q"])
@each_seed
def test_every_start_follows_its_definition(start, q, seed):
    check_definition(learning.simulate, start, q, seed, own=seed % 2)


@each_start
@each_plant
def test_every_start_follows_its_definition_on_other_plants(start, plant):
    check_definition(learning.simulate, start, Q1, 11, plant)


@each_start
def test_a_pass_just_longer_than_the_look_ahead_follows_its_definition(start):
    _, law = make(Q2)
    check_definition(learning.simulate, start, Q2, 5, n=law.look_ahead + 1)


@each_start
def test_a_pass_shorter_than_the_memory_of_the_plant_follows_its_definition(start):
    long = Plant([1.0], [1, *np.zeros(6), 0.1], 1, 1.0)
    check_definition(learning.simulate, start, [1.0], 5, long, n=3)


@each_start
@each_seed
def test_pass_0_is_commanded_by_the_reference_or_what_is_given_instead(start, seed):
    """Lee, Oh and Kim, eq. 18: nothing of it is corrected, filtered or learned."""
    rng = np.random.default_rng(seed)
    plant, law = make(Q2)
    r, first = rng.standard_normal((2, 12))
    for passes in (0, 3):
        np.testing.assert_array_equal(run(plant, law, r, passes, start).command[0], r)
        found = run(plant, law, r, passes, start, first=first)
        np.testing.assert_array_equal(found.command[0], first)
        np.testing.assert_array_equal(found.reference, r)


@pytest.mark.parametrize("forgets, fifth", [(True, 0.11250799), (False, 0.10785032)])
def test_a_running_square_leaves_pass_0_alone(forgets, fifth):
    """Square, 64 samples a turn, 16 a pass: the corner that ends pass 0 is missed by 2.275 mm; a
    law that reached back into pass 0 would make it 2.526."""
    law = learning.zero_phase_law(SERVO.plant)
    r = lathe.polygon_section(lathe.spindle_angle(16, 64, np.pi / 4), 4, 10.0)
    start = Start("previous", "next", forgets)
    found = run(SERVO.plant, law, r, 5, start, rest=10 * np.sqrt(2))
    # rounding of a hundred samples of size 14
    np.testing.assert_allclose(
        found.largest_error, papers_loop(16, 64, forgets, 5), rtol=0, atol=1e-11
    )
    assert found.largest_error.max() == pytest.approx(2.27485238, abs=5e-9)  # eight decimals
    assert found.largest_error[5] == pytest.approx(fifth, abs=5e-9)


# ---- disturbance, limits, and passes that run away ----


def check_limits(simulate, start, q, remember, each_pass):
    rng = np.random.default_rng(7)
    plant, law = make(q)
    r, w, noise = (
        rng.standard_normal(13),
        rng.standard_normal((4, 13)),
        rng.standard_normal((4, 13)),
    )
    w = w if each_pass else np.tile(w[0], (4, 1))
    limits = Limits(Limit(1.1, remember))
    found = simulate(Scheme(plant, law, 13, start), r, passes=3, rest=0.4, noise=noise,
                     disturbance=w if each_pass else w[0], limits=limits)  # fmt: skip
    u, y = by_definition(plant, law, r, r, noise, start, 0.4, w, 1.1, remember)
    # rounding, as without limits
    np.testing.assert_allclose(found.command, u, atol=1e-11 * np.abs(u).max())
    np.testing.assert_allclose(found.output, y, atol=1e-11 * np.abs(y).max())
    np.testing.assert_array_equal(found.disturbance, w)
    assert found.command_clipped == np.sum(np.abs(u) == 1.1) > 5


@each_start
@pytest.mark.parametrize("q", [[1.0], Q1], ids=["q = 1", "short q"])
@pytest.mark.parametrize("remember", [True, False])
@pytest.mark.parametrize("each_pass", [True, False])
def test_a_limited_disturbed_run_follows_its_definition(start, q, remember, each_pass):
    check_limits(learning.simulate, start, q, remember, each_pass)


@pytest.mark.parametrize("start", [PERIODIC, CONTINUOUS, RESET], ids=str)
def test_passes_that_run_away_are_cut_before_the_bound(start):
    law = learning.p_type_law(6.0, 1)
    r = np.random.default_rng(1).standard_normal(8)
    found = run(LAG, law, r, 200, start)
    assert found.unbounded
    shape = found.command.shape
    assert 5 < shape[0] < 100
    assert shape == found.output.shape == found.noise.shape == found.disturbance.shape
    largest = max(np.abs(found.command).max(), np.abs(found.output).max())
    assert largest <= BOUND * np.abs(r).max()
    # all the same, and none of them cut too early
    again = run(LAG, law, r, shape[0] - 1, start)
    np.testing.assert_array_equal(again.command, found.command)
    assert not again.unbounded
    assert run(LAG, law, r, shape[0], start).unbounded
    # a pass grows by less than the law makes of it
    assert largest > 1e-3 * BOUND * np.abs(r).max()


# ---- feedforward alone ----


def test_tracking_is_the_papers_three_taps():
    """Eq. 19 with k - 1 in its last term and unrounded coefficients; zero-phase, so symmetric."""
    r = lathe.polygon_section(lathe.spindle_angle(16, 64, np.pi / 4), 4, 10.0)
    found = learning.track(Scheme(SERVO.plant, learning.zero_phase_law(SERVO.plant), 16), r)
    three = 2.43 * np.roll(r, -1) + (1 + 2.43**2) * r + 2.43 * np.roll(r, 1)
    np.testing.assert_allclose(found.output, [three / 3.43**2], rtol=1e-13)  # rounding
    np.testing.assert_array_equal(found.error, [r - found.output[0]])


@each_plant
@each_seed
def test_learning_from_the_tracking_command_begins_with_its_error(plant, seed):
    """And then falls by 1 - G H in every pass: e_L = (1 - G H)^(L + 1) r."""
    plant, law = make(plant=plant)
    r = np.random.default_rng(seed).standard_normal(12)
    zero_phase = learning.track(Scheme(plant, law, 12), r)
    found = run(plant, law, r, 3, first=zero_phase.command[0])
    z = np.exp(2j * np.pi * np.arange(12) / 12)
    factor = learning.factor(Scheme(plant, law, 12), z)
    for i in range(4):  # rounding of some transforms
        expected = np.fft.ifft(factor ** (i + 1) * np.fft.fft(r)).real
        np.testing.assert_allclose(found.error[i], expected, atol=1e-12 * np.abs(r).max())
    np.testing.assert_allclose(zero_phase.error[0], found.error[0], atol=1e-13)


@each_plant
def test_a_disturbance_passes_open_loop(plant):
    plant, law = make(plant=plant)
    r, w = np.random.default_rng(3).standard_normal((2, 12))
    scheme = Scheme(plant, law, 12)
    passed = learning.track(scheme, r, disturbance=w).output - learning.track(scheme, r).output
    np.testing.assert_allclose(passed[0], circulant(plant, 12) @ w, atol=1e-12)  # rounding


# ---- one continuous run is the plug-in repetitive loop ----


def check_plug_in(simulate, plant, period, gain, normalisation, seed, rest):
    rng = np.random.default_rng(seed)
    law = learning.zero_phase_law(plant, gain, normalisation)
    r, noise = rng.standard_normal(period), 0.2 * rng.standard_normal((9, period))
    free = free_response(plant, rest, noise.size)
    loop = Loop(plant, RepetitiveController(law.filter, period, 1.0), "plug-in")
    twin = repetitive.simulate(loop, np.tile(r, 9), noise=noise.ravel() + free)
    # the loop corrects the end of its first period already; learning is told of it
    first = twin.command[:period]
    untouched = period - law.look_ahead
    np.testing.assert_allclose(first[:untouched], r[:untouched], atol=1e-13)
    scheme = Scheme(plant, law, period, CONTINUOUS)
    found = simulate(scheme, r, passes=8, rest=rest, noise=noise, first=first)
    size = max(1.0, np.abs(twin.command).max())  # rounding of 9 periods, relative to the largest
    np.testing.assert_allclose(found.command.ravel(), twin.command, atol=1e-10 * size)
    np.testing.assert_allclose(found.output.ravel(), twin.output + free, atol=1e-10 * size)


@each_plant
@pytest.mark.parametrize("period", [6, 7, 16])
@pytest.mark.parametrize("gain, normalisation", [(1.0, "dc"), (0.5, "peak"), (1.3, "l1")])
@pytest.mark.parametrize("rest", [0.0, -1.7])
def test_continuous_learning_is_the_plug_in_repetitive_loop(
    plant, period, gain, normalisation, rest
):
    for seed in SEEDS:
        check_plug_in(learning.simulate, plant, period, gain, normalisation, seed, rest)


# ---- passes that repeat for ever ----


def check_periodic(simulate, plant, law, seed, n):
    r = np.random.default_rng(seed).standard_normal(n)
    found = simulate(Scheme(plant, law, n), r, passes=5)
    for i in range(6):  # rounding of six transforms
        np.testing.assert_allclose(found.error[i], spectral_error(plant, law, r, i), atol=1e-11)


@each_plant
@each_seed
@pytest.mark.parametrize("n", [11, 16])
def test_periodic_error_is_a_power_of_one_minus_gh(plant, seed, n):
    check_periodic(learning.simulate, *make(plant=plant), seed, n)


def test_periodic_passes_are_the_papers_recursions_repeated_until_settled():
    """Eqs 16 and 17 with unrounded coefficients, eq. 5, and every pass repeated 60 times."""
    n = 16
    r = lathe.polygon_section(lathe.spindle_angle(n, 4.0 * n), 4, 10.0)
    command = r
    # (1 - 0.16/z + 0.003/z^2 + 0.0063/z^3)(1 + 2.43 z), by hand
    taps = [2.43, 0.6112, -0.15271, 0.018309, 0.0063]
    found = run(SERVO.plant, learning.zero_phase_law(SERVO.plant), r, 5)
    for i in range(6):
        y, step = [0.0] * 3, [0.0]  # before k = 0: three outputs, one correction
        for k in range(60 * n):
            u1, u2, u3 = (command[(k - i) % n] for i in (1, 2, 3))
            driven = 0.14 * (u1 + 3.2 * u2 + 1.8711 * u3)
            y.append(driven + 0.16 * y[-1] - 0.003 * y[-2] - 0.0063 * y[-3])
        y = np.array(y[-n:])
        e = r - y
        for k in range(60 * n):
            now = sum(t * e[(k + 2 - i) % n] for i, t in enumerate(taps))
            step.append(now / (0.14 * 3.43**2) - 0.77 * step[-1])
        # 0.77^960 is nothing; rounding of sums of size 14
        np.testing.assert_allclose(found.output[i], y, atol=1e-11)
        np.testing.assert_allclose(found.command[i], command, atol=1e-11)
        command = command + step[-n:]


@each_seed
@pytest.mark.parametrize("period", [7, 8])
def test_every_harmonic_converges_at_its_own_rate(seed, period):
    plant, law = make(gain=0.4)
    rates = learning.harmonic_contraction(Scheme(plant, law, period))
    assert rates.size == period // 2 + 1
    r = np.random.default_rng(seed).standard_normal(period)
    error = np.abs(np.fft.rfft(run(plant, law, r, 4).error, axis=1))
    ratios = error[1:] / error[:-1]
    assert error.min() > 1e-6 * error.max()  # rounding over this is 1e-10
    np.testing.assert_allclose(ratios, np.tile(rates, (4, 1)), rtol=1e-9)
    again = learning.harmonic_contraction(Scheme(plant, law, float(period)))
    np.testing.assert_array_equal(again, rates)


# ---- passes from rest, as matrices over one pass ----


@pytest.mark.parametrize("start", RESTS, ids=str)
@each_plant
@each_seed
def test_passes_from_rest_are_powers_of_the_lifted_matrix(start, plant, seed):
    plant, law = make(plant=plant)
    r = np.random.default_rng(seed).standard_normal(15)
    found = run(plant, law, r, 6, start, rest=1.2)
    m, v, toeplitz, free = lifted_pass(plant, law, r, start.after, 1.2)
    affine = np.block([[m, v[:, None]], [np.zeros((1, 15)), np.ones((1, 1))]])
    for i in range(7):
        u = (np.linalg.matrix_power(affine, i) @ np.append(r, 1.0))[:15]
        size = max(1.0, np.abs(u).max())  # rounding of six matrix products
        np.testing.assert_allclose(found.command[i], u, atol=1e-11 * size)
        np.testing.assert_allclose(found.output[i], toeplitz @ u + free, atol=1e-11 * size)


@each_seed
def test_the_starts_differ(seed):
    """Or the tests above could not tell them apart."""
    plant, law = make(Q1)
    r = np.random.default_rng(seed).standard_normal(12)
    last = [run(plant, law, r, 3, start, rest=0.5).error[-1] for start in STARTS]
    for i, one in enumerate(last):
        for other in last[:i]:
            assert np.abs(one - other).max() > 1e-3


# ---- laws ----


def check_gain(zero_phase_law):
    z = np.exp(1j * np.linspace(0, np.pi, 9))
    scheme = Scheme(SERVO.plant, zero_phase_law(SERVO.plant, 0.4), 16)
    whole = (1 + 2.43**2 + 2 * 2.43 * z.real) / 3.43**2
    np.testing.assert_allclose(learning.factor(scheme, z), 1 - 0.4 * whole, atol=1e-14)


def test_the_gain_scales_the_law():
    check_gain(learning.zero_phase_law)


def test_p_type_law_is_a_gain_and_an_advance():
    z = np.exp(1j * np.linspace(0, np.pi, 9))
    law = learning.p_type_law(0.3, 2, Q1)
    smooth = (1 + z.real) / 2
    expected = smooth * (1 - 0.3 * z**2 * 0.5 / (z - 0.5))
    np.testing.assert_allclose(learning.factor(Scheme(LAG, law, 9), z), expected, atol=1e-14)
    assert law.look_ahead == 3
    assert law.poles.size == 0


def cost(g, error, change, weight):
    return np.sum((error - g @ change) ** 2) + weight * np.sum(change**2)


def check_norm_optimal(norm_optimal_law, plant, weight, period, seed):
    rng = np.random.default_rng(seed)
    g = circulant(plant, period)
    r = rng.standard_normal(period)
    found = run(plant, norm_optimal_law(plant, weight, period), r, 1)
    error, change = found.error[0], found.command[1] - found.command[0]
    best = np.linalg.solve(g.T @ g + weight * np.eye(period), g.T @ error)
    # rounding of the solution times the condition, below 1e3 for these weights
    np.testing.assert_allclose(change, best, atol=1e-11 * np.abs(best).max())
    least = cost(g, error, change, weight)
    for size in (1e-3, 1e-2, 1.0):
        for _ in range(10):
            other = change + size * rng.standard_normal(period)
            assert cost(g, error, other, weight) > least
    assert cost(g, found.error[1], np.zeros(period), 0) == pytest.approx(
        cost(g, error, change, 0), rel=1e-9, abs=1e-15
    )


@each_plant
@each_seed
@pytest.mark.parametrize("period", [1, 2, 9, 10])
@pytest.mark.parametrize("weight", [0.03, 1.0])
def test_norm_optimal_law_minimises_its_cost(plant, seed, period, weight):
    check_norm_optimal(learning.norm_optimal_law, plant, weight, period, seed)
    law = learning.norm_optimal_law(plant, weight, period)
    z = np.exp(2j * np.pi * np.arange(period // 2 + 1) / period)
    g = np.polyval(plant.numerator[::-1], 1 / z) / np.polyval(plant.a[::-1], 1 / z)
    np.testing.assert_allclose(  # 1 - |G|^2/(|G|^2 + w); rounding
        learning.harmonic_contraction(Scheme(plant, law, period)),
        weight / (np.abs(g) ** 2 + weight),
        atol=1e-12,
    )


@pytest.mark.parametrize("period", [9, 10])
def test_norm_optimal_law_goes_from_the_inverse_to_nothing(period):
    plant = SERVO.plant
    r = np.random.default_rng(3).standard_normal(period)
    inverse = np.linalg.solve(circulant(plant, period), r)
    for weight, atol in ((0.0, 1e-12), (1e-8, 1e-5)):  # the rest is weight/|G|^2, |G| > 0.03
        found = run(plant, learning.norm_optimal_law(plant, weight, period), r, 1)
        np.testing.assert_allclose(found.command[1], inverse, atol=100 * atol)
        np.testing.assert_allclose(found.error[1], 0, atol=atol * 10)
    large = 1e8
    law = learning.norm_optimal_law(plant, large, period)
    h, _ = circulant_law(law, period)
    # H = G^T/weight (1 - |G|^2/weight ..): the second term is 1e-8 of the first
    np.testing.assert_allclose(large * h, circulant(plant, period).T, atol=1e-7)
    np.testing.assert_allclose(
        learning.harmonic_contraction(Scheme(plant, law, period)), 1, atol=1e-7
    )


@pytest.mark.parametrize("period, ahead", [(9, 4), (10, 4), (1, 0), (2, 0)])
def test_norm_optimal_taps_span_one_period_about_now(period, ahead):
    law = learning.norm_optimal_law(LAG, 0.1, period)
    assert (law.look_ahead, law.filter.b.size, law.poles.size) == (ahead, period, 0)


# ---- mismatch ----


@pytest.mark.parametrize("factor", [0.75, 1.25])
@each_seed
def test_mismatch_enters_through_the_plant_alone(factor, seed):
    """1 - G H^ from the factors of eqs 13 and 20, true plant and estimated law written out."""
    law = learning.zero_phase_law(SERVO.misjudged(factor, factor).plant)
    z = np.exp(1j * np.random.default_rng(seed).uniform(-np.pi, np.pi, 20))
    f = factor

    def poles(f):
        pair = (1 + f * (-0.15 + 0.15j) / z) * (1 + f * (-0.15 - 0.15j) / z)
        return (1 + f * 0.14 / z) * pair

    g = 0.14 / z * (1 + 0.77 / z) * (1 + 2.43 / z) / poles(1)
    h = poles(f) * (1 + f * 2.43 * z) * z / (0.14 * (1 + f * 0.77 / z) * (1 + f * 2.43) ** 2)
    found = learning.factor(Scheme(SERVO.plant, law, 16), z)
    np.testing.assert_allclose(found, 1 - g * h, atol=1e-13)
    other = Scheme(SERVO.misjudged(f, f).plant, learning.zero_phase_law(SERVO.plant), 16)
    swapped = learning.factor(other, z)
    assert np.abs(swapped - (1 - g * h)).max() > 0.05


@each_seed
def test_two_plants_with_one_law_differ_only_by_their_own_outputs(seed):
    r = np.random.default_rng(seed).standard_normal(12)
    law = learning.zero_phase_law(SERVO.plant)
    for plant in (SERVO.plant, SERVO.misjudged(1.2, 0.9).plant):
        found = run(plant, law, r, 2)
        h, _ = circulant_law(law, 12)
        np.testing.assert_allclose(found.output, found.command @ circulant(plant, 12).T, atol=1e-12)
        step = found.error[:-1] @ h.T
        np.testing.assert_allclose(np.diff(found.command, axis=0), step, atol=1e-12)


@each_seed
def test_mismatch_is_the_ratio_of_the_plants(seed):
    """One factor of the servo misjudged: (1 + 0.77/z)/(1 + 0.7/z) - 1 is left."""
    z = np.exp(1j * np.random.default_rng(seed).uniform(-np.pi, np.pi, 20))
    believed = SERVO.misjudged(zeros=(0.7 / 0.77, 1)).plant
    scheme = Scheme(SERVO.plant, learning.zero_phase_law(believed), 16, model=believed)
    expected = 0.07 / z / (1 + 0.7 / z)
    np.testing.assert_allclose(learning.mismatch(scheme, z), expected, atol=1e-13)
    other = replace(scheme, plant=believed)
    assert other.law is scheme.law
    np.testing.assert_allclose(learning.mismatch(other, z), 0, atol=1e-15)
    np.testing.assert_array_equal(learning.mismatch(replace(scheme, model=None), z), 0)


# ---- mutants: each key check can fail ----


def wrongly(scheme_of=lambda s: s, **changed):
    """`simulate` on another scheme, or with other options than are asked for."""

    def simulate(scheme, reference, **options):
        options |= {name: change(options.get(name)) for name, change in changed.items()}
        return learning.simulate(scheme_of(scheme), reference, **options)

    return simulate


def with_law(change):
    return lambda s: replace(s, law=change(s.law))


def with_start(*start):
    return lambda s: replace(s, start=Start(*start))


def late(law):
    f = law.filter
    return LearningLaw(NoncausalFilter(f.b, f.a, f.advance - 1), law.q)


def turned(law):
    f = law.filter
    return LearningLaw(NoncausalFilter(f.b[::-1], f.a, f.advance), law.q)


def wide(law):
    return LearningLaw(law.filter, Q2)


def unfiltered(law):
    return LearningLaw(law.filter)


NEGATED = wrongly(noise=lambda n: -n)
NO_REST = wrongly(rest=lambda rest: 0.0)
MUTANTS = {
    "noise of the other sign": [(NEGATED, start) for start in STARTS],
    "noise of the pass before": [(wrongly(noise=lambda n: np.roll(n, 1, 0)), s) for s in STARTS],
    "first command ignored": [(wrongly(first=lambda first: None), s) for s in STARTS],
    "rest ignored": [(NO_REST, start) for start in STARTS if start.before != "itself"],
    "law a sample late": [(wrongly(with_law(late)), start) for start in STARTS],
    "law turned": [(wrongly(with_law(turned)), start) for start in STARTS],
    "another q": [(wrongly(with_law(wide)), start) for start in STARTS],
    "no q": [(wrongly(with_law(unfiltered)), start) for start in STARTS],
    "recursion that does not forget": [
        (wrongly(with_start(s.before, s.after)), s) for s in FORGETFUL],
    "something else behind the pass": [
        (wrongly(with_start("rest", other.after)), start)
        for start in RESTS for other in RESTS if other != start],
    "passes apart": [(wrongly(with_start("rest", "on")), CONTINUOUS)],
    "passes never begun": [(wrongly(with_start("itself", "itself")), start)
                           for start in STARTS[1:]],
    "a plant too strong": [
        (wrongly(lambda s: replace(s, plant=Plant(1.001 * s.plant.b, s.plant.a, s.plant.delay,
                                                  s.plant.dt))), start) for start in STARTS],
}  # fmt: skip


@pytest.mark.parametrize("mutant", MUTANTS)
def test_the_definition_catches_a_mutant(mutant):
    for simulate, start in MUTANTS[mutant]:
        with pytest.raises(AssertionError):
            check_definition(simulate, start, Q1, 1, own=True)


@pytest.mark.parametrize("start", STARTS, ids=str)
def test_the_definition_catches_wrong_limits_and_disturbances(start):
    others = {
        "limits": lambda limits: Limits(Limit(1.1, not limits.command.remember_clipped)),
        "disturbance": lambda w: -w,
    }
    for name, change in others.items():
        with pytest.raises(AssertionError):
            check_limits(wrongly(**{name: change}), start, Q1, True, True)
    with pytest.raises(AssertionError):
        check_limits(wrongly(disturbance=lambda w: w[:1].repeat(4, 0)), start, Q1, True, True)


@pytest.mark.parametrize("simulate", [
    wrongly(with_law(late)), wrongly(rest=lambda rest: rest + 0.1), NEGATED,
    wrongly(with_start("rest", "on")), wrongly(with_start("itself", "itself")),
], ids=["late", "rest", "noise", "apart", "repeated"])  # fmt: skip
def test_the_plug_in_loop_catches_a_mutant(simulate):
    with pytest.raises(AssertionError):
        check_plug_in(simulate, SERVO.plant, 7, 0.8, "peak", 1, -1.7)


@pytest.mark.parametrize("simulate", [
    wrongly(with_law(late)), wrongly(with_start("rest", "on")),
    wrongly(first=lambda first: np.zeros(16)),
], ids=["late", "from rest", "first"])  # fmt: skip
def test_the_power_of_one_minus_gh_catches_a_mutant(simulate):
    with pytest.raises(AssertionError):
        check_periodic(simulate, *make(), 1, 16)


def test_slips_of_the_laws_are_caught():
    with pytest.raises(AssertionError):
        check_gain(lambda plant, gain: learning.zero_phase_law(plant))
    optimal = learning.norm_optimal_law
    for wrong in (
        lambda plant, weight, period: optimal(plant, 2 * weight, period),
        lambda plant, weight, period: turned(optimal(plant, weight, period)),
        lambda plant, weight, period: late(optimal(plant, weight, period)),
    ):
        with pytest.raises(AssertionError):
            check_norm_optimal(wrong, SERVO.plant, 0.03, 10, 1)


# ---- bad input ----

NAN = np.nan
P, H = make()
TWELVE = np.ones(12)
FIVE = np.arange(5.0)
ONCE = learning.p_type_law(0.5, 1)
NEVER = LearningLaw(NoncausalFilter([1.0], [1.0, -1.0], 1))


def learn(r=TWELVE, passes=1, start=PERIODIC, **options):
    return learning.simulate(Scheme(P, H, 12, start), r, passes=passes, **options)


def scheme(plant=P, law=H, period=12, start=PERIODIC):
    return Scheme(plant, law, period, start)


BAD = {
    "look-ahead of the whole pass": (lambda: scheme(law=learning.p_type_law(1.0, 12)),
        r"looks 12 samples ahead.* has 12; sample faster"),
    "look-ahead beyond the pass": (lambda: scheme(law=learning.p_type_law(1.0, 40), start=RESET),
        r"looks 40 samples ahead.* has 12; sample faster"),
    "look-ahead by q": (lambda: scheme(period=5, law=learning.p_type_law(1.0, 4, Q1)),
        r"looks 5 samples ahead.* has 5; "),
    "memory of no delay": (lambda: scheme(law=learning.p_type_law(1, 0, Q2), period=2),
        r"looks 2 samples ahead.* 2; sample faster"),
    "zero on the circle under dc": (
        lambda: learning.zero_phase_law(Plant([1.0, -1.0], [1.0], 1, 1.0)), r"vanishes at z = 1"),
    "reference of another length": (lambda: learn(FIVE), r"reference has 5 samples, 12 are needed"),
    "NaN in the reference": (lambda: learn([*TWELVE[:5], NAN, *TWELVE[:6]]),
        r"nan at sample 5; give finite"),
    "2-D reference": (lambda: learn(np.ones((2, 6))), r"shape \(2, 6\); give one"),
    "empty reference": (lambda: learn([]), r"shape \(0,\); give one"),
    "noise of another shape": (lambda: learn(noise=np.zeros(24)),
        r"shape \(24,\); give one row per pass: \(2, 12\)"),
    "noise turned": (lambda: learn(noise=np.zeros((12, 2))), r"shape \(12, 2\); .*\(2, 12\)"),
    "NaN in the noise": (lambda: learn(noise=[[0.0] * 12, [NAN] * 12]), r"noise.* nan .*finite"),
    "complex noise": (lambda: learn(noise=1j * np.zeros((2, 12))), r"noise is complex; give real"),
    "short disturbance": (lambda: learn(disturbance=FIVE), r"disturbance has 5 samples, 12 are"),
    "disturbance turned": (lambda: learn(disturbance=np.zeros((12, 2))),
        r"disturbance has shape \(12, 2\); .*\(2, 12\)"),
    "limit on what is not sent": (lambda: learn(limits=Limits(repetitive=Limit(1.0))),
        r"set limits\.command"),
    "first command of another length": (lambda: learn(first=np.ones(11)),
        r"first has 11 samples, 12 are needed"),
    "NaN in the first command": (lambda: learn(first=[NAN] * 12), r"first holds nan at sample 0"),
    "NaN to track": (lambda: learning.track(scheme(), [*TWELVE[:11], NAN]), r"nan at sample 11"),
    "track another shape": (lambda: learning.track(scheme(), [1.0, 2.0]), r"reference has 2 sampl"),
    "track by an unstable law": (
        lambda: learning.track(scheme(law=NEVER, start=CONTINUOUS), TWELVE),
        r"poles \[1\.\].* start otherwise"),
    "forgetful for ever": (lambda: Start("itself", "itself", True), r"forgets nothing; start"),
    "NaN at rest": (lambda: learn(start=RESET, rest=NAN), r"rest = nan must be"),
    "unstable plant": (lambda: scheme(Plant([1.0], [1, -1.2], 1, 1.0), ONCE),
        r"poles \[1\.2\]; close a loop"),
    "integrator": (lambda: scheme(Plant([1.0], [1, -1.0], 1, 1.0), ONCE), r"poles \[1\.\]; close"),
    "unknown start": (lambda: Start("moon", "next"), r"'moon'.*choose itself with itself"),
    "start in a word": (lambda: scheme(start="periodic"), r"start = 'periodic': give PERIODIC"),
    "pair that does not go": (lambda: Start("previous", "itself"), r"'previous', .*previous with"),
    "half a pass": (lambda: learn(passes=2.5), r"passes = 2\.5 .*round"),
    "fewer than no passes": (lambda: learn(passes=-1), r"passes = -1 .*round"),
    "half a period": (lambda: scheme(period=8.5), r"period = 8\.5 .*round"),
    "no period": (lambda: learning.norm_optimal_law(P, 1.0, 0), r"period = 0 .*round"),
    "noise of half a pass": (lambda: learning.noise_gain(scheme(), passes=1.5),
        r"passes = 1\.5 .*round"),
    "noise of another source": (lambda: learning.noise_gain(scheme(), "output", "moon"),
        r"'moon' to 'output': sources"),
    "no points": (lambda: learning.contraction(scheme(), 0), r"points = 0 .*round"),
    "roots of passes": (lambda: learning.roots(scheme()), r"itself.* ask for multipliers"),
    "lopsided q": (lambda: LearningLaw(H.filter, [0.2, 0.5, 0.3]), r"0\.3.* symmetric"),
    "even q": (lambda: learning.p_type_law(1.0, 1, [0.5, 0.5]), r"0\.5.* symmetric"),
    "NaN gain": (lambda: learning.zero_phase_law(P, NAN), r"gain = nan must be"),
    "NaN P gain": (lambda: learning.p_type_law(NAN, 1), r"gain = nan must be"),
    "law that looks back": (lambda: learning.p_type_law(1.0, -1), r"advance = -1 must"),
    "half an advance": (lambda: learning.p_type_law(1.0, 0.5), r"advance = 0\.5 must"),
    "negative weight": (lambda: learning.norm_optimal_law(P, -1.0, 8), r"-1\.0 must not be neg"),
    "NaN weight": (lambda: learning.norm_optimal_law(P, NAN, 8), r"weight = nan must be"),
    "inverse of a stopped harmonic": (
        lambda: learning.norm_optimal_law(Plant([1.0, 1.0], [1.0], 1, 1.0), 0.0, 8),
        r"weight = 0\.0.* larger"),
    "inverse of an unstable plant": (
        lambda: learning.zero_phase_law(Plant([1.0], [1, -1.2], 1, 1.0)), r"1\.2, .*stabilise"),
    "unknown normalisation": (lambda: learning.zero_phase_law(P, 1.0, "l2"), r"'l2' is none of"),
    "law that never repeats": (lambda: scheme(law=NEVER), r"poles \[1\.\].* start otherwise"),
}  # fmt: skip


@pytest.mark.parametrize("call, message", BAD.values(), ids=BAD)
def test_bad_input_names_value_and_mend(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("plant, law, model", [
    ("P", H, None), (P, H.filter, None), (P, H, SERVO),
], ids=["plant", "law", "model"])  # fmt: skip
def test_a_scheme_of_something_else_is_a_type_error(plant, law, model):
    with pytest.raises(TypeError, match=r"is no Plant|make one with"):
        Scheme(plant, law, 12, model=model)
