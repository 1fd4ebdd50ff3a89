"""Periodic loops by several routes: definition, matrices, closed forms, and each other."""

import re
from dataclasses import replace

import control
import numpy as np
import pytest
import scipy.linalg
import scipy.signal

from rcbook import zdomain
from rcbook.loops import periodic
from rcbook.loops.periodic import Compensator, PeriodicLoop, PeriodicPlant
from rcbook.machines import boring_bar

BAR = boring_bar.HANSON_TSAO2000
Q20 = zdomain.symmetric_fir([0.8, 0.1])
Q21 = zdomain.binomial_q()
SEEDS = range(4)
each_seed = pytest.mark.parametrize("seed", SEEDS)


def bar_intervals(n, gamma):
    return boring_bar.sinusoidal_intervals(BAR.sampling_interval, gamma, n)


def bar_loop(n, gamma, design="scheduled", q=(1.0,), gain=1.0):
    intervals = bar_intervals(n, gamma)
    designed_for = bar_intervals(n, 0.0) if design == "nominal" else intervals
    compensator = periodic.zero_phase(BAR.plant, designed_for)
    return PeriodicLoop(periodic.sample(BAR.plant, intervals), compensator, q, gain)


def random_loop(seed, n=None, gain=0.6):
    """A loop of no particular merit: random plant, taps, advance and q of its own per sample."""
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
    q = rng.uniform(0, 1, (n, 2 * half + 1))
    return PeriodicLoop(plant, Compensator(taps, advance), q / q.sum(axis=1, keepdims=True), gain)


# ---- the definition, sample by sample ----


def by_definition(loop, drive, x=None, u=None, w=None):
    """x, u, w as dictionaries of time and y as a row, from the equations at the head of the
    module; u and w map past times to values, zero where they say nothing."""
    plant, n, half = loop.plant, loop.period, loop.half
    u, w = dict(u or {}), dict(w or {})
    x = np.zeros(plant.order) if x is None else x
    states, y = {0: x}, []
    for k, driven in enumerate(drive):
        i = k % n
        y.append(plant.c @ x)
        u[k] = sum(
            loop.q[i, half + j] * w.get(k - n + loop.advance + j, 0.0)
            for j in range(-half, half + 1)
        )
        w[k] = u.get(k - loop.advance, 0.0) + driven - y[-1]
        taps = loop.compensator.taps[i]
        v = loop.gain * sum(tap * u.get(k - j, 0.0) for j, tap in enumerate(taps))
        x = plant.a[i] @ x + plant.b[i] * v
        states[k + 1] = x
    return states, u, w, np.array(y)


def sizes(loop):
    """n, reach and memory of the state as `one_period_map` documents it."""
    reach = max(loop.advance, loop.compensator.taps.shape[1] - 1)
    return loop.plant.order, reach, loop.period - loop.advance + loop.half


def from_state(loop, state, drive):
    order, reach, memory = sizes(loop)
    u = {i - reach: value for i, value in enumerate(state[order : order + reach])}
    w = {i - memory: value for i, value in enumerate(state[order + reach :])}
    return by_definition(loop, drive, state[:order], u, w)


def matrix_by_definition(loop):
    order, reach, memory = sizes(loop)
    n, columns = loop.period, []
    for unit in np.eye(order + reach + memory):
        x, u, w, _ = from_state(loop, unit, np.zeros(n))
        after = [u[j] for j in range(n - reach, n)] + [w[j] for j in range(n - memory, n)]
        columns.append(np.concatenate([x[n], after]))
    return np.array(columns).T


@each_seed
@pytest.mark.parametrize("n", [None, 7])  # 7: shorter than what some loops remember of u
def test_one_period_map_is_the_recursion(seed, n):
    loop = random_loop(seed, n)
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
def test_simulation_is_the_recursion(seed):
    loop = random_loop(seed, gain=0.1)
    rng = np.random.default_rng(seed)
    r, noise = rng.standard_normal((2, 5 * loop.period))
    _, u, _, y = by_definition(loop, r - noise)
    run = periodic.simulate(loop, r, noise)
    expected = np.array([u[k] for k in range(r.size)])
    assert not run.unbounded
    np.testing.assert_allclose(run.output, y, atol=1e-12 * np.abs(y).max())
    np.testing.assert_allclose(run.repetitive, expected, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(run.error, r - run.output)
    taps = loop.gain * loop.compensator.taps
    command = [
        sum(tap * u.get(k - j, 0.0) for j, tap in enumerate(taps[k % loop.period]))
        for k in range(r.size)
    ]
    np.testing.assert_allclose(run.command, command, atol=1e-12 * np.abs(command).max())
    assert run.time[0] == 0
    np.testing.assert_allclose(np.diff(run.time), run.intervals[:-1], rtol=1e-9)


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
    gain = 1 - periodic.frozen_symbol(loop, z)
    assert loop.advance == 6
    assert loop.compensator.taps.shape == (12, 12)
    for k, interval in enumerate(loop.plant.intervals):
        b = zdomain.zero_order_hold(periodic.balanced(BAR.plant), interval).b
        expected = np.abs(zdomain.evaluate(b, z)) ** 2 / np.abs(b).sum() ** 2
        np.testing.assert_allclose(gain[k], expected, atol=1e-9)
    late = replace(loop, compensator=replace(loop.compensator, advance=5))
    assert np.abs((1 - periodic.frozen_symbol(late, z)).imag).max() > 0.5


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


def embeddings(loop):
    """Maps of the state of `one_period_map` to those of eq. 8 and of eq. A14, from definitions."""
    order, reach, memory = sizes(loop)
    n, filter = loop.period, loop.compensator.taps.shape[1] - 1
    product, appendix = [], []
    for unit in np.eye(order + reach + memory):
        _, u, w, _ = from_state(loop, unit, np.zeros(n))
        past_w = [w[-j] for j in range(1, memory + 1)]
        past_u = [u[-j] for j in range(1, max(filter, loop.advance) + 1)]
        x = unit[:order]
        product.append(np.concatenate([past_w, past_u[: loop.advance], past_u[:filter], x]))
        appendix.append(np.concatenate([past_u[:filter], x, [u[k] for k in range(n)]]))
    return np.array(product).T, np.array(appendix).T


@each_seed
def test_product_of_matrices_is_the_one_period_map(seed):
    loop = random_loop(seed)
    into, _ = embeddings(loop)
    matrix, expected = periodic.product_of_matrices(loop), matrix_by_definition(loop)
    assert len(matrix) == loop.period + loop.half + sum(
        (loop.plant.order, loop.compensator.taps.shape[1] - 1)
    )
    np.testing.assert_allclose(matrix @ into, into @ expected, atol=1e-11 * np.abs(expected).max())


@each_seed
def test_appendix_is_the_one_period_map_and_wrong_readings_are_not(seed):
    loop = replace(random_loop(seed), q=np.ones(1))
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
    low, high = periodic.spectral_radius(loop, 0.05)
    dense = np.abs(periodic.multipliers(loop)[0])
    assert low <= dense <= high <= low + 0.05


@pytest.mark.parametrize("gamma", [0.4, 0.5, 0.7])
def test_count_finds_the_multipliers_of_an_unstable_design(gamma):
    loop = bar_loop(64, gamma, "nominal")
    expected = int(np.sum(np.abs(np.linalg.eigvals(periodic.product_of_matrices(loop))) > 1))
    assert expected > 4
    assert periodic.count_outside(loop).outside == expected


def closed_form_modes(n, gain, q):
    """Modes z of the time-invariant loop, z^N = q (1 - gain |B|^2/b), by fixed-point iteration
    from the N-th roots of unity; it contracts like 1/N."""
    b = zdomain.zero_order_hold(periodic.balanced(BAR.plant), BAR.sampling_interval).b
    z = zdomain.unit_circle(n)
    for _ in range(30):
        squared = zdomain.evaluate(b, z) * zdomain.evaluate(b, 1 / z) / np.abs(b).sum() ** 2
        symbol = zdomain.evaluate(q, z) * z ** float(len(q) // 2) * (1 - gain * squared)
        # the symbol is all but real: one branch of the logarithm for each sign, no cut nearby
        logarithm = np.log(np.abs(symbol.real) + 1j * symbol.imag * np.sign(symbol.real))
        logarithm += 1j * np.pi * (symbol.real < 0)
        z = np.exp((logarithm + 2j * np.pi * np.arange(n)) / n)
    return z, symbol


def test_the_map_has_the_closed_form_multipliers_of_a_time_invariant_loop():
    """N = 1e5: u(k) = z^k and what follows from it come back z^N times as large."""
    n, gain = 100_000, 0.7
    intervals = np.full(n, BAR.sampling_interval)
    loop = PeriodicLoop(
        periodic.sample(BAR.plant, intervals), periodic.zero_phase(BAR.plant, intervals), Q20, gain
    )
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
    assert periodic.decide(loop).verdict == "unstable"
    assert periodic.decide(bar_loop(n, 0.0, gain=1.95)).verdict == "stable"


# ---- bounds ----


def test_energy_gain_of_a_time_invariant_loop_is_the_peak_of_its_symbol():
    for gain, q in ((0.7, (1.0,)), (1.9, Q20), (2.4, Q21)):
        loop = bar_loop(9, 0.0, q=q, gain=gain)
        peak = np.abs(periodic.frozen_symbol(loop, zdomain.unit_circle(4000))[0]).max()
        bound = periodic.energy_gain(loop, 1e-3)
        assert peak <= bound <= peak + 1.1e-3


def window_of_k(loop, samples, span):
    """Matrix of K on `samples` inputs, with outputs from 9 before to `span` after, from the
    definition: answer of q (u(k) - y(k+L)) to unit inputs."""
    plant, n, half = loop.plant, loop.period, loop.half
    rows = 9 + samples + span
    matrix = np.zeros((rows, samples))
    for j in range(samples):
        y, x = np.zeros(rows + 30), np.zeros(plant.order)
        for k in range(j, rows + 20 - 9):
            y[k + 9] = plant.c @ x
            lag = k - j
            v = loop.taps[k % n, lag] if lag < loop.taps.shape[1] else 0.0
            x = plant.a[k % n] @ x + plant.b[k % n] * v
        inner = -np.roll(y, -loop.advance)
        inner[9 + j] += 1.0
        for k in range(-9, rows - 9):
            terms = range(max(k - half, -9), k + half + 1)
            matrix[k + 9, j] = sum(loop.q[k % n, half + i - k] * inner[i + 9] for i in terms)
    return matrix


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
    assert periodic.decide(loop).verdict == ("stable" if radius < 1 else "unstable")


def test_a_loop_that_rounding_decides_is_undecided():
    """The nominal design at gamma = 0.5: what its dense matrix of N = 512 has as eigenvalues, its
    transpose has not, because the powers grow beyond 1e9 in 20 periods."""
    loop = bar_loop(512, 0.5, "nominal")
    found = periodic.decide(loop)
    assert (found.verdict, found.outside) == ("undecided", None)
    assert "undecided (count: " in str(found)
    matrix = periodic.dense(loop)
    ours, theirs = (np.linalg.eigvals(m) for m in (matrix, matrix.T))
    assert np.abs(ours[:, None] - theirs).min(axis=1).max() > 1e-3
    assert periodic.transient_growth(loop, [20], 3)[0] > 1e9


def test_verdicts_tell_their_grounds():
    assert periodic.decide(bar_loop(64, 0.3)).method == "energy"
    counted = periodic.decide(bar_loop(64, 0.15, "nominal"))
    assert (counted.verdict, counted.method, counted.outside) == ("stable", "count", 0)
    assert "points of the half circle" in counted.certificate
    assert periodic.decide(bar_loop(48, 0.5, "nominal")).outside > 0


def test_a_plant_that_grows_unseen_is_not_called_stable():
    """A mode e^(0.1 t) that the input does not reach and the output does not show."""
    hidden = control.ss(np.diag([-1.0, 0.1]), [[1.0], [0.0]], [[1.0, 0.0]], 0)
    plant = periodic.sample(hidden, np.full(9, 0.5))
    loop = PeriodicLoop(plant, Compensator(np.full((9, 1), 0.5), 1))
    assert periodic.energy_gain(loop) < 1
    assert (periodic.decide(loop).verdict, periodic.decide(loop).outside) == ("unstable", 1)


# ---- companions ----


def test_growth_is_the_norm_of_the_powers():
    loop = bar_loop(32, 0.45, "nominal")
    order, reach, _ = sizes(loop)
    matrix = matrix_by_definition(loop)
    for j, found in zip((1, 3, 8), periodic.transient_growth(loop, [1, 3, 8], 60), strict=True):
        power = np.linalg.matrix_power(matrix, j)[order + reach :, order + reach :]
        assert found == pytest.approx(np.linalg.norm(power, 2), rel=1e-3)
        assert found <= np.linalg.norm(power, 2) * (1 + 1e-12)


@pytest.mark.parametrize("output", ["output", "repetitive"])
def test_noise_gain_solves_the_lyapunov_equation(output):
    loop = bar_loop(18, 0.3, q=Q20)
    _, reach, memory = sizes(loop)
    n, matrix = loop.period, matrix_by_definition(loop)
    entry, seen = [], []
    for unit in np.eye(n):
        x, u, w, y = by_definition(loop, unit)
        after = [u.get(j, 0.0) for j in range(n - reach, n)]
        after += [w.get(j, 0.0) for j in range(n - memory, n)]
        entry.append(np.concatenate([x[n], after]))
        seen.append(y if output == "output" else [u[k] for k in range(n)])
    free = []
    for unit in np.eye(len(matrix)):
        _, u, _, y = from_state(loop, unit, np.zeros(n))
        free.append(y if output == "output" else [u[k] for k in range(n)])
    entry, free = np.array(entry).T, np.array(free).T
    covariance = scipy.linalg.solve_discrete_lyapunov(matrix, entry @ entry.T)
    variance = (np.trace(free @ covariance @ free.T) + np.sum(np.square(seen))) / n
    assert periodic.noise_gain(loop, output) == pytest.approx(np.sqrt(variance), rel=1e-9)


def test_noise_gain_is_what_a_long_run_shows():
    """4e5 samples of a standard deviation are good to about 0.5 %, times three."""
    loop = bar_loop(40, 0.5, q=Q20)
    noise = np.random.default_rng(5).standard_normal(40 * 10_000)
    run = periodic.simulate(loop, np.zeros(noise.size), noise)
    assert np.std(run.output[4000:]) == pytest.approx(periodic.noise_gain(loop), rel=0.015)


def test_steady_state_is_what_a_run_tends_to():
    for q in ((1.0,), Q20):
        loop = bar_loop(40, 0.4, q=q)
        reference = BAR.reference(3, 40)
        run = periodic.simulate(loop, np.tile(reference, 900))
        steady = periodic.steady_state(loop, reference)
        for name in ("output", "repetitive", "command", "error"):
            ours, theirs = getattr(steady, name), getattr(run, name)[-40:]
            np.testing.assert_allclose(ours, theirs, atol=1e-9 * np.abs(theirs).max() + 1e-16)
        # without q the error vanishes; with it a known part of it stays
        assert (np.abs(steady.error).max() < 1e-12 * BAR.amplitude) == (len(q) == 1)


def test_an_unstable_run_stops_and_says_so():
    loop = bar_loop(32, 0.9)
    run = periodic.simulate(loop, np.tile(BAR.reference(2, 32), 200), bound=1e6)
    assert run.unbounded
    assert 32 < run.output.size == run.error.size == run.reference.size < 32 * 200
    assert np.all(np.isfinite(run.output))
    assert np.abs([run.output, run.repetitive, run.command]).max() <= 1e6 * BAR.amplitude
    longer = periodic.simulate(loop, np.tile(BAR.reference(2, 32), 200), bound=1e300)
    assert np.all(np.isfinite(longer.output))
    np.testing.assert_array_equal(longer.output[: run.output.size], run.output)


def test_frozen_symbol_is_the_response_of_a_lasting_sample():
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
            np.repeat(loop.q[k : k + 1], 12, axis=0),
            loop.gain,
        )
        kernel = window_of_k(single, 1, 3000)[:, 0]
        expected = [np.sum(kernel * point ** -np.arange(-9.0, kernel.size - 9)) for point in z]
        np.testing.assert_allclose(periodic.frozen_symbol(loop, z)[k], expected, atol=1e-9)


# ---- bad input ----

LOOP = random_loop(0, 12)
PLANT = LOOP.plant
REFUSED = [
    ("intervals", lambda: periodic.sample(BAR.plant, [1e-4, -1e-4]), r"-0\.0001 s; they must"),
    ("two inputs", lambda: periodic.sample(control.ss(-1, [[1, 1]], 1, 0), [1.0]), "2 inputs"),
    ("direct", lambda: periodic.sample(control.ss(-1, 1, 1, 1), [1.0]), "strictly proper"),
    ("shape of b", lambda: replace(PLANT, b=PLANT.b[1:]), r"b has shape .*fits the others"),
    ("NaN", lambda: replace(PLANT, c=PLANT.c * np.nan), "c holds NaN.*give finite"),
    ("no time", lambda: replace(PLANT, intervals=np.zeros(12)), "must be positive"),
    ("taps", lambda: Compensator([1.0, 2.0], 3), r"shape \(2,\); give a finite row per sample"),
    ("advance", lambda: Compensator([[1.0]], 0), "advance L = 0 must be .* not below 1"),
    ("rows", lambda: replace(LOOP, compensator=Compensator([[1.0]], 1)), "1 rows.*every 12"),
    ("even q", lambda: replace(LOOP, q=[0.5, 0.5]), r"q of shape \(2,\): give an odd number"),
    ("NaN in q", lambda: replace(LOOP, q=[np.nan]), "give an odd number"),
    ("far look", lambda: replace(LOOP, q=np.ones(23) / 23), "period of 12 cannot hold; sample"),
    ("gain", lambda: replace(LOOP, gain=np.inf), "gain = inf"),
    ("horizon", lambda: periodic.least_squares(PLANT, 12, 3, 11), "horizon = 11.*look further"),
    ("part of a period", lambda: periodic.simulate(LOOP, np.ones(13)), "13 samples are not whole"),
    ("noise", lambda: periodic.simulate(LOOP, np.ones(12), np.ones(24)), "noise has 24 samples"),
    ("bound", lambda: periodic.simulate(LOOP, np.ones(12), bound=0.0), "bound = 0.0"),
    ("appendix", lambda: periodic.lifted(bar_loop(20, 0, q=Q20)), "appendix has no q"),
    ("radius", lambda: periodic.count_outside(LOOP, 0.0), "radius = 0.0"),
    ("width", lambda: periodic.spectral_radius(LOOP, -1.0), "width = -1.0"),
    ("reference", lambda: periodic.steady_state(LOOP, np.ones(11)), "11 samples, 12 are needed"),
    ("unstable", lambda: periodic.noise_gain(bar_loop(32, 0.9)), "does not settle"),
    ("output", lambda: periodic.noise_gain(LOOP, "error"), "'error': choose"),
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
