"""What is said of a learning scheme: factor, stability, limit and noise, each by another route."""

import numpy as np
import pytest
from learning_cases import LAG, LATE, Q1, Q2, RESTS, SERVO, each_plant, each_seed
from oracles.learning import (
    circulant_sources,
    companion_radius,
    deviation,
    lifted_pass,
    lifted_sources,
    probed,
    spread_of,
)

from rcbook import zdomain
from rcbook.loops import learning, repetitive
from rcbook.loops.learning import CONTINUOUS, PERIODIC, RESET, LearningLaw, Scheme, Start
from rcbook.loops.repetitive import Loop, Process, RepetitiveController
from rcbook.loops.verdict import OUTPUTS, SOURCES
from rcbook.zdomain import NoncausalFilter, Plant

FORGETFUL = Start("previous", "next", True)
each_source = pytest.mark.parametrize("source", SOURCES)
each_output = pytest.mark.parametrize("output", OUTPUTS)


def make(q=(1.0,), gain=0.7, plant=None):
    """A plant, and a law designed on a slightly wrong idea of it."""
    plant = SERVO.plant if plant is None else plant
    believed = Plant(1.1 * plant.b, [1.0, plant.a[1] - 0.03, *plant.a[2:]], plant.delay, plant.dt)
    return plant, learning.zero_phase_law(believed, gain, "peak", q)


# ---- stability of the running scheme ----


def per_sample(plant, law, period):
    """Largest root of the scheme run on, a step of it a sample."""
    return np.abs(learning.roots(Scheme(plant, law, period, CONTINUOUS))[0])


def growth(plant, law, period, periods=400):
    """Growth of the error per sample, seen in a long run: least squares over its last half."""
    once = np.zeros((periods + 1, period))
    once[0, -1] = 1.0  # one bad measurement, late enough to be looked ahead to
    scheme = Scheme(plant, law, period, CONTINUOUS)
    error = learning.simulate(scheme, np.zeros(period), passes=periods, noise=once).error
    # up to where the record is cut, when it grows
    size = np.log(np.linalg.norm(error, axis=1)[error.shape[0] // 2 :])
    return np.exp(np.polyfit(np.arange(size.size), size, 1)[0] / period)


@each_plant
@pytest.mark.parametrize("q", [[1.0], Q1], ids=["q = 1", "short q"])
def test_spectral_radius_is_that_of_the_sample_by_sample_map(plant, q):
    plant, law = make(q, gain=1.2, plant=plant)
    # a root of multiplicity two among those of size one moves by 1e-8
    scheme = Scheme(plant, law, 8, CONTINUOUS)
    radius = companion_radius(plant, law, 8)
    assert np.abs(learning.roots(scheme)[0]) == pytest.approx(radius, abs=1e-6)
    assert learning.spectral_radius(scheme) == pytest.approx(radius**8, abs=1e-5)


@each_plant
@pytest.mark.parametrize("q", [[1.0], Q1, Q2], ids=["q = 1", "short q", "long q"])
@pytest.mark.parametrize("period", [8, 9, 40])
def test_the_running_scheme_has_the_roots_of_the_repetitive_loop(plant, q, period):
    plant, law = make(q, plant=plant)
    controller = RepetitiveController(law.filter, repetitive.plain(period, law.q), 1.0)
    loop = Loop(Process(plant), controller, "plug-in")
    scheme = Scheme(plant, law, period, CONTINUOUS)
    ours = scheme.polynomial
    theirs = repetitive.characteristic_polynomial(loop)
    difference = zdomain.add(ours, -theirs)
    np.testing.assert_allclose(difference, 0, atol=1e-13)  # the same products in another order
    # a double root moves by the root of 1e-16
    largest = np.abs(repetitive.roots(loop)[0])
    assert np.abs(learning.roots(scheme)[0]) == pytest.approx(largest, abs=1e-7)


@pytest.mark.parametrize("period", [2, 4, 5, 9])
@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_long_runs_decay_below_the_limit_and_grow_above_it(period, factor):
    law = lambda gain: learning.p_type_law(gain, 1)  # noqa: E731
    low, high = 1e-3, 20.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if per_sample(LAG, law(middle), period) < 1 else (low, middle)
    radius = per_sample(LAG, law(factor * low), period)
    found = learning.verdict(Scheme(LAG, law(factor * low), period, CONTINUOUS))
    assert found.verdict == ("stable" if factor < 1 else "unstable")
    assert (radius < 1) == (factor < 1)
    # beats of a complex pair leave some 1e-4 in the fit; the radius is off one by far more
    assert abs(radius - 1) > 4e-4
    assert growth(LAG, law(factor * low), period) == pytest.approx(radius, abs=2e-4)


@pytest.mark.parametrize("period", [2, 3, 4, 5])
def test_eq_8_is_not_necessary_for_a_running_scheme_of_a_finite_period(period):
    """G = 0.5/(z - 0.5) and H = 2.2 z: 1 - G H = -1.2 at z = 1, and yet short periods run stably;
    passes that repeat for ever diverge at that harmonic."""
    law = learning.p_type_law(2.2, 1)
    scheme = Scheme(LAG, law, period)
    assert learning.contraction(scheme) == pytest.approx(1.2, rel=1e-14)
    assert learning.spectral_radius(scheme) == pytest.approx(1.2, rel=1e-14)
    # z^N (z - 0.5) = z - 0.5 - 1.1 z, that is z^(N+1) - 0.5 z^N + 0.1 z + 0.5 = 0
    radius = np.abs(np.roots([1, -0.5, *np.zeros(period - 2), 0.1, 0.5])).max()
    assert per_sample(LAG, law, period) == pytest.approx(radius, rel=1e-9)
    assert radius < 1
    assert growth(LAG, law, period) == pytest.approx(radius, abs=2e-4)  # beats, as above
    assert per_sample(LAG, law, 6) > 1
    noise = np.zeros((21, period))
    noise[0] = 1e-3  # one offset measurement, all of it harmonic 0
    zero = np.zeros(period)
    error = learning.simulate(scheme, zero, passes=20, noise=noise).largest_error
    np.testing.assert_allclose(error[2:] / error[1:-1], 1.2, rtol=1e-9)  # rounding


@pytest.mark.parametrize("period", [2, 3, 5, 12])
def test_eq_8_is_not_sufficient_when_the_law_is_unstable(period):
    """G H = (1/3)/(1 - z/1.5) stays in the unit disc about 1, with a pole of the law at 1.5."""
    law = LearningLaw(NoncausalFilter([-1.0, 0.5], [1.0, -1.5], 0))
    np.testing.assert_allclose(law.poles, [1.5])
    # farthest from 1 at z = -1: 1 - (1/3)/(5/3) = 4/5
    scheme = Scheme(LAG, law, period, CONTINUOUS)
    assert learning.contraction(scheme) == pytest.approx(0.8, rel=1e-14)
    radius = per_sample(LAG, law, period)
    assert radius > 1.2
    assert growth(LAG, law, period, 60) == pytest.approx(radius, abs=1e-3)


@pytest.mark.parametrize("period", [2, 4, 7])
def test_a_running_scheme_can_be_stable_with_a_pole_of_the_law_outside(period):
    law = LearningLaw(NoncausalFilter([0.5, -0.45], [1.0, -1.02], 1))
    assert abs(law.poles[0]) > 1
    radius = per_sample(LAG, law, period)
    assert radius < 1
    assert growth(LAG, law, period) == pytest.approx(radius, abs=5e-4)  # beats
    with pytest.raises(ValueError, match=r"poles \[1\.02\].* start otherwise"):
        Scheme(LAG, law, period)


@each_plant
@pytest.mark.parametrize("gain", [0.1, 0.7, 1.2])
@pytest.mark.parametrize("q", [[1.0], Q1, Q2], ids=["q = 1", "short q", "long q"])
def test_eq_8_with_a_stable_law_is_sufficient_for_every_period(plant, gain, q):
    plant, law = make(q, gain, plant)
    for period in (7, 8, 20):
        if learning.contraction(Scheme(plant, law, period)) < 1:
            for start in (PERIODIC, CONTINUOUS):
                scheme = Scheme(plant, law, period, start)
                assert learning.spectral_radius(scheme) < 1
                assert learning.verdict(scheme).verdict == "stable"


# ---- contraction ----


def test_contraction_of_the_papers_law_is_the_closed_form():
    """G H = (1 + 2.43/z)(1 + 2.43 z)/3.43^2 is least at z = -1: (1.43/3.43)^2."""
    law = learning.zero_phase_law(SERVO.plant)
    closed = 1 - (1.43 / 3.43) ** 2
    # 4097 points hold z = -1 itself: rounding only
    scheme = Scheme(SERVO.plant, law, 16)
    assert learning.contraction(scheme) == pytest.approx(closed, rel=1e-12)
    w = np.linspace(0, np.pi, 9)
    factor = 1 - (1 + 2.43**2 + 2 * 2.43 * np.cos(w)) / 3.43**2
    np.testing.assert_allclose(learning.factor(scheme, np.exp(1j * w)), factor, atol=1e-14)
    period = 16
    w = 2 * np.pi * np.arange(period // 2 + 1) / period
    factor = 1 - (1 + 2.43**2 + 2 * 2.43 * np.cos(w)) / 3.43**2
    np.testing.assert_allclose(learning.harmonic_contraction(scheme), factor, atol=1e-14)


@pytest.mark.parametrize("zero", [-1.5, -0.9, 1.2, 2.0])
@pytest.mark.parametrize("normalisation", ["dc", "peak", "l1"])
def test_only_some_unstable_zeros_contract_under_the_papers_normalisation(zero, normalisation):
    """With dc, G H = |1 - zero/z|^2/(1 - zero)^2 exceeds 2 near a positive zero; with the peak or
    l1 it stays between 0 and 1."""
    plant = Plant([1.0, -zero], [1, -0.3], 1, 1.0)
    law = learning.zero_phase_law(plant, 1.0, normalisation)
    found = learning.contraction(Scheme(plant, law, 8))
    if abs(zero) < 1:
        assert found < 1e-14
        return
    w = np.linspace(0, np.pi, 100_001)
    square = np.abs(1 - zero * np.exp(-1j * w)) ** 2
    b = {"dc": (1 - zero) ** 2, "peak": square.max(), "l1": (1 + abs(zero)) ** 2}[normalisation]
    # both grids hold the extremes at 0 and pi: rounding
    assert found == pytest.approx(np.abs(1 - square / b).max(), rel=1e-12)
    assert (found < 1) == (normalisation != "dc" or zero < 0)


@each_plant
@pytest.mark.parametrize("q", [[1.0], Q1, Q2], ids=["q = 1", "short q", "long q"])
def test_contraction_is_the_peak_on_a_dense_grid_of_the_whole_circle(plant, q):
    plant, law = make(q, plant=plant)
    z = np.exp(1j * np.linspace(-np.pi, np.pi, 100_003))
    g = np.polyval(plant.numerator[::-1], 1 / z) / np.polyval(plant.a[::-1], 1 / z)
    h = z**law.filter.advance * np.polyval(law.filter.b[::-1], 1 / z)
    h /= np.polyval(law.filter.a[::-1], 1 / z)
    gain = np.polyval(law.q, z) * z ** (-(law.q.size // 2))
    dense = np.abs(gain * (1 - g * h)).max()
    # a peak lies within half a grid step, pi/8192, of a point: (4e-4)^2 times the curvature
    assert learning.contraction(Scheme(plant, law, 20)) == pytest.approx(dense, abs=2e-6)


# ---- the other starts ----


@each_plant
@pytest.mark.parametrize("q", [[1.0], Q1], ids=["q = 1", "short q"])
@pytest.mark.parametrize("period", [7, 8])
def test_multipliers_of_repeated_passes_are_eigenvalues_of_a_circulant(plant, q, period):
    plant, law = make(q, plant=plant)
    scheme = Scheme(plant, law, period)
    m, _, _ = circulant_sources(plant, law, period)
    found, expected = learning.multipliers(scheme), np.linalg.eigvals(m)
    # a circulant is normal: its eigenvalues are known to rounding
    for one in expected:
        assert np.abs(found - one).min() < 1e-11
    assert found.size == period
    assert learning.spectral_radius(scheme) == pytest.approx(np.abs(expected).max(), abs=1e-11)
    rates = learning.harmonic_contraction(scheme)
    assert learning.spectral_radius(scheme) == pytest.approx(rates.max(), rel=1e-12)
    assert learning.verdict(scheme).verdict == "stable"


@each_plant
@pytest.mark.parametrize("start", RESTS, ids=str)
def test_the_one_pass_matrix_is_the_lifted_one(plant, start):
    plant, law = make(plant=plant)
    m, _, _, _ = lifted_pass(plant, law, np.zeros(11), start.after, 0.0)
    scheme = Scheme(plant, law, 11, start)
    size = np.abs(m).max()
    np.testing.assert_allclose(scheme.one_pass, m, atol=1e-12 * size)  # rounding
    assert scheme.one_pass is scheme.one_pass
    kept = 11 if start.after == "on" else 11 - plant.delay  # the others answer after the pass
    radius = np.abs(np.linalg.eigvals(m[:kept, :kept])).max()
    # far from normal: rounding times the condition of an eigenvalue
    assert learning.spectral_radius(scheme) == pytest.approx(radius, rel=1e-6)


def test_from_rest_a_law_as_far_ahead_as_the_plant_is_late_has_one_multiplier():
    """Triangular: every eigenvalue is 1 - gain b[0], at all but the samples it cannot reach."""
    for plant in (LAG, LATE):
        scheme = Scheme(plant, learning.p_type_law(0.6 / plant.b[0], plant.delay), 9, RESET)
        np.testing.assert_allclose(np.diag(scheme.one_pass)[: 9 - plant.delay], 0.4, atol=1e-15)
        np.testing.assert_allclose(np.triu(scheme.one_pass, 1), 0, atol=1e-15)
        # what the last commands do comes after the pass: they are never corrected
        np.testing.assert_array_equal(np.diag(scheme.one_pass)[9 - plant.delay :], 1)
        assert learning.multipliers(scheme).size == 9 - plant.delay
        # one eigenvalue of multiplicity 8: the root of that order of rounding at most
        assert learning.spectral_radius(scheme) == pytest.approx(0.4, abs=0.03)
        assert learning.verdict(scheme).verdict == "stable"


@pytest.mark.parametrize("start", [PERIODIC, CONTINUOUS, RESET, FORGETFUL], ids=str)
def test_a_law_that_learns_nothing_is_undecided_and_has_no_limit(start):
    scheme = Scheme(LAG, learning.p_type_law(0.0, 1), 6, start)
    found = learning.verdict(scheme)
    assert found.verdict == "undecided"
    for ask in (lambda: learning.steady_state(scheme, np.ones(6)),
                lambda: learning.noise_gain(scheme)):  # fmt: skip
        with pytest.raises(ValueError, match=r"undecided .*no steady state; lower the gain"):
            ask()
    assert learning.noise_gain(scheme, passes=3) == 0


@pytest.mark.parametrize("start", [PERIODIC, CONTINUOUS, RESTS[0], FORGETFUL], ids=str)
@pytest.mark.parametrize("gain, verdict", [(0.5, "stable"), (9.0, "unstable")])
def test_the_verdict_says_what_300_passes_do(start, gain, verdict):
    scheme = Scheme(LAG, learning.p_type_law(gain, 1, Q1), 6, start)
    assert learning.verdict(scheme).verdict == verdict
    assert (learning.spectral_radius(scheme) < 1) == (verdict == "stable")
    noise = np.zeros((301, 6))
    noise[0] = np.random.default_rng(1).standard_normal(6)
    run = learning.simulate(scheme, np.zeros(6), passes=300, noise=noise)
    assert run.unbounded == (verdict == "unstable")
    if verdict == "stable":
        assert run.largest_error[-1] < 1e-9
    else:
        with pytest.raises(ValueError, match=r"unstable .*no steady state"):
            learning.steady_state(scheme, np.ones(6))


# ---- searches ----


def test_the_largest_gain_that_eq_8_allows_is_the_closed_form():
    """G H = 0.5 k z/(z - 0.5) at gain k: farthest from one at z = 1, where it is k, or z = -1."""
    excess = lambda k: learning.contraction(Scheme(LAG, learning.p_type_law(k, 1), 8)) - 1  # noqa: E731
    assert zdomain.first_crossing(excess, [0.5, 5.0]) == pytest.approx(2, rel=1e-9)
    assert zdomain.first_crossing(excess, [0.5, 1.0, 1.9]) == np.inf


# ---- the learned limit ----


@each_plant
@pytest.mark.parametrize("q", [[1.0], Q1, Q2], ids=["q = 1", "short q", "long q"])
@pytest.mark.parametrize("start", [PERIODIC, CONTINUOUS, FORGETFUL], ids=str)
def test_the_limit_is_what_long_runs_come_to(plant, q, start):
    plant, law = make(q, gain=1.0, plant=plant)
    scheme = Scheme(plant, law, 9, start)
    r, w = np.random.default_rng(5).standard_normal((2, 9))
    limit = learning.steady_state(scheme, r, disturbance=w)
    assert limit.command.shape == (1, 9)
    radius = learning.spectral_radius(scheme)
    passes = int(np.log(1e-11) / np.log(radius)) + 20
    run = learning.simulate(scheme, r, passes=passes, disturbance=w)
    size = np.abs(run.command).max()
    np.testing.assert_allclose(run.command[-1], limit.command[0], atol=1e-7 * size)
    np.testing.assert_allclose(run.output[-1], limit.output[0], atol=1e-7 * size)
    np.testing.assert_array_equal(limit.error, r - limit.output)
    if len(q) == 1:  # all is learned
        np.testing.assert_allclose(limit.error, 0, atol=1e-11 * size)


@each_plant
@pytest.mark.parametrize("q", [[1.0], Q1, Q2], ids=["q = 1", "short q", "long q"])
def test_the_limit_of_repeated_passes_solves_the_circulant_equations(plant, q):
    plant, law = make(q, plant=plant)
    r, w = np.random.default_rng(6).standard_normal((2, 10))
    m, into, g = circulant_sources(plant, law, 10)
    u = np.linalg.solve(np.eye(10) - m, into["reference"] @ r + into["disturbance"] @ w)
    limit = learning.steady_state(Scheme(plant, law, 10), r, disturbance=w)
    # rounding times the condition of 1 - m, below 1e4
    np.testing.assert_allclose(limit.command[0], u, atol=1e-10 * np.abs(u).max())
    np.testing.assert_allclose(limit.output[0], g @ (u + w), atol=1e-10 * np.abs(u).max())


@each_seed
def test_the_limit_of_passes_from_rest_solves_the_lifted_equations(seed):
    r, w = np.random.default_rng(seed).standard_normal((2, 8))
    law, rest = learning.p_type_law(0.6, 1), 0.8
    m, v, toeplitz, free = lifted_pass(LAG, law, r, "itself", rest)
    _, into = lifted_sources(LAG, law, 8, "itself")
    driven = v + into["disturbance"] @ w
    u = np.append(np.linalg.solve(np.eye(7) - m[:7, :7], driven[:7]), r[7])
    limit = learning.steady_state(Scheme(LAG, law, 8, RESTS[0]), r, disturbance=w, rest=rest)
    size = np.abs(u).max()
    np.testing.assert_allclose(limit.command[0], u, atol=1e-11 * size)
    np.testing.assert_allclose(limit.output[0], toeplitz @ (u + w) + free, atol=1e-11 * size)
    run = learning.simulate(Scheme(LAG, law, 8, RESTS[0]), r, passes=3, rest=rest, disturbance=w,
                            first=limit.command[0])  # fmt: skip
    np.testing.assert_allclose(run.output, np.tile(limit.output, (4, 1)), atol=1e-11 * size)
    # all but the first sample is learned, which no command reaches, and to the last commands the
    # law sends that error for ever, without anything coming of it
    np.testing.assert_allclose(limit.error[0, 1:], 0, atol=1e-11 * size)
    np.testing.assert_allclose(run.command[:, :7], np.tile(u[:7], (4, 1)), atol=1e-11 * size)


@pytest.mark.parametrize("start", RESTS, ids=str)
def test_the_limit_from_rest_under_a_filter_stays_where_it_is(start):
    r = np.random.default_rng(2).standard_normal(8)
    scheme = Scheme(LAG, learning.p_type_law(0.6, 1, Q2), 8, start)
    limit = learning.steady_state(scheme, r, rest=-0.5)
    run = learning.simulate(scheme, r, passes=2, rest=-0.5, first=limit.command[0])
    np.testing.assert_allclose(run.command, np.tile(limit.command, (3, 1)), atol=1e-12)
    far = learning.simulate(scheme, r, passes=400, rest=-0.5)
    np.testing.assert_allclose(far.command[-1], limit.command[0], atol=1e-9)


# ---- noise ----


@each_plant
@pytest.mark.parametrize("q", [[1.0], Q1], ids=["q = 1", "short q"])
@pytest.mark.parametrize("period", [7, 8])
@pytest.mark.parametrize("passes", [0, 1, 2, 6, None])
@each_source
@each_output
def test_noise_gain_is_a_sum_of_matrix_powers(plant, q, period, passes, source, output):
    plant, law = make(q, plant=plant)
    m, into, g = circulant_sources(plant, law, period)
    covariance = spread_of(m, into[source], passes)
    expected = deviation(covariance, g, output, source)
    found = learning.noise_gain(Scheme(plant, law, period), output, source, passes=passes)
    # rounding; in the end times the condition of 1 - m, below 1e3
    assert found == pytest.approx(expected, rel=1e-11 if passes is not None else 1e-9, abs=1e-15)


@each_source
@each_output
@pytest.mark.parametrize("passes", [0, 1, 5, None])
def test_noise_of_passes_from_rest_is_a_sum_of_lifted_powers(source, output, passes):
    for start in RESTS:
        law = learning.p_type_law(0.6, 1)
        m, into = lifted_sources(LAG, law, 8, start.after)
        g = np.array([learning.simulate(Scheme(LAG, law, 8, RESET), np.zeros(8), passes=0,
                                        first=unit).output[0] for unit in np.eye(8)]).T  # fmt: skip
        b, kept = into[source], 7 if passes is None and start.after != "on" else 8
        covariance = np.zeros((8, 8))  # the last command is a random walk that reaches nothing
        covariance[:kept, :kept] = spread_of(m[:kept, :kept], b[:kept], passes)
        expected = deviation(covariance, g, output, source)
        scheme = Scheme(LAG, law, 8, start)
        found = learning.noise_gain(scheme, output, source, passes=passes)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-15)  # rounding times condition


@each_source
@each_output
@pytest.mark.parametrize("start", [CONTINUOUS, FORGETFUL], ids=str)
@pytest.mark.parametrize("passes", [0, 1, 3])
def test_noise_of_a_run_for_some_passes_is_the_sum_over_all_samples(source, output, start, passes):
    plant, law = make(Q1)
    u, y = probed(plant, law, 6, start, source, passes)
    own = np.eye(6 * (passes + 1))[-6:]
    share = {"reference": 1, "disturbance": 0, "noise": -(output == "measured_error")}[source]
    if output in ("command", "repetitive"):
        expected = u
    else:
        expected = y if output == "output" else share * own - y
    found = learning.noise_gain(Scheme(plant, law, 6, start), output, source, passes=passes)
    deviation_of_it = np.sqrt(np.sum(expected**2) / 6)
    assert found == pytest.approx(deviation_of_it, rel=1e-11, abs=1e-15)  # rounding


@each_plant
@pytest.mark.parametrize("q", [[1.0], Q1], ids=["q = 1", "short q"])
@each_source
@each_output
def test_noise_of_a_run_in_the_end_is_that_after_many_passes(plant, q, source, output):
    plant, law = make(q, gain=1.0, plant=plant)
    scheme = Scheme(plant, law, 9, CONTINUOUS)
    passes = int(np.log(1e-9) / np.log(learning.spectral_radius(scheme))) + 5
    after = learning.noise_gain(scheme, output, source, passes=passes)
    # what is left of the beginning
    assert learning.noise_gain(scheme, output, source) == pytest.approx(after, rel=1e-6)


@each_plant
@pytest.mark.parametrize("q", [[1.0], Q1, Q2], ids=["q = 1", "short q", "long q"])
@pytest.mark.parametrize("output", ["output", "command"])
def test_noise_of_a_run_is_that_of_the_plug_in_loop(plant, q, output):
    plant, law = make(q, plant=plant)
    controller = RepetitiveController(law.filter, repetitive.plain(12, law.q), 1.0)
    loop = Loop(Process(plant), controller, "plug-in")
    found = learning.noise_gain(Scheme(plant, law, 12, CONTINUOUS), output)
    # sums over the circle, of polynomials that differ by rounding
    assert found == pytest.approx(repetitive.noise_gain(loop, output), rel=1e-9)


@each_seed
@pytest.mark.parametrize("passes", [1, 4])
def test_noise_gain_agrees_with_runs(seed, passes):
    rng = np.random.default_rng(seed)
    scheme = Scheme(*make(Q1), 48)
    squares = []
    for _ in range(300):
        noise = rng.standard_normal((passes + 1, 48))
        run = learning.simulate(scheme, np.zeros(48), passes=passes, noise=noise)
        squares.append(np.mean(run.error[-1] ** 2))
    mean, sigma = np.mean(squares), np.std(squares, ddof=1) / np.sqrt(len(squares))
    expected = learning.noise_gain(scheme, passes=passes) ** 2
    assert abs(mean - expected) < 4.5 * sigma  # independent runs: one false alarm in 1e5
    assert sigma < 0.03 * expected  # the band is narrow enough to tell passes apart


# ---- each key check can fail ----


def test_slips_of_the_roots_would_be_seen():
    plant, law = make(Q1)
    truth = companion_radius(plant, law, 8)
    f = law.filter
    for other in (
        Scheme(plant, law, 9, CONTINUOUS),
        Scheme(plant, LearningLaw(f), 8, CONTINUOUS),
        Scheme(plant, LearningLaw(NoncausalFilter(f.b, f.a, f.advance - 1), Q1), 8, CONTINUOUS),
        Scheme(plant, LearningLaw(NoncausalFilter(f.b, [1.0], f.advance), Q1), 8, CONTINUOUS),
        Scheme(plant, LearningLaw(NoncausalFilter(-f.b, f.a, f.advance), Q1), 8, CONTINUOUS),
    ):
        assert abs(np.abs(learning.roots(other)[0]) - truth) > 1e-4


def test_slips_of_the_noise_gain_would_be_seen():
    plant, law = make(gain=0.3)
    m, into, g = circulant_sources(plant, law, 8)
    truth = deviation(spread_of(m, into["noise"], 4), g, "output", "noise")
    scheme = Scheme(plant, law, 8)
    for slip in (
        learning.noise_gain(scheme, passes=5),
        learning.noise_gain(scheme),
        learning.noise_gain(scheme, "command", passes=4),
        learning.noise_gain(scheme, "output", "disturbance", passes=4),
        learning.noise_gain(Scheme(plant, law, 8, CONTINUOUS), passes=4),
    ):
        assert abs(slip / truth - 1) > 0.01


def test_slips_of_the_limit_would_be_seen():
    plant, law = make(Q1)
    r, w = np.random.default_rng(5).standard_normal((2, 9))
    right = learning.steady_state(Scheme(plant, law, 9), r, disturbance=w).command
    for slip in (
        learning.steady_state(Scheme(plant, law, 9), r, disturbance=-w),
        learning.steady_state(Scheme(plant, LearningLaw(law.filter), 9), r, disturbance=w),
        learning.simulate(Scheme(plant, law, 9), r, passes=0, disturbance=w),
    ):
        assert np.abs(slip.command - right).max() > 0.01
