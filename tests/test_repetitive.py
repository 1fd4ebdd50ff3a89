"""The repetitive loop by several routes: definition, matrices, python-control, closed forms."""

import time
from dataclasses import replace

import control
import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from oracles.repetitive import (
    Definition,
    block_solution,
    circulant_solution,
    controller_polynomials,
    controller_response,
    limited,
    open_polynomials,
    outside_by_winding,
    schur_cohn,
    thesis,
)

from rcbook import signals, zdomain
from rcbook.loops import repetitive
from rcbook.loops.repetitive import Limit, Limits, Loop, Process, RepetitiveController
from rcbook.zdomain import NoncausalFilter, Plant

SEEDS = range(4)
MILL = Plant([9.0452, -7.8975], [1, -0.7537, -0.2404], 1, 1 / 60)  # thesis, eq. 7
PI = Plant([0.064, 0.032], [1, -1], 0, 1 / 60)  # thesis, eq. 11
MILLING = Process(MILL, PI)
LAG = Process(Plant([0.5, 0.2], [1, -0.9, 0.1], 2, 1.0))  # a plant by itself, two samples late
OUTSIDE = Process(Plant([1.0, 1.6], [1, -0.6, 0.3], 1, 1.0))  # zero at -1.6: B- = 1 + 1.6/z
OUTSIDE_LAG = Process(Plant([0.3, -0.9, 0.5], [1, -0.5], 1, 1.0), Plant([0.1], [1, -0.8], 0, 1.0))

design = repetitive.design


def mismatched(loop, scale=1.2, shift=0.05, extra_delay=0):
    """The same repetitive controller round a plant it was not designed for."""
    plant = loop.process.plant
    other = Plant(
        scale * plant.b,
        [1.0, plant.a[1] + shift, *plant.a[2:]],
        plant.delay + extra_delay,
        plant.dt,
    )
    return replace(loop, process=Process(other, loop.process.controller))


Q1 = zdomain.binomial_q(1)
Q2 = zdomain.symmetric_fir([0.8, 0.1, -0.02])
FRACTION = repetitive.plain(6.4)
TWO = repetitive.several(repetitive.plain(6, Q1), repetitive.plain(9, Q1))
LEAD = RepetitiveController(repetitive.lead(2), repetitive.plain(6, Q1), 0.5)
RESONATORS = repetitive.resonators(MILLING.command_path, 6, (0, 1, 2), 0.1)
LOOPS = {
    f"{name}, {form}": replace(loop, form=form)
    for form in ("cascade", "plug-in")
    for name, loop in {
        "milling": design(MILLING, 6, 0.8),
        "milling with Q": design(MILLING, repetitive.plain(6, Q1), 0.8),
        "no inner controller": design(LAG, 7, 0.5),
        "no inner controller, long Q": design(LAG, repetitive.plain(7, Q2), 1.1),
        "zero outside": design(OUTSIDE, 5, 0.9),
        "zeros outside, inner controller": design(OUTSIDE_LAG, repetitive.plain(9, Q1), 0.6),
        "shortest period": design(OUTSIDE, 2, 0.4),
        "mismatch": mismatched(design(MILLING, 6, 0.8)),
        "slow zero kept": design(MILLING, 8, 0.7, radius=0.8, normalisation="l1"),
        "fraction of a sample": design(MILLING, FRACTION, 0.8),
        "odd harmonics": design(LAG, repetitive.odd_harmonic(14, Q1), 0.7),
        "odd harmonics of an odd period": design(MILLING, repetitive.odd_harmonic(13), 0.7),
        "two periods": design(MILLING, TWO, 0.5),
        "lead": Loop(MILLING, LEAD),
        "resonators": Loop(MILLING, RESONATORS),
        "inner loop alone": Loop(MILLING),
        "plant alone": Loop(LAG),
    }.items()
}
each_loop = pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS.keys())
STABLE = {name: loop for name, loop in LOOPS.items() if "alone" not in name}


def records(n, seed=0):
    """Reference, disturbance and noise, each exciting everything."""
    return np.random.default_rng(seed).standard_normal((3, n))


# ---- responses ----


@each_loop
@pytest.mark.parametrize("seed", SEEDS)
def test_recursion_and_transfer_functions_agree_with_the_definition(loop, seed):
    r, w, noise = records(90, seed)
    truth = Definition(loop).run(r, w, noise)
    for answer in (repetitive.simulate, repetitive.respond):
        run = answer(loop, r, disturbance=w, noise=noise)
        for name, expected in truth.items():
            # 90 samples of order 100 in double precision; zeros within 0.8 are cancelled
            np.testing.assert_allclose(getattr(run, name), expected, atol=1e-8, err_msg=name)


def delayed(process, by):
    plant = process.plant
    return Process(Plant(plant.b, plant.a, plant.delay + by, plant.dt), process.controller)


def slips(loop):
    """Loops that are wrong in one small place."""
    rc = loop.repetitive
    yield replace(loop, process=delayed(loop.process, 1))
    yield loop.with_gain(1.01 * rc.gain)
    yield replace(loop, form="cascade" if loop.form == "plug-in" else "plug-in")
    if not isinstance(rc, RepetitiveController):
        yield replace(loop, repetitive=replace(rc, bank=np.r_[0.0, rc.bank]))
        return
    late = replace(rc.compensator, advance=rc.compensator.advance - 1)
    memory = rc.memory
    smoothed = np.convolve(memory.taps, Q1)  # one sample wider, and so one late
    for mutant in (
        replace(rc, compensator=late),
        replace(rc, memory=replace(memory, first=memory.first + 1)),
        replace(rc, memory=replace(memory, taps=smoothed)),
    ):
        yield replace(loop, repetitive=mutant)


@pytest.mark.parametrize("loop", STABLE.values(), ids=STABLE.keys())
def test_definition_notices_every_slip(loop):
    r, w, noise = records(90)
    truth = Definition(loop).run(r, w, noise)
    for mutant in slips(loop):
        run = repetitive.simulate(mutant, r, disturbance=w, noise=noise)
        assert np.abs(run.output - truth["output"]).max() > 1e-3


@pytest.mark.parametrize("period", [2, 6, 12])
@pytest.mark.parametrize("gain", [0.4, 0.8, 1.4, 2.0, 2.4])
def test_thesis_recursion_with_equation_25_corrected_is_the_cascade(period, gain):
    runout = 0.3 * np.sin(2 * np.pi * np.arange(90) / 6 + 2 * np.pi / 3)
    loop = repetitive.design(
        Process(MILL, repetitive.pi_controller(0.064, 1.5, 1 / 60)), period, gain
    )
    run = repetitive.simulate(loop, np.full(90, 20.0), disturbance=runout)
    scale = max(1.0, np.abs(run.output).max())  # at k_r = 2.4 and N = 2 the force grows
    for name, expected in thesis(period, gain, 90, runout).items():
        # rounding over 90 samples relative to the largest force; 1 - 1.4^45 amplifies it
        np.testing.assert_allclose(getattr(run, name), expected, atol=1e-8 * scale, err_msg=name)
    printed = thesis(period, gain, 90, runout, literal_25=True)
    assert np.abs(printed["output"] - run.output).max() > 1.0  # lb: the misprint shows at once


@pytest.mark.parametrize("form", repetitive.FORMS)
@pytest.mark.parametrize("q", [np.ones(1), Q1], ids=["no Q", "Q"])
@pytest.mark.parametrize("process", [MILLING, OUTSIDE], ids=["milling", "zero outside"])
def test_python_control_interconnection_gives_the_same_response(process, q, form):
    loop = repetitive.design(process, repetitive.plain(6, q), 0.7, form=form)
    rc, dt = loop.repetitive, loop.dt
    comp, half = rc.compensator, q.size // 2

    def block(num, den, name, inputs, output):
        size = max(len(num), len(den))
        num, den = (np.pad(p, (0, size - len(p))) for p in (num, den))
        num = np.trim_zeros(num, "f")  # scipy warns of leading zeros
        system = control.ss(*scipy.signal.tf2ss(num, den), dt)
        return control.StateSpace(system, name=name, inputs=inputs, outputs=output)

    delay = 6 - half - comp.advance
    controller = block(
        np.r_[np.zeros(delay), 0.7 * np.convolve(q, comp.b)], comp.a, "rc", ["s"], ["p0"]
    )
    # positive feedback round a delay of one period is the generator 1/(1 - q z^-N)
    store = block(np.r_[np.zeros(6 - half), q], [1.0], "store", ["p"], ["p1"])
    plant = process.plant
    parts = [
        controller,
        store,
        block(np.r_[np.zeros(plant.delay), plant.b], plant.a, "plant", ["x"], ["y"]),
        control.summing_junction(["p0", "p1"], "p", name="generator"),
        control.summing_junction(["v", "w"], "x", name="input"),
        control.summing_junction(["y", "noise"], "m", name="sensor"),
        control.summing_junction(["r", "-m"], "s", name="comparison"),
        control.summing_junction(["p", "r"] if form == "plug-in" else ["p"], "u", name="sum"),
    ]
    if process.controller is None:
        parts.append(control.summing_junction(["u"], "v", name="wire"))
    else:
        parts.append(control.summing_junction(["u", "-m"], "i", name="inner"))
        parts.append(block(process.controller.b, process.controller.a, "pi", ["i"], ["v"]))
    whole = control.interconnect(
        parts, inplist=["r", "w", "noise"], outlist=["y", "v", "u", "s"], dt=dt
    )
    inputs = records(60)
    found = control.forced_response(whole, dt * np.arange(60), inputs)
    r, w, noise = inputs
    run = repetitive.simulate(loop, r, disturbance=w, noise=noise)
    for signal, expected in zip(
        (run.output, run.command, run.repetitive, run.measured_error), found.outputs, strict=True
    ):
        np.testing.assert_allclose(signal, expected, atol=1e-9)  # rounding over 60 samples


@each_loop
def test_every_transfer_is_that_of_the_block_equations(loop):
    z = 1.07 * np.exp(1j * np.linspace(0, np.pi, 23))
    for point in z:
        truth = block_solution(loop, point)
        for output in repetitive.OUTPUTS:
            for j, source in enumerate(repetitive.SOURCES):
                num, den = repetitive.transfer(loop, source, output)
                ours = np.polyval(num[::-1], 1 / point) / np.polyval(den[::-1], 1 / point)
                # a linear solve of four equations of moderate condition
                assert ours == pytest.approx(truth[output][j], rel=1e-8, abs=1e-9), (source, output)


@each_loop
def test_frequency_response_and_sensitivity_are_those_of_the_block_equations(loop):
    for f in np.array([0.013, 0.11, 0.27, 0.49]) / loop.dt:  # Hz
        truth = block_solution(loop, np.exp(2j * np.pi * f * loop.dt))
        ours = repetitive.frequency_response(loop, "disturbance", "output", f)
        assert ours == pytest.approx(truth["output"][1], rel=1e-8)
        # y + noise for unit noise
        assert repetitive.sensitivity(loop, f) == pytest.approx(truth["output"][2] + 1, rel=1e-8)


def test_sensitivity_of_a_cascade_has_the_textbook_form():
    loop = LOOPS["milling, cascade"]
    f = 3.7
    z = np.exp(2j * np.pi * f / 60)
    closed = MILLING.command_path.to_control()(z)
    g_pi = (PI.to_control() * MILL.to_control())(z)
    rep = 0.8 * z**-6 / (1 - z**-6) / closed
    # a disturbance on the output meets 1 + (PI + rep PI) G = (1 + PI G)(1 + rep closed)
    truth = 1 / ((1 + g_pi) * (1 + rep * closed))
    assert repetitive.sensitivity(loop, f) == pytest.approx(truth, rel=1e-10)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_loop_of_python_control_feedback_is_the_process(seed):
    rng = np.random.default_rng(seed)
    plant = Plant(
        rng.uniform(-1, 1, 3), [1, *rng.uniform(-0.4, 0.4, 2)], int(rng.integers(1, 4)), 0.1
    )
    pi = repetitive.pi_controller(rng.uniform(0.01, 0.2), rng.uniform(0.1, 1.8), 0.1)
    process, z = Process(plant, pi), 1.1 * np.exp(1j * np.linspace(0, np.pi, 15))
    g, k = plant.to_control(), pi.to_control()
    # rounding of ratios of short polynomials
    np.testing.assert_allclose(
        zdomain.response(process.command_path, z), control.feedback(g * k)(z), rtol=1e-9
    )
    np.testing.assert_allclose(
        zdomain.response(process.disturbance_path, z), control.feedback(g, k)(z), rtol=1e-9
    )


def test_pi_controller_adds_up_its_input():
    pi = repetitive.pi_controller(0.064, 1.5, 1 / 60)
    # eq. 9 by hand: Kp e(k) + alpha Kp (sum of all earlier errors)
    e = np.array([1.0, -2.0, 0.5, 3.0])
    truth = [0.064 * e[k] + 1.5 * 0.064 * e[:k].sum() for k in range(4)]
    np.testing.assert_allclose(scipy.signal.lfilter(pi.b, pi.a, e), truth, atol=1e-15)


@pytest.mark.parametrize("gain", [0.3, 0.8, 1.0, 1.6, 2.0, 2.3])
@pytest.mark.parametrize(("process", "period"), [(MILLING, 6), (LAG, 7)])
def test_step_climbs_a_staircase_one_step_a_period(process, period, gain):
    """Exact cancellation: y = k z^-N/(1 - (1 - k) z^-N) r, thus r (1 - (1 - k)^m) in period m."""
    loop = repetitive.design(process, period, gain, normalisation="dc")
    n = 9 * period
    run = repetitive.simulate(loop, np.full(n, 20.0))
    truth = 20 * (1 - (1 - gain) ** (np.arange(n) // period))
    # cancelled modes decay: rounding of the command, at most some 1e-13 per sample
    np.testing.assert_allclose(run.output, truth, atol=1e-9)
    late = 20 * (1 - (1 - gain) ** ((np.arange(n) + 1) // period))
    assert np.abs(run.output - late).max() > 1  # one sample of slip would show


def test_signals_before_the_first_period_are_zero_in_a_cascade():
    run = repetitive.simulate(LOOPS["milling, cascade"], np.full(30, 20.0))
    assert not run.output[:6].any()  # exactly: nothing has left the store yet
    assert run.repetitive[:5].tolist() == [0] * 5 and run.repetitive[5] != 0  # N - d = 5


def test_time_counts_seconds():
    run = repetitive.simulate(LOOPS["milling, cascade"], np.zeros(61))
    assert run.time[-1] == pytest.approx(1.0, rel=1e-15)


# ---- limits ----


LIMITS = [
    Limits(Limit(c, keep_c), Limit(u, keep_u))
    for c, u in ((0.5, np.inf), (np.inf, 0.8), (0.6, 0.9))
    for keep_c in (True, False)
    for keep_u in (True, False)
]


@each_loop
@pytest.mark.parametrize(
    "limits", LIMITS, ids=lambda p: f"{p.command} {p.repetitive}".replace("Limit", "")
)
def test_limits_and_their_memory_follow_the_definition(loop, limits):
    r, w, noise = records(60, seed=3)
    truth, acted = limited(loop, r, w, noise, limits.command, limits.repetitive)
    run = repetitive.simulate(loop, r, disturbance=w, noise=noise, limits=limits)
    scale = max(1.0, max(np.abs(s).max() for s in truth.values()))
    for name, expected in truth.items():
        np.testing.assert_allclose(getattr(run, name), expected, atol=1e-9 * scale, err_msg=name)
    assert [run.command_clipped, run.repetitive_clipped] == acted and sum(acted) > 0
    assert np.abs(run.command).max() <= limits.command.value
    assert np.abs(run.repetitive).max() <= limits.repetitive.value


@pytest.mark.parametrize("loop", STABLE.values(), ids=STABLE.keys())
def test_a_limit_that_is_never_reached_changes_nothing(loop):
    r, w, noise = records(60, seed=1)
    free = repetitive.simulate(loop, r, disturbance=w, noise=noise)
    big = Limit(2 * max(np.abs(free.command).max(), np.abs(free.repetitive).max()))
    raw = Limit(big.value, remember_clipped=False)
    for limit in (big, raw):
        limits = Limits(limit, limit)
        run = repetitive.simulate(loop, r, disturbance=w, noise=noise, limits=limits)
        for name in repetitive.OUTPUTS:
            assert np.array_equal(getattr(run, name), getattr(free, name))
        assert run.command_clipped == run.repetitive_clipped == 0


@pytest.mark.parametrize(
    "name", ["milling, cascade", "milling, plug-in", "inner loop alone, cascade"]
)
def test_limit_oracle_tells_the_two_memories_apart(name):
    r, w, noise = records(60, seed=3)
    one, other = (
        limited(LOOPS[name], r, w, noise, Limit(0.05, keep), Limit(0.3, keep))[0]
        for keep in (True, False)
    )
    assert np.abs(np.array(one["output"]) - other["output"]).max() > 0.1


def test_a_value_that_just_reaches_the_limit_is_not_counted_as_clipped():
    run = repetitive.simulate(LAG, np.ones(5), limits=Limits(Limit(1.0)))
    assert run.command_clipped == 0


# ---- stability ----


@pytest.mark.parametrize("loop", STABLE.values(), ids=STABLE.keys())
@pytest.mark.parametrize("gain", [0.1, 0.9, 1.9, 2.1, 3.0])
def test_characteristic_polynomial_holds_every_mode_of_the_block_diagram(loop, gain):
    loop = loop.with_gain(gain)
    a, *_ = Definition(loop).state_space(repetitive.OUTPUTS)
    d, n = open_polynomials(loop)
    roots, found = repetitive.roots(loop), repetitive.verdict(loop)
    polynomial = repetitive.characteristic_polynomial(loop)
    # exact sums of products: rounding of coefficients of order one
    np.testing.assert_allclose(
        np.pad(polynomial, (0, d.size - polynomial.size)), d + gain * n, atol=1e-12
    )
    # two eigenvalue problems; the other one carries Jordan blocks at 0, none near the circle
    assert np.abs(roots[0]) == pytest.approx(np.abs(np.linalg.eigvals(a)).max(), abs=1e-6)
    assert repetitive.spectral_radius(loop) == np.abs(roots[0]) ** loop.period
    assert (found.verdict == "stable") == schur_cohn(d + gain * n)
    if found.outside is not None:
        assert found.outside == np.sum(np.abs(roots) > 1)
    # a gain of 3 puts roots on the circle itself, where rounding says on which side
    outside = int(np.sum(np.abs(roots) > 1.001))
    assert outside == outside_by_winding(d + gain * n, 1.001)
    assert (found.verdict == "stable") == (outside == 0)


@pytest.mark.parametrize(
    ("period", "gain"),
    [(n, k) for n in (2, 6, 60) for k in (0.05, 0.8, 1.7, 2.2)]
    + [(300, 1.7), (300, 2.2), (1000, 0.8)],
)
def test_exact_cancellation_leaves_generator_modes_and_what_was_cancelled(period, gain):
    loop = repetitive.design(MILLING, period, gain)
    # eq. 12: P and Q factor out of the characteristic polynomial
    ki = 0.032
    p = [1, -0.7537 - 1 + 0.064 * 9.0452, -0.2404 + 0.7537 - 0.064 * 7.8975 + ki * 9.0452]
    p.append(0.2404 - ki * 7.8975)
    others = [*np.abs(np.roots(p)), 7.8975 / 9.0452, 0.5]
    truth = max(abs(1 - gain) ** (1 / period), *others)
    roots = repetitive.roots(loop)
    # backward error of a companion matrix of order N: about N eps
    assert np.abs(roots[0]) == pytest.approx(truth, rel=1e-10)
    on_ring = np.sum(np.abs(np.abs(roots) - abs(1 - gain) ** (1 / period)) < 1e-9)
    assert on_ring == period or abs(1 - gain) ** (1 / period) in others


@pytest.mark.parametrize("period", [60, 100, 300])
@pytest.mark.parametrize("q", [Q1, Q2], ids=["binomial", "flat"])
def test_long_periods_with_q_agree_with_winding_and_jury(period, q):
    for gain in (0.5, 1.9, 2.6, 6.0):
        loop = repetitive.design(OUTSIDE, repetitive.plain(period, q), gain)
        d, n = open_polynomials(loop)
        found = repetitive.verdict(loop)
        outside = outside_by_winding(d + gain * n, points=2**17)
        assert int(np.sum(np.abs(repetitive.roots(loop)) > 1)) == outside == found.outside
        assert (found.verdict == "stable") == (outside == 0) == schur_cohn(d + gain * n)


@pytest.mark.parametrize("period", [4, 5, 9])
@pytest.mark.parametrize("gain", [0.3, 1.2, 1.9])
def test_modes_with_a_zero_outside_solve_their_own_equation(period, gain):
    """z^N = 1 - k |B-|^2/b with |B-|^2 = 1 + c^2 + c (z + 1/z): a polynomial of its own."""
    c = 1.6
    loop = repetitive.design(OUTSIDE, period, gain)
    p = np.zeros(period + 2)  # times z, highest power first
    p[0], p[-2] = 1.0, -1.0
    p[-3:] += gain * np.array([c, 1 + c * c, c]) / (1 + c) ** 2
    truth = [*np.roots(p), *np.roots([1, -0.6, 0.3])]
    radius = np.abs(repetitive.roots(loop)[0])
    assert radius == pytest.approx(np.abs(truth).max(), rel=1e-10)  # simple roots


@pytest.mark.parametrize(
    ("gain", "verdict"), [(1.999, "stable"), (2.0, "undecided"), (2.001, "unstable")]
)
def test_verdict_turns_at_a_gain_of_two(gain, verdict):
    assert repetitive.verdict(repetitive.design(MILLING, 6, gain)).verdict == verdict


@pytest.mark.parametrize("name", STABLE)
def test_stable_gains_are_those_of_a_scan(name):
    loop = STABLE[name]
    d, n = open_polynomials(loop)
    intervals = repetitive.stable_gains(loop, highest=5.0)
    for gain in np.concatenate([np.geomspace(1e-3, 0.1, 20), np.linspace(0.101, 4.99, 150)]):
        if any(abs(gain - edge) < 1e-6 for pair in intervals for edge in pair):
            continue  # Jury's test itself cannot decide so near to the circle
        inside = any(low < gain < high for low, high in intervals)
        assert inside == schur_cohn(d + gain * n), gain


@pytest.mark.parametrize("extra_delay", [0, 1])
@pytest.mark.parametrize("scale", [0.5, 1.0, 1.6, 3.0])
@pytest.mark.parametrize("q", [np.ones(1), Q1], ids=["no Q", "Q"])
def test_stable_gains_under_mismatch_are_those_of_a_scan(extra_delay, scale, q):
    loop = mismatched(
        repetitive.design(MILLING, repetitive.plain(6, q), 0.8), scale, 0.03, extra_delay
    )
    d, n = open_polynomials(loop)
    intervals = repetitive.stable_gains(loop, highest=5.0)
    gains = np.linspace(0.0137, 4.99, 150)
    inside = [any(low < g < high for low, high in intervals) for g in gains]
    near = [any(abs(g - edge) < 1e-6 for pair in intervals for edge in pair) for g in gains]
    for gain, ours, undecided in zip(gains, inside, near, strict=True):
        assert undecided or ours == schur_cohn(d + gain * n), gain


# characteristic polynomials d + k n of order 5, found by a random search for two intervals: the
# mean of two stable polynomials need not be stable
TWO_INTERVALS = [
    ([1.0, 2.485, 0.681, -2.837, -3.228, -1.155], [1.04, 2.089, 1.73, 0.583]),
    ([1.0, -0.86, 2.073, -0.275, -0.292, 0.645], [-0.978, 0.434, 0.176, -0.304]),
    ([1.0, 2.032, 0.612, -1.005, -0.811, -0.111], [0.672, 0.869, 0.479, 0.037]),
    ([1.0, -1.947, 3.167, -3.322, 1.806, -0.226], [-0.924, 1.395, -0.632, 0.003]),
]


@pytest.mark.parametrize(("d", "n"), TWO_INTERVALS)
def test_stable_gains_finds_both_of_two_intervals(d, n):
    q = next(root.real for root in np.roots(d) if root.imag == 0)  # the generator's pole, N = 1
    plant = Plant([1.0], np.polydiv(d, [1.0, -q])[0], 1, 1.0)
    repeat = RepetitiveController(
        NoncausalFilter(np.array(n) / q, [1.0], 0), repetitive.plain(1, [q]), 1.0
    )
    intervals = repetitive.stable_gains(Loop(Process(plant), repeat), highest=6.0)
    assert len(intervals) == 2
    d, n = np.array(d), np.array([0, 0, *n])
    for gain in np.linspace(0.003, 5.997, 1500):
        inside = any(low < gain < high for low, high in intervals)
        if all(abs(gain - edge) > 1e-6 for pair in intervals for edge in pair):
            assert inside == schur_cohn(d + gain * n), gain
    for edge in np.ravel(intervals):
        # at an edge a root lies on the circle: the edge is good to rounding
        assert np.abs(np.roots(d + edge * n)).max() == pytest.approx(1.0, abs=1e-9)
    loop = Loop(Process(plant), repeat)
    assert repetitive.gain_limit(loop) == 0.0  # small gains are unstable here


@pytest.mark.parametrize("period", [2, 6, 60, 200])
def test_stable_gains_of_exact_cancellation_end_at_two(period):
    intervals = repetitive.stable_gains(repetitive.design(MILLING, period, 0.8))
    (low, high), *others = intervals
    # N clustered crossings, each good to N eps
    assert low == 0.0 and high == pytest.approx(2.0, rel=1e-9) and not others


def test_a_lightly_damped_pole_that_is_cancelled_is_no_edge():
    """It lies within 1e-4 of the circle but never on it: one interval, not two side by side."""
    pair = 0.99995 * np.exp([1j, -1j])
    loop = repetitive.design(Process(Plant([1.0], np.poly(pair).real, 1, 1.0)), 5, 0.5)
    ((low, high),) = repetitive.stable_gains(loop)
    assert low == 0.0 and high == pytest.approx(2.0, rel=1e-9)


def test_gain_scan_is_not_used_up_by_its_own_limit():
    loop = repetitive.design(MILLING, 6, 0.8)
    assert repetitive.stable_gains(loop, highest=1.5) == [(0.0, 1.5)]
    assert repetitive.gain_limit(loop) == pytest.approx(2.0, rel=1e-9)


def test_no_gain_is_stable_with_the_wrong_sign():
    wrong = mismatched(repetitive.design(MILLING, 6, 0.8), scale=-0.01, shift=0.0)
    assert repetitive.stable_gains(wrong) == [] and repetitive.gain_limit(wrong) == 0.0


@pytest.mark.parametrize("period", [4, 6])
def test_a_zero_at_a_harmonic_leaves_its_mode_marginal_at_any_gain(period):
    """B(-1) = 0 hides the generator's mode at z = -1 when N is even: d(-1) = n(-1) = 0."""
    loop = repetitive.design(Process(Plant([1.0, 1.0], [1.0, -0.5], 1, 1.0)), period, 0.5)
    d, n = open_polynomials(loop)
    signs = (-1.0) ** np.arange(d.size)
    assert d @ signs == pytest.approx(0, abs=1e-14) and n @ signs == pytest.approx(0, abs=1e-14)
    assert repetitive.verdict(loop).verdict == "undecided"


@pytest.mark.parametrize("period", [4, 6])
@pytest.mark.parametrize("zero", [1.0, -1.0])
def test_no_gain_is_stable_when_a_mode_of_the_generator_cannot_be_moved(period, zero):
    loop = repetitive.design(Process(Plant([1.0, -zero], [1.0, -0.5], 1, 1.0)), period, 0.5)
    intervals = repetitive.stable_gains(loop)
    assert intervals == [] and repetitive.gain_limit(loop) == 0.0


def test_a_zero_at_minus_one_does_no_harm_at_an_odd_period():
    loop = repetitive.design(Process(Plant([1.0, 1.0], [1.0, -0.5], 1, 1.0)), 5, 0.5)
    assert repetitive.verdict(loop).verdict == "stable"


# ---- steady state ----


def records_of_one_period(loop, seed):
    period = 7 if loop.repetitive is None else round(loop.repetitive.period)
    return np.random.default_rng(seed).standard_normal((2, period))


@each_loop
@pytest.mark.parametrize("seed", SEEDS)
def test_steady_state_solves_the_periodic_equations(loop, seed):
    r, w = records_of_one_period(loop, seed)
    steady = repetitive.steady_state(loop, r, disturbance=w)
    y, v, u, e = circulant_solution(loop, r, w)
    # condition of the periodic equations below 1e5
    np.testing.assert_allclose(steady.output, y, atol=1e-10)
    np.testing.assert_allclose(steady.command, v, atol=1e-10)
    np.testing.assert_allclose(steady.repetitive, u, atol=1e-10)
    np.testing.assert_allclose(steady.error, e, atol=1e-10)


@each_loop
def test_steady_state_is_where_a_long_run_ends(loop):
    r, w = records_of_one_period(loop, 11)
    radius = np.abs(repetitive.roots(loop)[0])
    # radius^(periods * n) below 1e-13
    periods = int(np.ceil(np.log(1e-13) / np.log(radius) / r.size)) + 2
    run = repetitive.respond(loop, np.tile(r, periods), disturbance=np.tile(w, periods))
    steady = repetitive.steady_state(loop, r, disturbance=w)
    for name in repetitive.OUTPUTS:
        np.testing.assert_allclose(getattr(run, name)[-r.size :], getattr(steady, name), atol=1e-8)
    shifted = np.roll(steady.output, 1)
    assert np.abs(run.output[-r.size :] - shifted).max() > 1e-3  # a slip by one sample shows


@pytest.mark.parametrize("form", repetitive.FORMS)
def test_without_q_the_steady_error_is_zero_and_with_q_it_is_not(form):
    r, w = np.random.default_rng(2).standard_normal((2, 6))
    free = repetitive.design(MILLING, 6, 0.8, form=form)
    free = repetitive.steady_state(free, r, disturbance=w)
    assert np.abs(free.error).max() < 1e-11  # rounding: every harmonic is a generator pole
    low = repetitive.design(MILLING, repetitive.plain(6, Q1), 0.8, form=form)
    low = repetitive.steady_state(low, r, disturbance=w)
    assert np.abs(low.error).max() > 0.05


def test_steady_state_of_a_long_period_still_solves_the_periodic_equations():
    loop = repetitive.design(MILLING, repetitive.plain(120, Q1), 0.8)
    r, w = np.random.default_rng(4).standard_normal((2, 120))
    y, *_ = circulant_solution(loop, r, w)
    steady = repetitive.steady_state(loop, r, disturbance=w)
    np.testing.assert_allclose(steady.output, y, atol=1e-9)  # 480 equations


# ---- noise ----


@pytest.mark.parametrize("name", LOOPS)
@pytest.mark.parametrize("source", repetitive.SOURCES)
def test_noise_gain_is_that_of_the_lyapunov_equation(name, source):
    loop, column = LOOPS[name], repetitive.SOURCES.index(source)
    a, b, c, d = Definition(loop).state_space(repetitive.OUTPUTS)
    noise = b[:, [column]]
    covariance = scipy.linalg.solve_discrete_lyapunov(a, noise @ noise.T)
    for output, row, through in zip(repetitive.OUTPUTS, c, d[:, column], strict=True):
        variance = row @ covariance @ row + through**2
        # a Lyapunov solver loses 1/(1 - radius), here at most 1e3, and the square root half of it;
        # a loop that noise does not reach has 0 = sqrt(rounding)
        ours = repetitive.noise_gain(loop, output, source)
        assert ours == pytest.approx(np.sqrt(max(variance, 0.0)), rel=1e-7, abs=1e-7), output


@pytest.mark.parametrize("name", LOOPS)
def test_noise_gain_is_the_energy_of_the_impulse_response(name):
    loop = LOOPS[name]
    radius = np.abs(repetitive.roots(loop)[0])
    n = int(np.log(1e-6) / np.log(radius)) + 40
    impulse = np.eye(1, n)[0]
    run = repetitive.simulate(loop, np.zeros(n), noise=impulse)
    for output in repetitive.OUTPUTS:
        energy = np.sqrt(np.sum(getattr(run, output) ** 2))
        # the energy of the tail left out has the relative size (1e-6)^2
        assert repetitive.noise_gain(loop, output) == pytest.approx(energy, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    "name", ["milling, cascade", "milling with Q, plug-in", "mismatch, cascade"]
)
def test_noise_gain_lies_in_the_confidence_band_of_a_noise_run(name, seed):
    loop, n = LOOPS[name], 100_000
    rng = np.random.default_rng(100 + seed)
    run = repetitive.respond(loop, np.zeros(n), noise=rng.standard_normal(n))
    h = repetitive.simulate(loop, np.zeros(800), noise=np.eye(1, 800)[0]).output
    correlation = np.correlate(h, h, "full")
    # Gaussian: var of the mean square = 2/n sum R^2; a standard deviation has half of it; 4.5 sd
    band = 4.5 * 0.5 * np.sqrt(2 / n * np.sum(correlation**2)) / np.sum(h**2)
    assert band < 0.05
    assert repetitive.noise_gain(loop) == pytest.approx(run.output.std(), rel=band)


def test_noise_gain_of_exact_cancellation_has_the_closed_form():
    """Plant alone: y = -k z^-N/(1 - (1 - k) z^-N) noise, thus k/sqrt(1 - (1 - k)^2)."""
    for gain in (0.2, 0.8, 1.0, 1.5):
        loop = repetitive.design(LAG, 7, gain)
        truth = gain / np.sqrt(1 - (1 - gain) ** 2)
        assert repetitive.noise_gain(loop) == pytest.approx(truth, rel=1e-10)  # rounding


# ---- roots counted from a frequency response ----


def random_loop(seed):
    """A repetitive loop round a stable plant that is not the one it was designed for."""
    rng = np.random.default_rng(seed)
    poles = rng.uniform(-0.85, 0.85, int(rng.integers(1, 4)))
    zeros = rng.choice([-2.0, -1.4, -0.5, 0.3, 0.7, 1.6], int(rng.integers(0, 3)))
    b, delay = rng.uniform(0.5, 2) * np.atleast_1d(np.poly(zeros)), int(rng.integers(1, 4))
    process = Process(Plant(b, np.poly(poles), delay, 1.0))
    q = zdomain.binomial_q(int(rng.integers(0, 3)))
    memory = repetitive.plain(int(rng.integers(9, 40)), q)
    loop = repetitive.design(process, memory, rng.uniform(0.2, 2.4))
    return mismatched(loop, rng.uniform(0.7, 1.4), rng.uniform(-0.05, 0.05))


RANDOM = [loop for loop in map(random_loop, range(60)) if loop.process.plant.is_stable]


def respond(loop):
    return lambda z: zdomain.response(loop.process.plant, z)


def roots_outside(loop):
    """From all roots of the characteristic polynomial, in coefficients and not in responses."""
    return int(np.sum(np.abs(np.roots(repetitive.characteristic_polynomial(loop))) > 1))


def test_unstable_roots_are_those_of_the_characteristic_polynomial():
    found = [repetitive.unstable_roots(loop.repetitive, respond(loop)) for loop in RANDOM]
    assert found == [roots_outside(loop) for loop in RANDOM]
    assert sum(n == 0 for n in found) > 20 and len(set(found)) > 5  # both verdicts, many counts


def test_unstable_roots_follow_the_plant_and_not_the_model():
    """A mutant: the count of the model differs where the mismatch makes the loop unstable."""
    later = [mismatched(loop, 1.3, 0.0, extra_delay=1) for loop in RANDOM]
    found = [repetitive.unstable_roots(loop.repetitive, respond(loop)) for loop in later]
    assert found == [roots_outside(loop) for loop in later]
    assert found != [roots_outside(loop) for loop in RANDOM]


@pytest.mark.parametrize("period", [2, 9, 40, 200])
@pytest.mark.parametrize("gain, count", [(0.5, 0), (1.9, 0), (2.1, 1), (3.5, 1)])
def test_exact_cancellation_has_all_its_roots_outside_from_a_gain_of_two_on(period, gain, count):
    """z^N = 1 - k."""
    rc = RepetitiveController(zdomain.NoncausalFilter([1.0], [1.0], 1), period, gain)
    assert repetitive.unstable_roots(rc, lambda z: 1 / z) == count * period


def test_a_measured_response_between_points_is_good_enough():
    loop = RANDOM[3]
    angle = np.linspace(0, np.pi, 400)
    table = respond(loop)(np.exp(1j * angle))

    def measured(z):
        at = np.abs(np.angle(z))
        return np.interp(at, angle, table.real) + 1j * np.interp(at, angle, table.imag)

    assert repetitive.unstable_roots(loop.repetitive, measured) == roots_outside(loop)


@pytest.mark.parametrize("gain", [2.0, 1e-300])
def test_a_root_on_the_circle_cannot_be_counted(gain):
    rc = RepetitiveController(zdomain.NoncausalFilter([1.0], [1.0], 1), 7, gain)
    with pytest.raises(ValueError, match="passes the origin near"):
        repetitive.unstable_roots(rc, lambda z: 1 / z)


@pytest.mark.parametrize("name", STABLE)
def test_unstable_roots_take_any_memory_and_controller(name):
    loop = STABLE[name]
    if not loop.process.command_path.is_stable:
        return
    for gain in (0.5, 3.0, 9.0):
        strong = loop.with_gain(gain * loop.repetitive.gain)
        count = repetitive.unstable_roots(
            strong.repetitive, lambda z, p=loop.process: zdomain.response(p.command_path, z)
        )
        assert count == roots_outside(strong)


# ---- the factor ----


@pytest.mark.parametrize("name", STABLE)
def test_factor_is_what_is_left_of_a_period(name):
    """z^N (1 - (1 + R G)(1 - H)) with R G round the loop from the blocks, 1 - H from its taps."""
    loop = STABLE[name]
    rc, path = loop.repetitive, loop.process.command_path

    def truth(z):
        left = np.polyval(controller_polynomials(rc)[0][::-1], 1 / z)
        if isinstance(rc, RepetitiveController):
            left /= np.polyval(rc.compensator.a[::-1], 1 / z)
        return z**rc.period * (1 - (1 + controller_response(rc, z) * g(z)) * left)

    def g(z):
        return zdomain.response(path, z)

    for z in zdomain.unit_circle(101, 0.3):
        # R has poles on the circle, at least 1e-3 from these points
        assert repetitive.factor(loop, z) == pytest.approx(truth(z), rel=1e-9, abs=1e-9)
    late, z = replace(loop, process=delayed(loop.process, 1)), np.exp(0.9j)
    assert abs(repetitive.factor(late, z) - truth(z)) > 1e-3


def test_a_factor_below_one_makes_the_loop_stable_and_not_the_other_way_round():
    z = zdomain.unit_circle(4001, 0.5)
    small = [np.abs(repetitive.factor(loop, z)).max() < 1 for loop in RANDOM]
    stable = [repetitive.verdict(loop).verdict == "stable" for loop in RANDOM]
    assert all(s for s, below in zip(stable, small, strict=True) if below)
    assert any(small) and not all(stable)
    # sufficient only: z^2 - z + 1/2 has roots of magnitude 0.71, and |1 - 0.5/z| reaches 1.5
    rc = RepetitiveController(zdomain.NoncausalFilter([1.0], [1.0], 0), 1, 0.5)
    loop = Loop(Plant([1.0], [1.0], 1, 1.0), rc)
    assert np.abs(repetitive.factor(loop, z)).max() == pytest.approx(1.5, rel=1e-6)
    assert repetitive.verdict(loop).verdict == "stable"


@pytest.mark.parametrize("harmonic", [0, 1, 2, 3])
def test_factor_is_what_a_period_leaves_of_a_harmonic(harmonic):
    """The impulse responses of late periods, at a harmonic: each is the factor times the last."""
    loop = mismatched(design(LAG, repetitive.plain(300), 0.8), 1.1, 0.0)
    n = 300 * 8
    w = np.cos(2 * np.pi * harmonic * np.arange(n) / 6)
    error = repetitive.respond(loop, np.zeros(n), disturbance=w).error.reshape(8, 300)
    size = [signals.harmonic(row[-60:], 6, harmonic) for row in error]
    predicted = repetitive.factor(loop, np.exp(2j * np.pi * harmonic / 6))
    # the lag's transient, 0.89 a sample, has died away by the end of a period of 300: 1e-12
    assert size[2] / size[1] == pytest.approx(predicted, abs=1e-6)


@pytest.mark.parametrize("distance", [1e-8, 1e-6, 1e-4, 1e-2])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_cluster_of_roots_next_to_the_circle_is_counted(distance, order):
    """A plant by itself: a multiple pole pair just inside, and just outside, of the circle."""
    for side, count in ((-1, 0), (1, 2 * order)):
        pair = (1 + side * distance) * np.exp([1j, -1j])
        found = repetitive.verdict(Plant([1.0], np.poly(np.tile(pair, order)).real, 1, 1.0))
        if distance**order < 1e-9:
            assert found.verdict == "undecided" or found.outside == count
        else:
            assert found.outside == count


# ---- mismatch, and what is put in place of a loop ----


def test_mismatch_is_the_ratio_of_the_machine_to_its_model():
    z = zdomain.unit_circle(31, 0.4)
    loop = design(MILLING, 6, 0.8)
    assert loop.model is loop.process
    np.testing.assert_allclose(repetitive.mismatch(loop, z), 0, atol=1e-15)
    other = mismatched(loop, 1.3, 0.02)
    g, k = other.process.plant.to_control(), PI.to_control()
    model = control.feedback(MILL.to_control() * k)(z)
    truth = control.feedback(g * k)(z) / model - 1
    np.testing.assert_allclose(repetitive.mismatch(other, z), truth, rtol=1e-9)
    assert not repetitive.mismatch(Loop(MILLING), z).any()
    # the factor follows: q (1 - k C G) = q (1 - k C G_model (1 + mismatch)), C G_model = z^0 |B-|^2
    expected = 1 - 0.8 * (1 + repetitive.mismatch(other, z))
    np.testing.assert_allclose(repetitive.factor(other, z), expected, rtol=1e-9)


@pytest.mark.parametrize("system", [LAG, LAG.plant], ids=["process", "plant"])
def test_a_bare_plant_needs_no_wrapping(system):
    wrapped = Loop(LAG)
    r, w, noise = records(40)
    for verb in (repetitive.simulate, repetitive.respond):
        bare = verb(system, r, disturbance=w, noise=noise)
        assert np.array_equal(bare.output, verb(wrapped, r, disturbance=w, noise=noise).output)
    steady = repetitive.steady_state(system, r, disturbance=w)
    whole = repetitive.steady_state(wrapped, r, disturbance=w)
    assert np.array_equal(steady.output, whole.output)
    for verb in (
        repetitive.spectral_radius,
        repetitive.noise_gain,
        repetitive.verdict,
        lambda s: repetitive.sensitivity(s, 0.1),
    ):
        assert verb(system) == verb(wrapped)
    assert repetitive.spectral_radius(system) == pytest.approx(np.abs(LAG.plant.poles[0]))
    with pytest.raises(TypeError, match="no plant, process or loop"):
        repetitive.simulate(PI.to_control(), r)


# ---- runs that run away ----


@pytest.mark.parametrize("answer", [repetitive.simulate, repetitive.respond])
def test_a_run_ends_where_a_signal_leaves_its_bound(answer):
    loop = design(MILLING, 6, 2.4)
    r, w, noise = records(1500)
    run = answer(loop, r, disturbance=w, noise=noise)
    n = run.output.size
    assert run.unbounded and n < 1500
    assert {s.size for s in (run.time, run.reference, run.noise, run.command, run.error)} == {n}
    largest = np.abs([run.output, run.command, run.repetitive]).max()
    bound = 1e30 * np.abs([r, w, noise]).max()
    # 1.4 a period and no more than a few times that in a sample
    assert bound / 20 < largest <= bound
    short = answer(loop, r[:n], disturbance=w[:n], noise=noise[:n])
    assert not short.unbounded
    # where a stretch ends, BLAS adds in another order
    np.testing.assert_allclose(short.output, run.output, rtol=1e-12)


def test_a_refusal_is_quick_and_names_gain_and_mend():
    loop = design(MILLING, repetitive.plain(400, Q1), 2.5)
    start = time.perf_counter()
    with pytest.raises(ValueError, match=r"unstable.*gain is 2\.5.*`stable_gains`"):
        repetitive.steady_state(loop, np.zeros(400))
    # some 0.02 s; the roots alone would take 0.5 s and the search of all gains half a minute
    assert time.perf_counter() - start < 0.5


def test_the_verdict_of_a_double_root_on_the_circle_is_undecided():
    """A memory of second order that nothing drives: (1 - z^-6)^2, all of it on the circle."""
    twice = repetitive.several(repetitive.plain(6), repetitive.plain(6))
    rc = RepetitiveController(repetitive.lead(0, 1.0), twice, 1e-300)
    assert repetitive.verdict(Loop(LAG, rc)).verdict == "undecided"


@pytest.mark.parametrize("period", [12, 18, 36])
def test_steady_state_takes_whole_periods(period):
    loop = LOOPS["milling with Q, cascade"]
    r, w = np.random.default_rng(3).standard_normal((2, period))
    y, v, u, _ = circulant_solution(loop, r, w)
    steady = repetitive.steady_state(loop, r, disturbance=w)
    # condition of the periodic equations below 1e5
    for found, truth in ((steady.output, y), (steady.command, v), (steady.repetitive, u)):
        np.testing.assert_allclose(found, truth, atol=1e-10)


# ---- factors on the inner controller ----


@pytest.mark.parametrize("delay", [1, 2])
@pytest.mark.parametrize("alpha", [1.1, 1.5, 1.9])
def test_controller_gains_are_those_of_a_scan(delay, alpha):
    plant = replace(MILL, delay=delay)
    pi = repetitive.pi_controller(0.064, alpha, MILL.dt)
    intervals = repetitive.controller_gains(Process(plant, pi), highest=6.0)
    for factor in np.linspace(0.0137, 5.99, 200):
        scaled = replace(pi, b=factor * pi.b)
        inside = any(low < factor < high for low, high in intervals)
        assert inside == Process(plant, scaled).command_path.is_stable, factor


# ---- searches ----


def test_meeting_gains_are_where_two_poles_of_the_locus_are_one():
    found = repetitive.meeting_gains(MILLING)
    assert found.size >= 3
    for factor in found:
        tuned = Process(MILL, replace(PI, b=factor * PI.b))
        poles = np.sort_complex(np.roots(tuned.command_path.a))
        # a double root splits by the root of rounding
        assert np.abs(np.diff(poles)).min() < 1e-6
        off = Process(MILL, replace(PI, b=1.01 * factor * PI.b))
        assert np.abs(np.diff(np.sort_complex(np.roots(off.command_path.a)))).min() > 1e-4


@pytest.mark.parametrize("seed", SEEDS)
def test_gain_bound_is_where_the_first_value_leaves_the_disc(seed):
    rng = np.random.default_rng(seed)
    g = rng.uniform(0.2, 2, 30) * np.exp(1j * rng.uniform(-1.4, 1.4, 30))
    bound = repetitive.gain_bound(g)
    assert np.abs(1 - bound * g).max() == pytest.approx(1, abs=1e-12)
    assert np.abs(1 - 0.999 * bound * g).max() < 1 < np.abs(1 - 1.001 * bound * g).max()
    assert repetitive.gain_bound([1.0, -0.1]) == 0.0
    assert repetitive.gain_bound([1.0, 1.0]) == 2.0


def test_acceptable_gains_of_a_staircase_have_a_closed_form():
    """20 (1 - (1 - k)^m): within 2 after two turns for |1 - k| <= sqrt(0.1), over by k - 1."""
    loop = design(MILLING, 6, 0.8)

    def fault(run):
        return max(np.abs(run.output[12:] - 20).max() - 2, run.output.max() - 24)

    grid, step = np.arange(0.29, 1.8, 0.02), np.full(60, 20.0)
    low, high = repetitive.acceptable_gains(loop, grid, fault, step)
    # refined to 1e-12; rounding of a run of 60 samples
    assert low == pytest.approx(1 - np.sqrt(0.1), abs=1e-9)
    assert high == pytest.approx(1.2, abs=1e-9)
    with pytest.raises(ValueError, match="0 ends of a range among 2 gains"):
        repetitive.acceptable_gains(loop, [0.9, 1.0], fault, step)


def test_swings_are_half_ranges_of_the_last_windows():
    r = np.full(60, 20.0)
    run = repetitive.respond(design(MILLING, 6, 0.8), r, disturbance=np.sin(np.arange(60)))
    found = repetitive.swings(run, 12, 3)
    truth = [(y.max() - y.min()) / 2 for y in (run.output[24:36], run.output[36:48])]
    assert found[:2].tolist() == truth and found.size == 3
    with pytest.raises(ValueError, match="60 samples hold no 6 windows of 12"):
        repetitive.swings(run, 12, 6)
    away = repetitive.simulate(design(MILLING, 6, 2.6), np.full(900, 20.0))
    assert away.unbounded and repetitive.swings(away, 12, 2).tolist() == [np.inf, np.inf]
