"""Periodic loops by several routes: definition, matrices, closed forms, and each other."""

import re
from dataclasses import replace
from importlib import import_module

import control
import numpy as np
import pytest
import scipy.signal
from oracles.periodic import (
    BAR,
    bar_intervals,
    bar_loop,
    by_definition,
    closed_form_modes,
    embeddings,
    held_one_by_one,
    inverted_one_by_one,
    matrix_by_definition,
    output_when_late,
    sizes,
    stationary_variance,
    window_of_k,
)
from oracles.zdomain import held_in_decimals

from rcbook import zdomain
from rcbook.loops import periodic
from rcbook.loops.periodic import (
    Compensator,
    Limit,
    Limits,
    Memory,
    PeriodicLoop,
    PeriodicPlant,
    odd_harmonic,
    plain,
    several,
)

noise = import_module("rcbook.loops.periodic.noise")
Q20 = zdomain.symmetric_fir([0.8, 0.1])
Q21 = zdomain.binomial_q()
SEEDS = range(4)
each_seed = pytest.mark.parametrize("seed", SEEDS)
MEMORIES = {  # of a loop of n samples with a plain memory
    "its own": lambda memory, n: memory,
    "twice": lambda memory, n: several(memory, memory),
    "odd harmonics of two periods": lambda memory, n: odd_harmonic(2 * n, Q20),
    "no whole period": lambda memory, n: plain(n - 0.3),
    "within the period": lambda memory, n: plain(4),
}
each_memory = pytest.mark.parametrize("kind", MEMORIES)


def random_loop(seed, n=None, gain=0.6):
    """A loop of no particular merit: random plant, taps, advance, and a q without symmetry."""
    rng = np.random.default_rng(seed)
    order, half = int(rng.integers(1, 4)), int(rng.integers(0, 3))
    n = int(rng.integers(9, 20)) if n is None else n
    system = control.ss(
        np.diag(-rng.uniform(0.5, 3, order)) + np.triu(rng.standard_normal((order, order)), 1),
        rng.standard_normal((order, 1)),
        rng.standard_normal((1, order)),
        0,
    )
    plant = periodic.sample(system, rng.uniform(0.1, 1.5, n))
    taps, advance = rng.standard_normal((n, int(rng.integers(1, 6)))), int(rng.integers(1, 4))
    q = rng.uniform(0, 1, 2 * half + 1)
    return PeriodicLoop(plant, Compensator(taps, advance), Memory(q / q.sum(), n - half, n), gain)


def remembering(loop, kind):
    return replace(loop, memory=MEMORIES[kind](loop.memory, loop.period))


def in_order(signal):
    """A dictionary of time as a row from time 0 on."""
    return np.array([signal[k] for k in range(max(signal) + 1)])


def solved(run):
    return run.output, run.command


# ---- the definition, sample by sample ----


@each_seed
@each_memory
@pytest.mark.parametrize("n", [None, 7])  # 7: shorter than what some loops remember of u
def test_one_period_map_is_the_recursion(seed, kind, n):
    loop = remembering(random_loop(seed, n), kind)
    expected = matrix_by_definition(loop)
    operator = periodic.one_period_map(loop)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(periodic.dense(loop), expected, atol=1e-12 * scale)
    np.testing.assert_allclose(
        operator.rmatmat(np.eye(len(expected))), expected.T, atol=1e-12 * scale
    )
    vector = np.random.default_rng(seed).standard_normal(len(expected))
    np.testing.assert_allclose(operator @ vector, expected @ vector, atol=1e-11 * scale)
    np.testing.assert_allclose(operator.T @ vector, expected.T @ vector, atol=1e-11 * scale)


@each_seed
@each_memory
def test_simulation_is_the_recursion(seed, kind):
    loop = remembering(random_loop(seed, gain=0.1), kind)
    r, d, noise = np.random.default_rng(seed).standard_normal((3, 5 * loop.period + 3))
    *_, v, y = by_definition(loop, r - noise, disturbance=d)
    run = periodic.simulate(loop, r, disturbance=d, noise=noise)
    assert not run.unbounded
    assert run.command_clipped == run.repetitive_clipped == 0
    for found, expected in zip(solved(run), (y, in_order(v)), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_array_equal(run.repetitive, run.command)
    np.testing.assert_array_equal(run.error, r - run.output)
    np.testing.assert_array_equal(run.measured_error, r - run.output - noise)
    np.testing.assert_array_equal(run.disturbance, d)
    assert run.time[0] == 0
    np.testing.assert_allclose(
        np.diff(run.time), np.resize(loop.plant.intervals, r.size)[:-1], rtol=1e-9
    )


@pytest.mark.parametrize("remember", [True, False])
@pytest.mark.parametrize("kind", ["command", "repetitive"])
def test_limits_clip_sample_by_sample(kind, remember):
    """Half of what the free run reaches; the memory goes on from the clipped u, or from u."""
    loop = random_loop(3, gain=0.1)
    r, d = np.random.default_rng(1).standard_normal((2, 6 * loop.period))
    free = periodic.simulate(loop, r, disturbance=d)
    limited = {"repetitive": 1, "command": 3}[kind]  # u or v
    largest = np.abs(in_order(by_definition(loop, r, disturbance=d)[limited])).max()
    limit = Limit(0.5 * largest, remember)
    _, u, _, v, y = by_definition(loop, r, disturbance=d, **{kind: limit})
    run = periodic.simulate(loop, r, disturbance=d, limits=Limits(**{kind: limit}))
    for found, expected in zip(solved(run), (y, in_order(v)), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
    met = np.sum(np.abs(in_order((u, v)[kind == "command"])) == limit.value)
    clipped = {"command": run.command_clipped, "repetitive": run.repetitive_clipped}
    assert clipped.pop(kind) == met > 3
    asked = np.clip(run.repetitive, -limit.value, limit.value) if kind == "command" else run.command
    np.testing.assert_array_equal(run.repetitive if kind == "repetitive" else run.command, asked)
    assert list(clipped.values()) == [0]
    assert np.abs(run.output - free.output).max() > 1e-3


def test_a_limit_that_is_never_met_changes_nothing():
    loop, r = random_loop(1, gain=0.1), np.random.default_rng(1).standard_normal(50)
    free = periodic.simulate(loop, r)
    far = periodic.simulate(loop, r, limits=Limits(command=Limit(1e6), repetitive=Limit(1e6)))
    np.testing.assert_allclose(far.output, free.output, atol=1e-13 * np.abs(free.output).max())


# ---- plants ----


def test_every_interval_is_a_zero_order_hold():
    """Markov parameters against scipy, sample by sample; scipy gets the bar with time in 50 us,
    because its companion form in seconds has a condition of 1e29."""
    intervals = bar_intervals(16, 0.8)
    plant = periodic.sample(BAR.plant, intervals)
    unit = 50e-6
    roots = np.linalg.eigvals(control.ss(BAR.plant).A)
    companion = scipy.signal.zpk2ss([], roots * unit, np.prod(-roots * unit).real)
    for k, interval in enumerate(intervals):
        a, b, c, *_ = scipy.signal.cont2discrete(companion, interval / unit, "zoh")
        ours = [plant.c @ np.linalg.matrix_power(plant.a[k], j) @ plant.b[k] for j in range(12)]
        theirs = [(c @ np.linalg.matrix_power(a, j) @ b).real.item() for j in range(12)]
        np.testing.assert_allclose(ours, theirs, atol=1e-11)


def test_one_state_serves_all_intervals():
    """A long hold is two shorter ones: e^(A (s+t)) = e^(A s) e^(A t).  A realisation made anew
    for each interval would break this."""
    plant = periodic.sample(BAR.plant, [100e-6, 150e-6, 250e-6])
    np.testing.assert_allclose(plant.a[2], plant.a[1] @ plant.a[0], atol=1e-12)
    np.testing.assert_allclose(plant.b[2], plant.a[1] @ plant.b[0] + plant.b[1], atol=1e-12)


LAG = control.ss(control.tf([1.0], np.poly([-1.0, -1.0, -1.0])))


def test_ten_thousand_different_intervals_are_held_as_one_at_a_time():
    intervals = BAR.sampling_interval * np.random.default_rng(0).uniform(0.1, 2.0, 10_000)
    plant = periodic.sample(BAR.plant, intervals)
    a, b = held_one_by_one(BAR.plant, intervals[::100])
    # a hundred roundings where the norm of a T is a hundred, of entries up to one
    np.testing.assert_allclose(plant.a[::100], a, atol=1e-13)
    np.testing.assert_allclose(plant.b[::100], b, atol=1e-13)


def test_equal_intervals_have_equal_plants():
    """To the last bit: what is at constant intervals is seen to be so."""
    plant = periodic.sample(BAR.plant, np.tile([250e-6, 260e-6, 250e-6], 200))
    assert np.all(plant.a[::3] == plant.a[2]) and np.all(plant.b[::3] == plant.b[2])


@pytest.mark.parametrize("share", [0.01, 0.3, 1.0])
@pytest.mark.parametrize("system", [BAR.plant, LAG * 2.0], ids=["bar", "lag"])
def test_a_late_input_acts_from_when_it_comes(system, share):
    """Delays of a part of an interval, of several, and of the whole period; intervals unlike."""
    unit = BAR.sampling_interval if system is BAR.plant else 0.3
    rng = np.random.default_rng(1)
    intervals, command = unit * rng.uniform(0.2, 2.0, 11), rng.standard_normal(40)
    delay = share * intervals.sum()
    plant = periodic.sample(system, intervals, delay)
    x, found = np.zeros(plant.order), []
    for k, v in enumerate(command):
        found.append(plant.c @ x)
        x = plant.a[k % 11] @ x + plant.b[k % 11] * v
    expected = output_when_late(system, intervals, delay, command)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


# ---- compensators ----


def test_rows_of_taps_are_used_when_they_say():
    rows = 10.0 * np.arange(5)[:, None] + np.arange(3)
    designed = Compensator(rows, 2)
    for k in range(5):
        for j in range(3):
            assert designed.by_input_time().taps[k, j] == rows[(k - j) % 5, j]
            assert designed.shifted(-1).taps[k, j] == rows[k - 1, j]
            assert designed.shifted(2).taps[k, j] == rows[(k + 2) % 5, j]


@pytest.mark.parametrize("gamma", [0.0, 0.5, 0.8])
def test_zero_phase_design_makes_every_frozen_plant_real_and_not_negative(gamma):
    loop = bar_loop(12, gamma)
    z = zdomain.unit_circle(64)
    gain = 1 - periodic.factor(loop, z)
    assert loop.advance == 6
    assert loop.compensator.taps.shape == (12, 12)
    for k, interval in enumerate(loop.plant.intervals):
        b = zdomain.zero_order_hold(periodic.balanced(BAR.plant), interval).b
        expected = np.abs(zdomain.evaluate(b, z)) ** 2 / np.abs(b).sum() ** 2
        np.testing.assert_allclose(gain[k], expected, atol=1e-9)
    late = replace(loop, compensator=replace(loop.compensator, advance=5))
    assert np.abs((1 - periodic.factor(late, z)).imag).max() > 0.5


@pytest.mark.parametrize("system", [BAR.plant, LAG], ids=["bar", "lag"])
def test_zero_phase_taps_are_those_of_one_interval_at_a_time(system):
    unit = BAR.sampling_interval if system is BAR.plant else 0.3
    intervals = unit * np.random.default_rng(2).uniform(0.2, 2.0, 10_000)
    compensator = periodic.zero_phase(system, intervals)
    expected = inverted_one_by_one(system, intervals[::200])
    rows = np.abs(expected).max(axis=1, keepdims=True)
    assert compensator.advance == system.nstates
    np.testing.assert_allclose(compensator.taps[::200] / rows, expected / rows, atol=1e-12)


def test_zero_phase_taps_have_twelve_digits_of_a_computation_in_80():
    """A fiftieth to eight times the nominal interval; each row to 1e-12 of its largest tap."""
    intervals = BAR.sampling_interval * np.geomspace(0.02, 8, 7)
    found = periodic.zero_phase(BAR.plant, intervals).taps
    for k, interval in enumerate(intervals):
        _, b, a = held_in_decimals(periodic.balanced(BAR.plant), interval)
        expected = np.convolve(a, b[:0:-1]) / np.abs(b).sum() ** 2
        np.testing.assert_allclose(found[k], expected, atol=1e-12 * np.abs(expected).max())


def test_scale_of_the_plant_does_not_matter():
    intervals = bar_intervals(10, 0.3)
    plain = periodic.zero_phase(BAR.plant, intervals)
    scaled = periodic.zero_phase(BAR.plant * 1e-7, intervals)
    np.testing.assert_allclose(scaled.taps * 1e-7, plain.taps, atol=1e-11 * plain.taps.max())


@each_seed
@pytest.mark.parametrize("frozen", [False, True])
def test_least_squares_solves_the_whole_problem(seed, frozen):
    """All N m taps at once in one large least-squares problem, its matrix from unit impulses that
    are run through the plant one by one."""
    loop, taps, advance, horizon = random_loop(seed, 9), 4, 2, 25
    plant, n = loop.plant, loop.period

    def answer(at, entered):
        """Output from `at` on to an impulse of sample `at`; frozen at `entered` if asked."""
        x, out = np.zeros(plant.order), np.zeros(at - entered + horizon + 1)
        for k in range(at, entered + horizon + 1):
            i = (entered if frozen else k) % n
            out[k - entered] = plant.c @ x
            x = plant.a[i] @ x + plant.b[i] * (k == at)
        return out[: horizon + 1]

    matrix, wanted = np.zeros((n * (horizon + 1), n * taps)), np.zeros(n * (horizon + 1))
    for k in range(n):
        rows = slice(k * (horizon + 1), (k + 1) * (horizon + 1))
        wanted[rows][advance] = 1.0
        for j in range(taps):
            used_at = k if frozen else (k + j) % n
            matrix[rows, used_at * taps + j] += answer(k + j, k)
    expected = np.linalg.lstsq(matrix, wanted, rcond=None)[0].reshape(n, taps)
    found, other = (
        periodic.least_squares(plant, taps, advance, horizon, frozen, at_output=at_output)
        for at_output in (frozen, not frozen)
    )
    np.testing.assert_allclose(found.taps, expected, atol=1e-9 * np.abs(expected).max())
    if not frozen:  # the other reading is another filter
        assert np.abs(other.taps - expected).max() > 1e-3 * np.abs(expected).max()


# ---- the two lifted routes of the paper ----


@each_seed
def test_product_of_matrices_is_the_one_period_map(seed):
    loop = random_loop(seed)
    into, _ = embeddings(loop)
    matrix, expected = periodic.product_of_matrices(loop), matrix_by_definition(loop)
    half, filter = loop.memory.taps.size // 2, loop.compensator.taps.shape[1] - 1
    assert len(matrix) == loop.period + half + loop.plant.order + filter
    np.testing.assert_allclose(matrix @ into, into @ expected, atol=1e-11 * np.abs(expected).max())


@each_seed
def test_appendix_is_the_one_period_map_and_wrong_readings_are_not(seed):
    loop = replace(random_loop(seed), memory=None)
    _, into = embeddings(loop)
    expected = into @ matrix_by_definition(loop)
    tolerance = 1e-11 * np.abs(expected).max()
    matrix = periodic.lifted(loop)
    np.testing.assert_allclose(matrix @ into, expected, atol=tolerance)
    a, b, *_ = periodic.lift(loop)
    states = len(a)
    slips = {"A of the last sample": matrix.copy(), "B without its minus": matrix.copy()}
    last = periodic.closed_loop_matrix(loop, loop.period - 1)[-states:, -states:]
    slips["A of the last sample"][:states, :states] = last
    slips["B without its minus"][:states, states:] = -b
    for slipped in slips.values():
        assert np.abs(slipped @ into - expected).max() > 1e4 * tolerance


def test_both_routes_have_the_same_spectrum_on_the_boring_bar():
    """Eigenvalues of the three matrices of N = 32; those beyond 1e-3 are simple enough to be
    matched one by one to 1e-9."""
    loop = bar_loop(32, 0.4)
    spectra = [
        np.linalg.eigvals(matrix)
        for matrix in (
            periodic.dense(loop),
            periodic.product_of_matrices(loop),
            periodic.lifted(loop),
        )
    ]
    spectra = [values[np.abs(values) > 1e-3] for values in spectra]
    assert len({values.size for values in spectra}) == 1
    for other in spectra[1:]:
        assert np.abs(spectra[0][:, None] - other).min(axis=1).max() < 1e-9
    assert len(periodic.product_of_matrices(loop)) == 32 + 6 + 11


def test_lift_has_the_blocks_of_a5_and_a6():
    """First rows of C and D written out as printed, with C_2(0) for C(0)."""
    loop = random_loop(1)
    filter, n = loop.compensator.taps.shape[1] - 1, loop.plant.order
    _, _, c, d = periodic.lift(loop)
    inner = [periodic.closed_loop_matrix(loop, k) for k in (0, 1)]
    a0 = inner[0][-(filter + n) :, -(filter + n) :]
    row = np.concatenate([np.zeros(filter), loop.plant.c])
    b0 = np.concatenate([np.eye(max(filter, 1))[0][:filter], loop.plant.b[0] * loop.taps[0, 0]])
    np.testing.assert_allclose(c[0], row, atol=1e-14)
    np.testing.assert_allclose(c[1], row @ a0, atol=1e-13)
    np.testing.assert_allclose(d[1, 0], row @ b0, atol=1e-13)
    assert np.all(np.triu(d) == 0)


# ---- counting multipliers ----


@pytest.mark.parametrize("seed", range(12))
def test_count_is_that_of_the_dense_eigenvalues(seed):
    rng = np.random.default_rng(100 + seed)
    loop = random_loop(seed, gain=rng.uniform(0.1, 1.0))
    sizes_ = np.abs(np.linalg.eigvals(matrix_by_definition(loop)))
    for radius in (1.0, 0.5 * sizes_.max(), 0.9 * sizes_.max(), 1.1 * sizes_.max()):
        found = periodic.count_outside(loop, radius)
        assert found.outside == np.sum(sizes_ > radius), found


@pytest.mark.parametrize(
    ("n", "gamma", "design", "q"),
    [
        (32, 0.3, "scheduled", (1.0,)),
        (32, 0.9, "scheduled", (1.0,)),
        (32, 0.5, "nominal", Q20),
        (96, 0.6, "scheduled", Q20),
        (256, 0.3, "scheduled", (1.0,)),
    ],
)
def test_bracket_holds_the_dense_spectral_radius(n, gamma, design, q):
    loop = bar_loop(n, gamma, design, q)
    low, high = periodic.radius_bounds(loop, 0.05)
    dense = periodic.spectral_radius(loop)
    assert low <= dense <= high <= low + 0.05


@pytest.mark.parametrize("gamma", [0.4, 0.5, 0.7])
def test_count_finds_the_multipliers_of_an_unstable_design(gamma):
    loop = bar_loop(64, gamma, "nominal")
    expected = int(np.sum(np.abs(np.linalg.eigvals(periodic.product_of_matrices(loop))) > 1))
    assert expected > 4
    assert periodic.count_outside(loop).outside == expected


def test_the_map_has_the_closed_form_multipliers_of_a_time_invariant_loop():
    """N = 1e5: u(k) = z^k and what follows from it come back z^N times as large."""
    n, gain = 100_000, 0.7
    loop = bar_loop(n, 0.0, q=Q20, gain=gain)
    modes, multipliers = closed_form_modes(n, gain, Q20)
    operator = periodic.one_period_map(loop)
    order, reach, memory = sizes(loop)
    for z, multiplier in zip(modes[[1, 5000, 30_000]], multipliers[[1, 5000, 30_000]], strict=True):
        v = zdomain.evaluate(loop.taps[0], z)
        x = np.linalg.solve(z * np.eye(order) - loop.plant.a[0], loop.plant.b[0] * v)
        w = (z**-6.0 - loop.plant.c @ x) * z ** np.arange(-memory, 0.0)
        state = np.concatenate([x, z ** np.arange(-reach, 0.0), w])
        error = operator.matvec(state.real) + 1j * operator.matvec(state.imag) - multiplier * state
        # z^k over 1e5 samples is good to 1e5 roundings
        assert np.abs(error).max() < 1e-10 * np.abs(state).max()


def test_count_is_that_of_the_closed_form_at_long_periods():
    """gain 2.2 puts the modes with |B|^2/b above 1/1.1 outside: some eighty at N = 500."""
    n, gain = 500, 2.2
    loop = bar_loop(n, 0.0, gain=gain)
    outside = np.sum(np.abs(closed_form_modes(n, gain, np.ones(1))[1]) > 1)
    assert outside > 50
    assert periodic.count_outside(loop).outside == outside
    assert periodic.verdict(loop).verdict == "unstable"
    assert periodic.verdict(bar_loop(n, 0.0, gain=1.95)).verdict == "stable"


# ---- bounds ----


def test_energy_gain_of_a_time_invariant_loop_is_the_peak_of_its_symbol():
    for gain, q in ((0.7, (1.0,)), (1.9, Q20), (2.4, Q21)):
        loop = bar_loop(9, 0.0, q=q, gain=gain)
        peak = np.abs(periodic.factor(loop, zdomain.unit_circle(4000))[0]).max()
        bound = periodic.energy_gain(loop, 1e-3)
        assert peak <= bound <= peak + 1.1e-3


@each_seed
def test_energy_and_absolute_gain_are_the_norms_of_k(seed):
    """A window of eight periods: its largest singular value is below the norm and close to it;
    its largest row sum, away from the edge, is the absolute gain."""
    loop = random_loop(seed, 10, gain=0.2)
    window = window_of_k(loop, 80, 100)
    below = np.linalg.norm(window, 2)
    assert below * (1 - 1e-9) <= periodic.energy_gain(loop, 1e-3) <= 1.03 * below + 1e-3
    sums = np.abs(window).sum(axis=1)[9 + 50 : 9 + 70]
    assert periodic.absolute_gain(loop) == pytest.approx(sums.max(), rel=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_what_a_bound_calls_stable_is_stable(seed):
    loop = random_loop(seed, gain=np.random.default_rng(seed).uniform(0.02, 0.4))
    radius = np.abs(np.linalg.eigvals(matrix_by_definition(loop))).max()
    if min(periodic.energy_gain(loop, 0.01), periodic.absolute_gain(loop)) < 1:
        assert radius < 1
    assert periodic.verdict(loop).verdict == ("stable" if radius < 1 else "unstable")


def test_a_loop_that_rounding_decides_is_undecided():
    """The nominal design at gamma = 0.5: what its dense matrix of N = 512 has as eigenvalues, its
    transpose has not, because the powers grow beyond 1e9 in 20 periods."""
    loop = bar_loop(512, 0.5, "nominal")
    found = periodic.verdict(loop)
    assert (found.verdict, found.outside) == ("undecided", None)
    assert "undecided (count: " in str(found)
    matrix = periodic.dense(loop)
    ours, theirs = (np.linalg.eigvals(m) for m in (matrix, matrix.T))
    assert np.abs(ours[:, None] - theirs).min(axis=1).max() > 1e-3
    assert periodic.transient_growth(loop, [20], 3)[0] > 1e9


def test_verdicts_tell_their_grounds():
    assert periodic.verdict(bar_loop(64, 0.3)).method == "energy"
    counted = periodic.verdict(bar_loop(64, 0.15, "nominal"))
    assert (counted.verdict, counted.method, counted.outside) == ("stable", "count", 0)
    assert "points of the half circle" in counted.certificate
    assert periodic.verdict(bar_loop(48, 0.5, "nominal")).outside > 0


def test_a_plant_that_grows_unseen_is_not_called_stable():
    """A mode e^(0.1 t) that the input does not reach and the output does not show."""
    hidden = control.ss(np.diag([-1.0, 0.1]), [[1.0], [0.0]], [[1.0, 0.0]], 0)
    plant = periodic.sample(hidden, np.full(9, 0.5))
    loop = PeriodicLoop(plant, Compensator(np.full((9, 1), 0.5), 1))
    assert periodic.energy_gain(loop) < 1
    found = periodic.verdict(loop)
    assert (found.verdict, found.method, found.outside) == ("unstable", "count", 1)


# ---- verdicts with other memories ----


@pytest.mark.parametrize("seed", range(8))
@each_memory
def test_the_verdict_is_that_of_the_multipliers_of_the_definition(seed, kind):
    loop = remembering(random_loop(seed, gain=0.3), kind)
    radius = np.abs(np.linalg.eigvals(matrix_by_definition(loop))).max()
    found = periodic.verdict(loop)
    assert found.verdict == ("stable" if radius < 1 else "unstable"), found
    assert (found.method == "multipliers") == (kind != "its own")
    assert periodic.spectral_radius(loop) == pytest.approx(radius, rel=1e-6)


def test_multipliers_that_rounding_moves_across_the_circle_decide_nothing():
    """Without compensator a memory of second order has each of its multipliers, 1, twice: one
    Jordan block of two, of which rounding by 1e-16 makes 1 +- 1e-8."""
    loop = replace(remembering(bar_loop(24, 0.3), "twice"), gain=0.0)
    found = periodic.verdict(loop)
    assert (found.verdict, found.method, found.outside) == ("undecided", "multipliers", None)
    assert "moved by up to" in found.certificate
    with pytest.raises(ValueError, match="undecided"):
        periodic.steady_state(loop, np.ones(24))


def test_only_a_memory_of_one_period_has_a_window():
    loop = remembering(LOOP, "twice")
    for judge in (periodic.count_outside, periodic.energy_gain, periodic.absolute_gain):
        with pytest.raises(ValueError, match=r"only q z\^-N with N = 12 .* ask `verdict`"):
            judge(loop)


# ---- companions ----


def test_growth_is_the_norm_of_the_powers():
    loop = bar_loop(32, 0.45, "nominal")
    order, reach, _ = sizes(loop)
    matrix = matrix_by_definition(loop)
    for j, found in zip((1, 3, 8), periodic.transient_growth(loop, [1, 3, 8], 60), strict=True):
        power = np.linalg.matrix_power(matrix, j)[order + reach :, order + reach :]
        assert found == pytest.approx(np.linalg.norm(power, 2), rel=1e-3)
        assert found <= np.linalg.norm(power, 2) * (1 + 1e-12)


STABLE = {  # a loop of 18 samples; "within the period" remembers a third of it
    "its own": lambda loop: loop,
    "twice": lambda loop: replace(loop, memory=several(loop.memory, loop.memory), gain=0.8),
    "odd harmonics of two periods": lambda loop: replace(loop, memory=odd_harmonic(36, Q20)),
    "no whole period": lambda loop: replace(loop, memory=plain(17.7, Q20)),
    "within the period": lambda loop: replace(loop, memory=plain(9, Q20)),
}
each_stable = pytest.mark.parametrize("kind", STABLE)


@pytest.mark.parametrize("source", periodic.SOURCES)
@pytest.mark.parametrize("output", periodic.OUTPUTS)
def test_noise_gain_solves_the_lyapunov_equation(output, source):
    loop = bar_loop(18, 0.3, q=Q20)
    expected = stationary_variance(loop, output, source)
    assert periodic.noise_gain(loop, output, source) ** 2 == pytest.approx(expected, rel=1e-9)


@each_stable
def test_noise_gain_with_each_memory(kind):
    loop = STABLE[kind](bar_loop(18, 0.3, q=Q20))
    expected = stationary_variance(loop, "error", "disturbance")
    found = periodic.noise_gain(loop, "error", "disturbance") ** 2
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("source", periodic.SOURCES)
@pytest.mark.parametrize("output", periodic.OUTPUTS)
def test_noise_that_is_followed_is_noise_that_is_summed(output, source, monkeypatch):
    """A long period is followed sample by sample; told that it is short, it is summed by doubling.
    What is dropped is 1e-18 of the power."""
    loop = bar_loop(320, 0.3, q=Q20)
    followed = periodic.noise_gain(loop, output, source)
    monkeypatch.setattr(noise, "_LONG", 400)
    assert followed == pytest.approx(periodic.noise_gain(loop, output, source), rel=1e-10)


@pytest.mark.parametrize("kind", [kind for kind in STABLE if kind != "twice"])
def test_noise_is_followed_through_each_memory(kind, monkeypatch):
    """Not through a memory of second order, where it first grows and so is summed."""
    loop = STABLE[kind](bar_loop(18, 0.3, q=Q20))
    expected = stationary_variance(loop, "command", "noise")
    monkeypatch.setattr(noise, "_LONG", 10)
    monkeypatch.setattr(noise, "_doubled", lambda *_: np.nan)
    assert periodic.noise_gain(loop, "command") ** 2 == pytest.approx(expected, rel=1e-9)


def test_noise_that_grows_before_it_decays_is_summed(monkeypatch):
    """What is dropped would grow as well: by 1e3 here in some fifteen periods."""
    loop = bar_loop(360, 0.25, "nominal", Q20)
    found = periodic.noise_gain(loop)
    assert found > 10
    monkeypatch.setattr(noise, "_LONG", 1000)
    assert periodic.noise_gain(loop) == found  # the same way, to the last digit


def test_what_is_too_long_to_be_summed_is_refused(monkeypatch):
    monkeypatch.setattr(noise, "_LONGEST", 30)
    with pytest.raises(ValueError, match="period 32: too long for dense matrices; simulate"):
        periodic.noise_gain(bar_loop(32, 0.3))


def test_noise_gain_is_what_a_long_run_shows():
    """4e5 samples of a standard deviation are good to about 0.5 %, times three."""
    loop = bar_loop(40, 0.5, q=Q20)
    noise = np.random.default_rng(5).standard_normal(40 * 10_000)
    run = periodic.simulate(loop, np.zeros(noise.size), noise=noise)
    assert np.std(run.output[4000:]) == pytest.approx(periodic.noise_gain(loop), rel=0.015)


def test_steady_state_is_what_a_run_tends_to():
    for q in ((1.0,), Q20):
        loop = bar_loop(40, 0.4, q=q)
        reference = BAR.reference(3, 40)
        run = periodic.simulate(loop, np.tile(reference, 900))
        steady = periodic.steady_state(loop, reference)
        for ours, theirs in zip(solved(steady), solved(run), strict=True):
            np.testing.assert_allclose(ours, theirs[-40:], atol=1e-9 * np.abs(theirs).max())
        # without q the error vanishes; with it a known part of it stays
        assert (np.abs(steady.error).max() < 1e-12 * BAR.amplitude) == (len(q) == 1)


@each_stable
@pytest.mark.parametrize("periods", [1, 3])
def test_steady_state_with_each_memory(kind, periods):
    """A reference and a disturbance of one period, and of three that differ."""
    loop = STABLE[kind](bar_loop(18, 0.3, q=Q20))
    r, d = np.random.default_rng(2).standard_normal((2, 18 * periods))
    run = periodic.simulate(loop, np.tile(r, 120), disturbance=np.tile(d, 120))
    steady = periodic.steady_state(loop, r, disturbance=d)
    for ours, theirs in zip(solved(steady), solved(run), strict=True):
        np.testing.assert_allclose(ours, theirs[-r.size :], atol=1e-9 * np.abs(theirs).max())
    np.testing.assert_allclose(steady.time, run.time[: r.size])
    np.testing.assert_array_equal(steady.error, r - steady.output)


def test_what_is_not_stable_has_no_steady_state():
    with pytest.raises(
        ValueError, match=r"the loop is unstable \(count: .*no steady state; choose"
    ):
        periodic.steady_state(bar_loop(32, 0.9), np.ones(32))
    with pytest.raises(ValueError, match="the loop is undecided"):
        periodic.steady_state(bar_loop(512, 0.5, "nominal"), np.ones(512))


def test_an_unstable_run_stops_and_says_so():
    loop = bar_loop(32, 0.9)
    reference = np.tile(BAR.reference(2, 32), 600)
    run = periodic.simulate(loop, reference)
    assert run.unbounded
    assert 32 < run.output.size == run.error.size == run.time.size < reference.size
    assert np.abs(solved(run)).max() <= 1e30 * BAR.amplitude
    limited = periodic.simulate(loop, reference, limits=Limits(command=Limit(1e40)))
    assert limited.output.size == run.output.size
    held = periodic.simulate(loop, reference, limits=Limits(Limit(2 * BAR.amplitude)))
    assert not held.unbounded


def test_factor_is_the_response_of_a_lasting_sample():
    loop = random_loop(2)
    z = zdomain.unit_circle(12)
    for k in range(loop.period):
        single = PeriodicLoop(
            PeriodicPlant(
                *(np.repeat(part[k : k + 1], 12, axis=0) for part in (loop.plant.a, loop.plant.b)),
                loop.plant.c,
                np.ones(12),
            ),
            Compensator(np.repeat(loop.compensator.taps[k : k + 1], 12, axis=0), loop.advance),
            Memory(loop.memory.taps, 12 - loop.memory.taps.size // 2, 12),
            loop.gain,
        )
        kernel = window_of_k(single, 1, 3000)[:, 0]
        expected = [np.sum(kernel * point ** -np.arange(-9.0, kernel.size - 9)) for point in z]
        np.testing.assert_allclose(periodic.factor(loop, z)[k], expected, atol=1e-9)


# ---- searches ----


def test_the_frozen_gain_bound_is_where_a_long_loop_turns_unstable():
    """At N = 96 the lowest mode lies at pi/N, where g is one within 1e-3; scaled taps scale it."""
    loop = bar_loop(96, 0.0)
    limit = periodic.frozen_gain_bound(loop)
    assert limit == pytest.approx(2.0, rel=1e-9)  # all b are positive: g(1) = 1
    assert periodic.verdict(replace(loop, gain=0.999 * limit)).verdict == "stable"
    assert periodic.verdict(replace(loop, gain=1.01 * limit)).verdict == "unstable"
    halved = replace(loop.compensator, taps=loop.compensator.taps / 2)
    assert periodic.frozen_gain_bound(replace(loop, compensator=halved)) == pytest.approx(2 * limit)
    late = replace(loop.compensator, advance=loop.advance - 1)
    assert periodic.frozen_gain_bound(replace(loop, compensator=late)) == 0.0


def test_at_a_vanishing_interval_a_zero_is_minus_one():
    found = periodic.vanishing_intervals(BAR.plant, np.linspace(40e-6, 560e-6, 53))
    assert len(found) == 2
    for interval in found:
        zeros = np.roots(zdomain.zero_order_hold(periodic.balanced(BAR.plant), interval).b)
        assert np.abs(zeros + 1).min() < 1e-8


def test_mismatch_is_the_ratio_of_the_frozen_plants():
    """A stiffer bar on the circle, from its own zero-order holds; without a model there is none."""
    loop, z = bar_loop(12, 0.3), zdomain.unit_circle(8)
    stiffer = replace(BAR, stiffness=1.2 * BAR.stiffness).plant
    moved = replace(loop, plant=periodic.sample(stiffer, loop.plant.intervals), model=loop.plant)
    assert np.all(periodic.mismatch(loop, z) == 0)
    for k, interval in enumerate(loop.plant.intervals):
        ours, theirs = (
            zdomain.response(zdomain.zero_order_hold(periodic.balanced(each), interval), z)
            for each in (stiffer, BAR.plant)
        )
        np.testing.assert_allclose(periodic.mismatch(moved, z)[k], ours / theirs - 1, atol=1e-9)


# ---- bad input ----

LOOP = random_loop(0, 12)
PLANT = LOOP.plant
REFUSED = [
    ("intervals", lambda: periodic.sample(BAR.plant, [1e-4, -1e-4]), r"-0\.0001 s; they must"),
    ("two inputs", lambda: periodic.sample(control.ss(-1, [[1, 1]], 1, 0), [1.0]), "2 inputs"),
    ("lasting", lambda: periodic.zero_phase(control.ss(0, 1, 1, 0), [1.0, 2.0]), "1, .*stabilise"),
    ("growing", lambda: periodic.zero_phase(control.ss(1, 1, 1, 0), [1.0, 2.0]), "2.71.*stabilise"),
    ("deaf", lambda: periodic.zero_phase(control.ss(-1, 0, 1, 0), [1.0, 2.0]), "plant is zero"),
    ("no lag", lambda: periodic.zero_phase(control.ss([], [], [], 2), [1.0]), "advance L = 0"),
    ("stopped", lambda: periodic.zero_phase(BAR.plant, [1e-4, 0.0]), "must be positive"),
    ("direct", lambda: periodic.sample(control.ss(-1, 1, 1, 1), [1.0]), "strictly proper"),
    ("shape of b", lambda: replace(PLANT, b=PLANT.b[1:]), r"b has shape .*fits the others"),
    ("NaN", lambda: replace(PLANT, c=PLANT.c * np.nan), "c holds NaN.*give finite"),
    ("no time", lambda: replace(PLANT, intervals=np.zeros(12)), "must be positive"),
    ("taps", lambda: Compensator([1.0, 2.0], 3), r"shape \(2,\); give a finite row per sample"),
    ("advance", lambda: Compensator([[1.0]], 0), "advance L = 0 must be .* not below 1"),
    ("rows", lambda: replace(LOOP, compensator=Compensator([[1.0]], 1)), "1 rows.*every 12"),
    ("model", lambda: replace(LOOP, model=bar_loop(9, 0).plant), "model repeats every 9 samples"),
    ("far look", lambda: replace(bar_loop(12, 0), memory=5), "of 5 cannot hold; sample fas"),
    ("gain", lambda: replace(LOOP, gain=np.inf), "gain = inf"),
    ("horizon", lambda: periodic.least_squares(PLANT, 12, 3, 11), "horizon = 11.*look further"),
    ("noise", lambda: periodic.simulate(LOOP, np.ones(12), noise=np.ones(24)), "noise has 24"),
    ("appendix", lambda: periodic.lifted(bar_loop(20, 0, q=Q20)), "appendix has no q"),
    ("radius", lambda: periodic.count_outside(LOOP, 0.0), "radius = 0.0"),
    ("width", lambda: periodic.radius_bounds(LOOP, -1.0), "width = -1.0"),
    ("reference", lambda: periodic.steady_state(LOOP, np.ones(11)), "11 samples are not whole"),
    ("unstable", lambda: periodic.noise_gain(bar_loop(32, 0.9)), "is unstable .count"),
    ("output", lambda: periodic.noise_gain(LOOP, "outcome"), "'outcome': sources"),
    ("source", lambda: periodic.noise_gain(LOOP, "error", "wind"), "'wind' to 'error'"),
    ("growth", lambda: periodic.transient_growth(LOOP, [0]), "periods = 0"),
    ("early", lambda: periodic.sample(BAR.plant, [1e-4], -1e-6), "delay = -1e-06 s must lie"),
    ("too late", lambda: periodic.sample(BAR.plant, [1e-4], 2e-4), "between 0 and one period"),
    ("block", lambda: periodic.lift_by_products(bar_loop(20, 0), "E"), "'E' is none of A, B"),
    ("command", lambda: periodic.between_samples(BAR.plant, [1e-4], [1, 2], 3), "2 samples"),
    ("parts", lambda: periodic.between_samples(BAR.plant, [1e-4], [1.0], 0), "parts = 0"),
]


@pytest.mark.parametrize(("call", "message"), [r[1:] for r in REFUSED], ids=[r[0] for r in REFUSED])
def test_bad_input_is_refused(call, message):
    with pytest.raises(ValueError) as caught:
        call()
    assert re.search(message, str(caught.value)), caught.value
