"""Learning from pass to pass by several routes: definition, matrices, FFT, repetitive loop."""

import inspect
import sys
import types

import numpy as np
import pytest
import scipy.linalg

from rcbook import zdomain
from rcbook.loops import learning, repetitive
from rcbook.loops.learning import CONTINUOUS, PERIODIC, RESET, LearningLaw, Start
from rcbook.loops.repetitive import Loop, Process, RepetitiveController
from rcbook.machines import lathe
from rcbook.zdomain import NoncausalFilter, Plant

SEEDS = range(4)
SERVO = lathe.LEE_OH_KIM
LAG = Plant([0.5], [1, -0.5], 1, 1.0)
LATE = Plant([0.5, 0.2], [1, -0.9, 0.1], 2, 1.0)
OUTSIDE = Plant([0.3, -0.9, 0.5], [1, -0.5], 1, 1.0)
PLANTS = {"lathe": SERVO.plant, "nc": lathe.LEE_OH_KIM_NC.plant, "late": LATE, "outside": OUTSIDE}
Q1 = zdomain.binomial_q(1)
Q2 = zdomain.symmetric_fir([0.8, 0.1, -0.02])
RESTS = [Start("rest", after) for after in ("itself", "on", "nothing")]
FORGETFUL = [Start(s.before, s.after, True) for s in (CONTINUOUS, *RESTS)]
STARTS = [PERIODIC, CONTINUOUS, *RESTS, *FORGETFUL]
each_start = pytest.mark.parametrize("start", STARTS, ids=str)
each_plant = pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
each_seed = pytest.mark.parametrize("seed", SEEDS)


def make(q=(1.0,), gain=0.7, plant=None):
    """A plant, and a law designed on a slightly wrong idea of it."""
    plant = SERVO.plant if plant is None else plant
    believed = Plant(1.1 * plant.b, [1.0, plant.a[1] - 0.03, *plant.a[2:]], plant.delay, plant.dt)
    return plant, learning.zero_phase_law(believed, gain, "peak", q)


# ---- the definition, sample by sample ----


def recursion(b, a, x, k, y):
    """One sample of b/a at k; x(k) and y(k) are functions of time."""
    past = sum(a[i] * y(k - i) for i in range(1, len(a)))
    return (sum(b[i] * x(k - i) for i in range(len(b))) - past) / a[0]


def lookup(known, before):
    return lambda k: known.get(k, before) if k < 0 else known[k]


def plant_output(plant, u, n, rest):
    """Output at 0 .. n-1; command and output were `rest` before."""
    y = {}
    for k in range(n):
        y[k] = recursion(plant.numerator, plant.a, lookup(u, rest), k, lookup(y, rest))
    return y


def law_output(law, error, first, last):
    """H e at samples up to `last`, from rest at `first`; error is a function of time."""
    d, ahead = {}, law.filter.advance
    for k in range(first, last):
        x = lambda j: error(j + ahead)  # noqa: E731
        d[k] = recursion(law.filter.b, law.filter.a, x, k, lambda j: d.get(j, 0.0))
    return d


def by_definition_apart(plant, law, r, first, noise, start, rest):
    n, half, rows = len(r), law.q.size // 2, []
    u = dict(enumerate(first))
    for row in noise:
        if start.before == "itself":  # 40 repetitions: poles up to 0.9 have died out, 0.9^400
            y = plant_output(plant, {k: u[k % n] for k in range(40 * n)}, 40 * n, 0.0)
            y = {k: y[39 * n + k] for k in range(n)}
        else:
            y = plant_output(plant, u, n, rest)
        e = {k: r[k] - y[k] - row[k] for k in range(n)}
        rows.append(([u[k] for k in range(n)], [y[k] for k in range(n)]))
        if start.before == "itself":
            d = law_output(law, lambda k, e=e: e[k % n], -40 * n, n)
            moved = lambda k, u=u, d=d: u[k % n] + d[k % n]  # noqa: E731
        else:
            if start.after == "on":
                longer = {k: u[k % n] for k in range(n + law.look_ahead)}
                y = plant_output(plant, longer, n + law.look_ahead, rest)
                e |= {k: r[k % n] - y[k] for k in range(n, n + law.look_ahead)}
            elif start.after == "itself":
                e |= {k: e[k - n] for k in range(n, n + law.look_ahead)}
            begin = 0 if start.forgets else -law.filter.advance
            d = law_output(law, lambda k, e=e: e.get(k, 0.0), begin, n + half)

            def moved(k, u=u, d=d):
                if k < 0:
                    return u[0]
                if k >= n:
                    return (u[n - 1] if start.after == "nothing" else u[k - n]) + d[k]
                return u[k] + d[k]

        u = {k: sum(law.q[i] * moved(k + half - i) for i in range(law.q.size)) for k in range(n)}
    return tuple(np.array(s) for s in zip(*rows, strict=True))


def by_definition_running(plant, law, r, first, noise, start, rest):
    n, half, ahead = len(r), law.q.size // 2, law.filter.advance
    u, y, e, d = {}, {}, {}, {}
    for t, disturbed in enumerate(np.ravel(noise)):
        begin = 0 if start.forgets else -ahead
        for j in range(begin if t == 0 else t - n + half, t - n + half + 1):
            if j < begin:
                continue
            x = lambda k: e.get(k + ahead, 0.0)  # noqa: E731
            d[j] = recursion(law.filter.b, law.filter.a, x, j, lambda k: d.get(k, 0.0))
        window = [t - n + half - i for i in range(law.q.size)]
        moved = lambda k: u[k] + d[k] if k >= 0 else first[k % n]  # noqa: E731
        u[t] = first[t] if t < n else sum(law.q[i] * moved(k) for i, k in enumerate(window))
        y[t] = recursion(plant.numerator, plant.a, lookup(u, rest), t, lookup(y, rest))
        e[t] = r[t % n] - y[t] - disturbed
    return tuple(np.array([s[t] for t in range(len(u))]).reshape(-1, n) for s in (u, y))


def by_definition(plant, law, r, first, noise, start, rest):
    run = by_definition_running if start.before == "previous" else by_definition_apart
    return run(plant, law, r, first, noise, start, rest)


def check_definition(m, start, q, seed, plant=None, n=13, rest=0.4, own=False):
    rng = np.random.default_rng(seed)
    plant, law = make(q, plant=plant)
    law = m.LearningLaw(law.filter, law.q)
    start = m.Start(start.before, start.after, start.forgets)
    r, noise = rng.standard_normal(n), 0.3 * rng.standard_normal((4, n))
    first = r if not own else rng.standard_normal(n)
    run = m.learn(plant, law, r, 3, start, rest, noise, None if not own else first)
    u, y = by_definition(plant, law, r, first, noise, start, rest)
    # rounding of some hundred operations on numbers of size 10
    np.testing.assert_allclose(run.command, u, atol=1e-11 * np.abs(u).max())
    np.testing.assert_allclose(run.output, y, atol=1e-11 * np.abs(y).max())
    np.testing.assert_array_equal(run.error, r - run.output)
    np.testing.assert_array_equal(run.largest_error, [max(abs(e)) for e in run.error])
    np.testing.assert_array_equal(run.time, [k * plant.dt for k in range(n)])


@each_start
@pytest.mark.parametrize("q", [[1.0], Q1, Q2], ids=["q = 1", "short q", "long q"])
@each_seed
def test_every_start_follows_its_definition(start, q, seed):
    check_definition(learning, start, q, seed, own=seed % 2)


@each_start
@each_plant
def test_every_start_follows_its_definition_on_other_plants(start, plant):
    check_definition(learning, start, Q1, 11, plant)


@each_start
def test_a_pass_just_longer_than_the_look_ahead_follows_its_definition(start):
    _, law = make(Q2)
    check_definition(learning, start, Q2, 5, n=law.look_ahead + 1)


@each_start
@each_seed
def test_pass_0_is_commanded_by_the_reference_or_what_is_given_instead(start, seed):
    """Lee, Oh and Kim, eq. 18: nothing of it is corrected, filtered or learned."""
    rng = np.random.default_rng(seed)
    plant, law = make(Q2)
    r, first = rng.standard_normal((2, 12))
    for passes in (0, 3):
        np.testing.assert_array_equal(learning.learn(plant, law, r, passes, start).command[0], r)
        run = learning.learn(plant, law, r, passes, start, first=first)
        np.testing.assert_array_equal(run.command[0], first)
        np.testing.assert_array_equal(run.reference, r)


def papers_loop(n, per_turn, forgets, passes):
    """Eqs 16 to 18 as one plain loop over time: largest error in each pass."""
    corner, total = 10 * np.sqrt(2), n * (passes + 1)
    wanted = lambda k: 10 / np.cos((k / per_turn * 4 % 1 - 0.5) * np.pi / 2)  # noqa: E731
    taps = [2.43, 0.6112, -0.1527 - 1e-5, 0.0183 + 9e-6, 0.0063]  # eq. 17, unrounded
    y, u, e, d = {}, {}, {}, {}
    for k in range(total):
        u1, u2, u3 = (u.get(k - i, corner) for i in (1, 2, 3))
        y1, y2, y3 = (y.get(k - i, corner) for i in (1, 2, 3))
        y[k] = 0.14 * (u1 + 3.2 * u2 + 1.8711 * u3) + 0.16 * y1 - 0.003 * y2 - 0.0063 * y3
        e[k] = wanted(k % n) - y[k]
        m = k - 2  # eq. 17 looks two samples ahead
        if m >= (0 if forgets else -2):
            seen = sum(t * e.get(m + 2 - i, 0.0) for i, t in enumerate(taps))
            d[m] = seen / (0.14 * 3.43**2) - 0.77 * d.get(m - 1, 0.0)
        u[k] = wanted(k) if k < n else u[k - n] + d[k - n]
    return [max(abs(e[k]) for k in range(n * i, n * i + n)) for i in range(passes + 1)]


@pytest.mark.parametrize("forgets, fifth", [(True, 0.11250799), (False, 0.10785032)])
def test_a_running_square_leaves_pass_0_alone(forgets, fifth):
    """Square, 64 samples a turn, 16 a pass: the corner that ends pass 0 is missed by 2.275 mm; a
    law that reached back into pass 0 would make it 2.526."""
    law = learning.zero_phase_law(SERVO.plant)
    r = lathe.polygon_section(lathe.spindle_angle(16, 64, np.pi / 4), 4, 10.0)
    start = Start("previous", "next", forgets)
    run = learning.learn(SERVO.plant, law, r, 5, start, rest=10 * np.sqrt(2))
    # rounding of a hundred samples of size 14
    np.testing.assert_allclose(
        run.largest_error, papers_loop(16, 64, forgets, 5), rtol=0, atol=1e-11
    )
    assert run.largest_error.max() == pytest.approx(2.27485238, abs=5e-9)  # eight decimals
    assert run.largest_error[5] == pytest.approx(fifth, abs=5e-9)


# ---- feedforward alone ----


def test_tracking_is_the_papers_three_taps():
    """Eq. 19 with k - 1 in its last term and unrounded coefficients; zero-phase, so symmetric."""
    r = lathe.polygon_section(lathe.spindle_angle(16, 64, np.pi / 4), 4, 10.0)
    run = learning.track(SERVO.plant, learning.zero_phase_law(SERVO.plant), r)
    three = 2.43 * np.roll(r, -1) + (1 + 2.43**2) * r + 2.43 * np.roll(r, 1)
    np.testing.assert_allclose(run.output, [three / 3.43**2], rtol=1e-13)  # rounding
    np.testing.assert_array_equal(run.error, [r - run.output[0]])


@each_plant
@each_seed
def test_learning_from_the_tracking_command_begins_with_its_error(plant, seed):
    """And then falls by 1 - G H in every pass: e_L = (1 - G H)^(L + 1) r."""
    plant, law = make(plant=plant)
    r = np.random.default_rng(seed).standard_normal(12)
    zero_phase = learning.track(plant, law, r)
    run = learning.learn(plant, law, r, 3, first=zero_phase.command[0])
    z = np.exp(2j * np.pi * np.arange(12) / 12)
    factor = learning.error_factor(plant, law, z)
    for i in range(4):  # rounding of some transforms
        expected = np.fft.ifft(factor ** (i + 1) * np.fft.fft(r)).real
        np.testing.assert_allclose(run.error[i], expected, atol=1e-12 * np.abs(r).max())
    np.testing.assert_allclose(zero_phase.error[0], run.error[0], atol=1e-13)


# ---- one continuous run is the plug-in repetitive loop ----


def plug_in(plant, law, period):
    """The loop of `repetitive` with the same filter; its gain is inside of the filter."""
    return Loop(
        Process(plant),
        RepetitiveController(law.filter, repetitive.plain(period, law.q), 1.0),
        "plug-in",
    )


def free_response(plant, rest, n):
    """Output without command after command and output were `rest`."""
    y = {}
    u = {k: rest for k in range(-9, 0)} | {k: 0.0 for k in range(n)}
    for k in range(n):
        y[k] = recursion(plant.numerator, plant.a, u.__getitem__, k, lookup(y, rest))
    return np.array([y[k] for k in range(n)])


def check_plug_in(m, plant, period, gain, normalisation, seed, rest):
    rng = np.random.default_rng(seed)
    law = m.zero_phase_law(plant, gain, normalisation)
    r, noise = rng.standard_normal(period), 0.2 * rng.standard_normal((9, period))
    free = free_response(plant, rest, noise.size)
    loop = plug_in(plant, law, period)
    twin = repetitive.simulate(loop, np.tile(r, 9), noise=noise.ravel() + free)
    # the loop corrects the end of its first period already; learning is told of it
    first = twin.command[:period]
    untouched = period - law.look_ahead
    np.testing.assert_allclose(first[:untouched], r[:untouched], atol=1e-13)
    run = m.learn(plant, law, r, 8, m.CONTINUOUS, rest, noise, first)
    size = max(1.0, np.abs(twin.command).max())  # rounding of 9 periods, relative to the largest
    np.testing.assert_allclose(run.command.ravel(), twin.command, atol=1e-10 * size)
    np.testing.assert_allclose(run.output.ravel(), twin.output + free, atol=1e-10 * size)


@each_plant
@pytest.mark.parametrize("period", [6, 7, 16])
@pytest.mark.parametrize("gain, normalisation", [(1.0, "dc"), (0.5, "peak"), (1.3, "l1")])
@pytest.mark.parametrize("rest", [0.0, -1.7])
def test_continuous_learning_is_the_plug_in_repetitive_loop(
    plant, period, gain, normalisation, rest
):
    for seed in SEEDS:
        check_plug_in(learning, plant, period, gain, normalisation, seed, rest)


@each_plant
@pytest.mark.parametrize("q", [[1.0], Q1, Q2], ids=["q = 1", "short q", "long q"])
@pytest.mark.parametrize("period", [8, 9, 40])
def test_the_running_scheme_has_the_roots_of_the_repetitive_loop(plant, q, period):
    plant, law = make(q, plant=plant)
    loop = plug_in(plant, law, period)
    ours = learning.characteristic_polynomial(plant, law, period)
    theirs = repetitive.characteristic_polynomial(loop)
    difference = zdomain.add(ours, -theirs)
    np.testing.assert_allclose(difference, 0, atol=1e-13)  # the same products in another order
    # a double root moves by the root of 1e-16
    assert learning.spectral_radius(plant, law, period) == pytest.approx(
        np.abs(repetitive.roots(loop)[0]), abs=1e-7
    )


# ---- passes that repeat for ever ----


def spectral_error(plant, law, r, passes):
    """(1 - G H)^L (1 - G) r, bin by bin."""
    z = np.exp(2j * np.pi * np.fft.fftfreq(r.size))
    g = np.polyval(plant.numerator[::-1], 1 / z) / np.polyval(plant.a[::-1], 1 / z)
    h = z**law.filter.advance * np.polyval(law.filter.b[::-1], 1 / z)
    h /= np.polyval(law.filter.a[::-1], 1 / z)
    return np.fft.ifft((1 - g * h) ** passes * (1 - g) * np.fft.fft(r)).real


def check_periodic(m, plant, law, seed, n):
    r = np.random.default_rng(seed).standard_normal(n)
    run = m.learn(plant, m.LearningLaw(law.filter), r, 5)
    for i in range(6):  # rounding of six transforms
        np.testing.assert_allclose(run.error[i], spectral_error(plant, law, r, i), atol=1e-11)


@each_plant
@each_seed
@pytest.mark.parametrize("n", [11, 16])
def test_periodic_error_is_a_power_of_one_minus_gh(plant, seed, n):
    check_periodic(learning, *make(plant=plant), seed, n)


def test_periodic_passes_are_the_papers_recursions_repeated_until_settled():
    """Eqs 16 and 17 with unrounded coefficients, eq. 5, and every pass repeated 60 times."""
    n = 16
    r = lathe.polygon_section(lathe.spindle_angle(n, 4.0 * n), 4, 10.0)
    command = r
    # (1 - 0.16/z + 0.003/z^2 + 0.0063/z^3)(1 + 2.43 z), by hand
    taps = [2.43, 0.6112, -0.15271, 0.018309, 0.0063]
    run = learning.learn(SERVO.plant, learning.zero_phase_law(SERVO.plant), r, 5)
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
        np.testing.assert_allclose(run.output[i], y, atol=1e-11)
        np.testing.assert_allclose(run.command[i], command, atol=1e-11)
        command = command + step[-n:]


@each_seed
@pytest.mark.parametrize("period", [7, 8])
def test_every_harmonic_converges_at_its_own_rate(seed, period):
    plant, law = make(gain=0.4)
    rates = learning.harmonic_contraction(plant, law, period)
    assert rates.size == period // 2 + 1
    r = np.random.default_rng(seed).standard_normal(period)
    error = np.abs(np.fft.rfft(learning.learn(plant, law, r, 4).error, axis=1))
    ratios = error[1:] / error[:-1]
    assert error.min() > 1e-6 * error.max()  # rounding over this is 1e-10
    np.testing.assert_allclose(ratios, np.tile(rates, (4, 1)), rtol=1e-9)
    np.testing.assert_array_equal(learning.harmonic_contraction(plant, law, float(period)), rates)


# ---- passes from rest, as matrices over one pass ----


def impulse(b, a, n):
    """Power series of b/a, by long division."""
    rest, out = np.concatenate([b, np.zeros(n)])[: n + len(a)], []
    rest = np.pad(rest, (0, len(a)))
    for k in range(n):
        out.append(rest[k] / a[0])
        rest[k : k + len(a)] -= out[-1] * np.asarray(a)
    return np.array(out)


def lifted_pass(plant, law, r, after, rest):
    """M and v of u_(L+1) = M u_L + v, and T, t of y = T u + t, for a law with q = 1."""
    n, ahead = r.size, law.filter.advance
    long = n + ahead
    toeplitz = scipy.linalg.toeplitz(impulse(plant.numerator, plant.a, long), np.zeros(long))
    free = free_response(plant, rest, long)
    h = impulse(law.filter.b, law.filter.a, long)
    h_matrix = np.array(
        [[h[k + ahead - j] if k + ahead >= j else 0 for j in range(long)] for k in range(n)]
    )
    wrap = np.eye(n)[np.arange(long) % n]
    cut = np.eye(long, n)
    if after == "on":
        sense, wanted = toeplitz @ wrap, wrap @ r - free
    else:
        spread = wrap if after == "itself" else cut
        sense, wanted = spread @ toeplitz[:n, :n], spread @ (r - free[:n])
    m, v = np.eye(n) - h_matrix @ sense, h_matrix @ wanted
    return m, v, toeplitz[:n, :n], free[:n]


@pytest.mark.parametrize("start", RESTS, ids=str)
@each_plant
@each_seed
def test_passes_from_rest_are_powers_of_the_lifted_matrix(start, plant, seed):
    plant, law = make(plant=plant)
    r = np.random.default_rng(seed).standard_normal(15)
    run = learning.learn(plant, law, r, 6, start, rest=1.2)
    m, v, toeplitz, free = lifted_pass(plant, law, r, start.after, 1.2)
    affine = np.block([[m, v[:, None]], [np.zeros((1, 15)), np.ones((1, 1))]])
    for i in range(7):
        u = (np.linalg.matrix_power(affine, i) @ np.append(r, 1.0))[:15]
        size = max(1.0, np.abs(u).max())  # rounding of six matrix products
        np.testing.assert_allclose(run.command[i], u, atol=1e-11 * size)
        np.testing.assert_allclose(run.output[i], toeplitz @ u + free, atol=1e-11 * size)


@each_seed
def test_the_starts_differ(seed):
    """Or the tests above could not tell them apart."""
    plant, law = make(Q1)
    r = np.random.default_rng(seed).standard_normal(12)
    last = [learning.learn(plant, law, r, 3, start, 0.5).error[-1] for start in STARTS]
    for i, one in enumerate(last):
        for other in last[:i]:
            assert np.abs(one - other).max() > 1e-3


# ---- stability of the running scheme ----


def companion_radius(plant, law, n):
    """Largest eigenvalue of the map from one sample to the next, by probing every state."""
    memory = n + law.look_ahead + max(plant.numerator.size, law.filter.b.size, law.filter.a.size)
    half, ahead = law.q.size // 2, law.filter.advance

    def step(state):
        u, y, d = state.reshape(3, memory)  # u(t-1-i), y(t-1-i), d(t-n+half-1-i)
        past = lambda s, k: s[-1 - k]  # noqa: E731  k = -1 is the newest
        at = half - n  # d is wanted at time t + at
        x = lambda k: -past(y, k + ahead)  # noqa: E731
        new = recursion(law.filter.b, law.filter.a, x, at, lambda k: past(d, k - at))
        d = np.append(new, d[:-1])
        new = sum(
            law.q[i] * (past(u, at - i) + (d[i] if i < d.size else 0)) for i in range(law.q.size)
        )
        u = np.append(new, u[:-1])
        new = recursion(plant.numerator, plant.a, lambda k: u[-k], 0, lambda k: past(y, k))
        return np.concatenate([u, np.append(new, y[:-1]), d])

    matrix = np.array([step(row) for row in np.eye(3 * memory)]).T
    return np.abs(np.linalg.eigvals(matrix)).max()


@each_plant
@pytest.mark.parametrize("q", [[1.0], Q1], ids=["q = 1", "short q"])
def test_spectral_radius_is_that_of_the_sample_by_sample_map(plant, q):
    plant, law = make(q, gain=1.2, plant=plant)
    # a root of multiplicity two among those of size one moves by 1e-8
    assert learning.spectral_radius(plant, law, 8) == pytest.approx(
        companion_radius(plant, law, 8), abs=1e-6
    )


def growth(plant, law, period, periods=400):
    """Growth of the error per sample, seen in a long run: least squares over its last half."""
    start = np.zeros((periods + 1, period))
    start[0, -1] = 1.0  # one bad measurement, late enough to be looked ahead to
    zero = np.zeros(period)
    error = learning.learn(plant, law, zero, periods, CONTINUOUS, noise=start).error
    size = np.log(np.linalg.norm(error.reshape(-1, period), axis=1)[periods // 2 :])
    return np.exp(np.polyfit(np.arange(size.size), size, 1)[0] / period)


@pytest.mark.parametrize("period", [2, 4, 5, 9])
@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_long_runs_decay_below_the_limit_and_grow_above_it(period, factor):
    law = lambda gain: learning.p_type_law(gain, 1)  # noqa: E731
    low, high = 1e-3, 20.0
    for _ in range(60):
        middle = (low + high) / 2
        stable = learning.spectral_radius(LAG, law(middle), period) < 1
        low, high = (middle, high) if stable else (low, middle)
    radius = learning.spectral_radius(LAG, law(factor * low), period)
    assert (radius < 1) == (factor < 1)
    # beats of a complex pair leave some 1e-4 in the fit; the radius is off one by far more
    assert abs(radius - 1) > 4e-4
    assert growth(LAG, law(factor * low), period) == pytest.approx(radius, abs=2e-4)


@pytest.mark.parametrize("period", [2, 3, 4, 5])
def test_eq_8_is_not_necessary_for_a_running_scheme_of_a_finite_period(period):
    """G = 0.5/(z - 0.5) and H = 2.2 z: 1 - G H = -1.2 at z = 1, and yet short periods run stably;
    passes that repeat for ever diverge at that harmonic."""
    law = learning.p_type_law(2.2, 1)
    assert learning.contraction(LAG, law) == pytest.approx(1.2, rel=1e-14)
    # z^N (z - 0.5) = z - 0.5 - 1.1 z, that is z^(N+1) - 0.5 z^N + 0.1 z + 0.5 = 0
    radius = np.abs(np.roots([1, -0.5, *np.zeros(period - 2), 0.1, 0.5])).max()
    assert learning.spectral_radius(LAG, law, period) == pytest.approx(radius, rel=1e-9)
    assert radius < 1
    assert growth(LAG, law, period) == pytest.approx(radius, abs=2e-4)  # beats, as above
    assert learning.spectral_radius(LAG, law, 6) > 1
    noise = np.zeros((21, period))
    noise[0] = 1e-3  # one offset measurement, all of it harmonic 0
    error = learning.learn(LAG, law, np.zeros(period), 20, noise=noise).largest_error
    np.testing.assert_allclose(error[2:] / error[1:-1], 1.2, rtol=1e-9)  # rounding


@pytest.mark.parametrize("period", [2, 3, 5, 12])
def test_eq_8_is_not_sufficient_when_the_law_is_unstable(period):
    """G H = (1/3)/(1 - z/1.5) stays in the unit disc about 1, with a pole of the law at 1.5."""
    law = LearningLaw(NoncausalFilter([-1.0, 0.5], [1.0, -1.5], 0))
    np.testing.assert_allclose(law.poles, [1.5])
    # farthest from 1 at z = -1: 1 - (1/3)/(5/3) = 4/5
    assert learning.contraction(LAG, law) == pytest.approx(0.8, rel=1e-14)
    radius = learning.spectral_radius(LAG, law, period)
    assert radius > 1.2
    assert growth(LAG, law, period, 60) == pytest.approx(radius, abs=1e-3)


@pytest.mark.parametrize("period", [2, 4, 7])
def test_a_running_scheme_can_be_stable_with_a_pole_of_the_law_outside(period):
    law = LearningLaw(NoncausalFilter([0.5, -0.45], [1.0, -1.02], 1))
    assert abs(law.poles[0]) > 1
    radius = learning.spectral_radius(LAG, law, period)
    assert radius < 1
    assert growth(LAG, law, period) == pytest.approx(radius, abs=5e-4)  # beats
    with pytest.raises(ValueError, match=r"poles \[1\.02\].* start otherwise"):
        learning.learn(LAG, law, np.ones(period), 1)


@each_plant
@pytest.mark.parametrize("gain", [0.1, 0.7, 1.2])
@pytest.mark.parametrize("q", [[1.0], Q1, Q2], ids=["q = 1", "short q", "long q"])
def test_eq_8_with_a_stable_law_is_sufficient_for_every_period(plant, gain, q):
    plant, law = make(q, gain, plant)
    if learning.contraction(plant, law) < 1:
        for period in (7, 8, 20):
            assert learning.spectral_radius(plant, law, period) < 1


# ---- contraction ----


def test_contraction_of_the_papers_law_is_the_closed_form():
    """G H = (1 + 2.43/z)(1 + 2.43 z)/3.43^2 is least at z = -1: (1.43/3.43)^2."""
    law = learning.zero_phase_law(SERVO.plant)
    closed = 1 - (1.43 / 3.43) ** 2
    # 4097 points hold z = -1 itself: rounding only
    assert learning.contraction(SERVO.plant, law) == pytest.approx(closed, rel=1e-12)
    w = np.linspace(0, np.pi, 9)
    factor = 1 - (1 + 2.43**2 + 2 * 2.43 * np.cos(w)) / 3.43**2
    np.testing.assert_allclose(
        learning.error_factor(SERVO.plant, law, np.exp(1j * w)), factor, atol=1e-14
    )
    period = 16
    w = 2 * np.pi * np.arange(period // 2 + 1) / period
    factor = 1 - (1 + 2.43**2 + 2 * 2.43 * np.cos(w)) / 3.43**2
    np.testing.assert_allclose(
        learning.harmonic_contraction(SERVO.plant, law, period), factor, atol=1e-14
    )


def gained(m):
    z = np.exp(1j * np.linspace(0, np.pi, 9))
    law = m.zero_phase_law(SERVO.plant, 0.4)
    whole = (1 + 2.43**2 + 2 * 2.43 * z.real) / 3.43**2
    np.testing.assert_allclose(m.error_factor(SERVO.plant, law, z), 1 - 0.4 * whole, atol=1e-14)


def test_the_gain_scales_the_law():
    gained(learning)


def test_p_type_law_is_a_gain_and_an_advance():
    z = np.exp(1j * np.linspace(0, np.pi, 9))
    law = learning.p_type_law(0.3, 2, Q1)
    smooth = (1 + z.real) / 2
    expected = smooth * (1 - 0.3 * z**2 * 0.5 / (z - 0.5))
    np.testing.assert_allclose(learning.error_factor(LAG, law, z), expected, atol=1e-14)
    assert law.look_ahead == 3
    assert law.poles.size == 0


@pytest.mark.parametrize("zero", [-1.5, -0.9, 1.2, 2.0])
@pytest.mark.parametrize("normalisation", ["dc", "peak", "l1"])
def test_only_some_unstable_zeros_contract_under_the_papers_normalisation(zero, normalisation):
    """With dc, G H = |1 - zero/z|^2/(1 - zero)^2 exceeds 2 near a positive zero; with the peak or
    l1 it stays between 0 and 1."""
    plant = Plant([1.0, -zero], [1, -0.3], 1, 1.0)
    found = learning.contraction(plant, learning.zero_phase_law(plant, 1.0, normalisation))
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
    assert learning.contraction(plant, law) == pytest.approx(dense, abs=2e-6)


# ---- noise ----


def circulant(plant, period):
    """Plant as a matrix on periodic signals, from its impulse response folded."""
    h = impulse(plant.numerator, plant.a, 60 * period)
    return scipy.linalg.circulant(h.reshape(60, period).sum(axis=0))


def circulant_law(law, period):
    h = impulse(law.filter.b, law.filter.a, 60 * period)
    column = np.roll(h.reshape(60, period).sum(axis=0), -law.filter.advance)
    q = np.zeros(period)
    for i, tap in enumerate(law.q):
        q[(i - law.q.size // 2) % period] += tap
    return scipy.linalg.circulant(column), scipy.linalg.circulant(q)


@each_plant
@pytest.mark.parametrize("q", [[1.0], Q1], ids=["q = 1", "short q"])
@pytest.mark.parametrize("period", [7, 8])
@pytest.mark.parametrize("passes", [0, 1, 2, 6])
def test_noise_gain_is_a_sum_of_matrix_powers(plant, q, period, passes):
    plant, law = make(q, plant=plant)
    g = circulant(plant, period)
    h, smooth = circulant_law(law, period)
    once = smooth @ (np.eye(period) - h @ g)
    covariance = np.zeros((period, period))
    for _ in range(passes):
        covariance = once @ covariance @ once.T + smooth @ h @ h.T @ smooth.T
    expected = np.sqrt(np.trace(g @ covariance @ g.T) / period)
    # the law's slowest pole, 0.9, to the 420th: 1e-19
    assert learning.noise_gain(plant, law, period, passes) == pytest.approx(expected, rel=1e-11)


@each_seed
@pytest.mark.parametrize("passes", [1, 4])
def test_noise_gain_agrees_with_runs(seed, passes):
    rng = np.random.default_rng(seed)
    plant, law = make(Q1)
    squares = []
    for _ in range(300):
        noise = rng.standard_normal((passes + 1, 48))
        run = learning.learn(plant, law, np.zeros(48), passes, noise=noise)
        squares.append(np.mean(run.error[-1] ** 2))
    mean, sigma = np.mean(squares), np.std(squares, ddof=1) / np.sqrt(len(squares))
    expected = learning.noise_gain(plant, law, 48, passes) ** 2
    assert abs(mean - expected) < 4.5 * sigma  # independent runs: one false alarm in 1e5
    assert sigma < 0.03 * expected  # the band is narrow enough to tell passes apart


# ---- norm-optimal law ----


def cost(g, error, change, weight):
    return np.sum((error - g @ change) ** 2) + weight * np.sum(change**2)


def check_norm_optimal(m, plant, weight, period, seed):
    rng = np.random.default_rng(seed)
    g = circulant(plant, period)
    r = rng.standard_normal(period)
    run = m.learn(plant, m.norm_optimal_law(plant, weight, period), r, 1)
    error, change = run.error[0], run.command[1] - run.command[0]
    best = np.linalg.solve(g.T @ g + weight * np.eye(period), g.T @ error)
    # rounding of the solution times the condition, below 1e3 for these weights
    np.testing.assert_allclose(change, best, atol=1e-11 * np.abs(best).max())
    least = cost(g, error, change, weight)
    for size in (1e-3, 1e-2, 1.0):
        for _ in range(10):
            other = change + size * rng.standard_normal(period)
            assert cost(g, error, other, weight) > least
    assert cost(g, run.error[1], np.zeros(period), 0) == pytest.approx(
        cost(g, error, change, 0), rel=1e-9, abs=1e-15
    )


@each_plant
@each_seed
@pytest.mark.parametrize("period", [1, 2, 9, 10])
@pytest.mark.parametrize("weight", [0.03, 1.0])
def test_norm_optimal_law_minimises_its_cost(plant, seed, period, weight):
    if period > plant.numerator.size:
        check_norm_optimal(learning, plant, weight, period, seed)
    law = learning.norm_optimal_law(plant, weight, period)
    z = np.exp(2j * np.pi * np.arange(period // 2 + 1) / period)
    g = np.polyval(plant.numerator[::-1], 1 / z) / np.polyval(plant.a[::-1], 1 / z)
    np.testing.assert_allclose(  # 1 - |G|^2/(|G|^2 + w); rounding
        learning.harmonic_contraction(plant, law, period),
        weight / (np.abs(g) ** 2 + weight),
        atol=1e-12,
    )


@pytest.mark.parametrize("period", [9, 10])
def test_norm_optimal_law_goes_from_the_inverse_to_nothing(period):
    plant = SERVO.plant
    r = np.random.default_rng(3).standard_normal(period)
    inverse = np.linalg.solve(circulant(plant, period), r)
    for weight, atol in ((0.0, 1e-12), (1e-8, 1e-5)):  # the rest is weight/|G|^2, |G| > 0.03
        run = learning.learn(plant, learning.norm_optimal_law(plant, weight, period), r, 1)
        np.testing.assert_allclose(run.command[1], inverse, atol=100 * atol)
        np.testing.assert_allclose(run.error[1], 0, atol=atol * 10)
    large = 1e8
    law = learning.norm_optimal_law(plant, large, period)
    h, _ = circulant_law(law, period)
    # H = G^T/weight (1 - |G|^2/weight ..): the second term is 1e-8 of the first
    np.testing.assert_allclose(large * h, circulant(plant, period).T, atol=1e-7)
    np.testing.assert_allclose(learning.harmonic_contraction(plant, law, period), 1, atol=1e-7)


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
    found = learning.error_factor(SERVO.plant, law, z)
    np.testing.assert_allclose(found, 1 - g * h, atol=1e-13)
    swapped = learning.error_factor(
        SERVO.misjudged(f, f).plant, learning.zero_phase_law(SERVO.plant), z
    )
    assert np.abs(swapped - (1 - g * h)).max() > 0.05


@each_seed
def test_two_plants_with_one_law_differ_only_by_their_own_outputs(seed):
    r = np.random.default_rng(seed).standard_normal(12)
    law = learning.zero_phase_law(SERVO.plant)
    for plant in (SERVO.plant, SERVO.misjudged(1.2, 0.9).plant):
        run = learning.learn(plant, law, r, 2)
        h, _ = circulant_law(law, 12)
        np.testing.assert_allclose(run.output, run.command @ circulant(plant, 12).T, atol=1e-12)
        step = run.error[:-1] @ h.T
        np.testing.assert_allclose(np.diff(run.command, axis=0), step, atol=1e-12)


# ---- mutants: each key check can fail ----


def mutated(old, new):
    """The module with one piece of its source exchanged."""
    source = inspect.getsource(learning)
    assert source.count(old) >= 1, old
    module = types.ModuleType("mutant_of_learning")
    sys.modules[module.__name__] = module  # dataclasses look their module up
    exec(compile(source.replace(old, new), "mutant", "exec"), module.__dict__)
    return module


def definition(start, q=Q1):
    return lambda m: check_definition(m, start, q, 1, own=True)


def plugged(m):
    check_plug_in(m, SERVO.plant, 7, 0.8, "peak", 1, -1.7)


def optimal(m):
    check_norm_optimal(m, SERVO.plant, 0.03, 10, 1)


def periodic(m):
    check_periodic(m, *make(), 1, 16)


MUTANTS = [
    ("reference - output[i] - disturbed", "reference - output[i] + disturbed", PERIODIC),
    ("error)[begin:]", "np.append(0, error))[begin:]", RESET),
    ("ahead if start.forgets else 0", "0", FORGETFUL[0]),
    ("ahead if start.forgets else 0", "0", FORGETFUL[-1]),
    ('error[:ahead] if start.after == "itself"', 'error[-ahead:] if start.after == "itself"',
     RESTS[0]),
    ("reference[:ahead] - longer", "0 * reference[:ahead] - longer", RESTS[1]),
    ("np.append(u, u[:ahead])", "np.append(u, u[-ahead:])", RESTS[1]),
    ("else u[-1:].repeat(half)", "else u[:half]", RESET),
    ("u[:1].repeat(half), moved", "0 * u[:1].repeat(half), moved", RESET),
    ("np.full(plant.a.size, rest)", "np.zeros(plant.a.size)", RESET),
    ("np.full(b.size, rest)", "np.zeros(b.size)", CONTINUOUS),
    ("return _circular(NoncausalFilter(law.q, [1.0], half), moved)",
     "return u + _circular(NoncausalFilter(law.q, [1.0], half), moved - u)", PERIODIC),
    ("(wanted - y - noise)", "(wanted - y + noise)", CONTINUOUS),
    ("driven)[ahead - begin :]", "driven)[ahead - begin - 1 : -1]", CONTINUOUS),
    ("] = u[: correction.size] + correction", "] = correction", CONTINUOUS),
    ("np.resize(first, (2,", "np.resize(reference, (2,", CONTINUOUS),
    ("    u = first\n", "    u = reference\n", RESET),
    ("first[n - half :], u", "first[:half], u", CONTINUOUS),
]  # fmt: skip
MORE_MUTANTS = [
    ("block, half = n - law.look_ahead", "block, half = n - law.look_ahead + 1", plugged),
    ("zi=state)\n        if", "zi=0 * state)\n        if", plugged),
    ("gain * inverse.b", "inverse.b", gained),
    ("np.conj(gain) / cost", "gain / cost", optimal),
    ("** 2 + weight", "** 2 + 2 * weight", optimal),
    ("np.roll(taps, half)", "np.roll(taps, half + 1)", optimal),
    ("np.fft.ifft(gain * np.fft.fft(x)).real", "np.fft.ifft(gain.conj() * np.fft.fft(x)).real",
     periodic),
    ("_corrected(law, u, _beyond", "_corrected(law, reference, _beyond", periodic),
]  # fmt: skip


@pytest.mark.parametrize("old, new, check", [
    *((old, new, definition(start)) for old, new, start in MUTANTS),
    *MORE_MUTANTS,
])  # fmt: skip
def test_a_mutant_is_caught(old, new, check):
    check(learning)
    mutant = mutated(old, new)
    with pytest.raises(AssertionError):
        check(mutant)


def test_slips_of_the_characteristic_polynomial_are_caught():
    plant, law = make(Q1)
    truth = companion_radius(plant, law, 8)
    for old, new in (
        ("period - law.q.size // 2)", "period)"),
        ('"period") - law.look_ahead', '"period") - law.filter.advance'),
        ("np.ones(1), -shift", "np.ones(1), shift"),
        ("multiply(plant.a, law.filter.a, memory)", "multiply(plant.a, memory)"),
    ):
        assert abs(mutated(old, new).spectral_radius(plant, law, 8) - truth) > 1e-4


def test_slips_of_the_noise_gain_are_caught():
    plant, law = make(gain=0.3)
    truth = learning.noise_gain(plant, law, 8, 4)
    for old, new in (
        ('range(zdomain.whole_number(passes, "passes", 0))', "range(passes + 1)"),
        ("zdomain.response(plant, z) * once", "once"),
        ("np.abs(error_factor(plant, law, z)) ** 2", "np.abs(error_factor(plant, law, z))"),
    ):
        assert abs(mutated(old, new).noise_gain(plant, law, 8, 4) / truth - 1) > 0.01


# ---- bad input ----

NAN = np.nan
P, H = make()
TWELVE = np.ones(12)
FIVE = np.arange(5.0)
LONG = Plant([1.0], [1, *np.zeros(6), 0.1], 1, 1.0)
ONCE = learning.p_type_law(0.5, 1)


def learn(plant=P, law=H, r=TWELVE, passes=1, *rest, **options):
    return learning.learn(plant, law, r, passes, *rest, **options)


BAD = {
    "look-ahead of the whole pass": (lambda: learn(law=learning.p_type_law(1.0, 12)),
        r"looks 12 samples ahead.* has 12; sample faster"),
    "look-ahead beyond the pass": (lambda: learn(law=learning.p_type_law(1.0, 40), start=RESET),
        r"looks 40 samples ahead.* has 12; sample faster"),
    "look-ahead by q": (lambda: learn(r=FIVE, law=learning.p_type_law(1.0, 4, Q1)),
        r"looks 5 samples ahead.* has 5; "),
    "look-ahead beyond the period": (
        lambda: learning.spectral_radius(P, learning.p_type_law(1.0, 7), 6),
        r"looks 7 samples ahead.* 6 .*lengthen"),
    "memory of no delay": (lambda: learning.spectral_radius(P, learning.p_type_law(1, 0, Q2), 2),
        r"looks 2 samples ahead.* 2 .*lengthen"),
    "reference shorter than the filters": (lambda: learn(LONG, ONCE, FIVE),
        r"5 samples and the plant reaches back 8; give a longer"),
    "zero on the circle under dc": (
        lambda: learning.zero_phase_law(Plant([1.0, -1.0], [1.0], 1, 1.0)), r"vanishes at z = 1"),
    "NaN in the reference": (lambda: learn(r=[*FIVE, NAN]), r"nan at sample 5; give finite"),
    "2-D reference": (lambda: learn(r=np.ones((2, 6))), r"shape \(2, 6\); give one"),
    "empty reference": (lambda: learn(r=[]), r"shape \(0,\); give one"),
    "noise of another shape": (lambda: learn(noise=np.zeros(24)),
        r"shape \(24,\); give one row per pass: \(2, 12\)"),
    "noise turned": (lambda: learn(noise=np.zeros((12, 2))), r"shape \(12, 2\); .*\(2, 12\)"),
    "NaN in the noise": (lambda: learn(noise=[[0.0] * 12, [NAN] * 12]), r"noise.* nan .*finite"),
    "complex noise": (lambda: learn(noise=1j * np.zeros((2, 12))), r"noise is complex; give real"),
    "first command of another length": (lambda: learn(first=np.ones(11)),
        r"first has 11 samples, 12 are needed"),
    "NaN in the first command": (lambda: learn(first=[NAN] * 12), r"first holds nan at sample 0"),
    "NaN to track": (lambda: learning.track(P, H, [*TWELVE[:11], NAN]), r"nan at sample 11"),
    "track a short shape": (lambda: learning.track(P, H, [1.0, 2.0]), r"looks 2 samples ahead"),
    "track by an unstable law": (
        lambda: learning.track(P, LearningLaw(NoncausalFilter([1.0], [1.0, -1.5], 1)), TWELVE),
        r"poles \[1\.5\].* start otherwise"),
    "forgetful for ever": (lambda: Start("itself", "itself", True), r"forgets nothing; start"),
    "NaN at rest": (lambda: learn(start=RESET, rest=NAN), r"rest = nan must be"),
    "unstable plant": (lambda: learn(Plant([1.0], [1, -1.2], 1, 1.0), ONCE),
        r"poles \[1\.2\]; close a loop"),
    "integrator": (lambda: learn(Plant([1.0], [1, -1.0], 1, 1.0), ONCE), r"poles \[1\.\]; close"),
    "unknown start": (lambda: Start("moon", "next"), r"'moon'.*choose itself with itself"),
    "start in a word": (lambda: learn(start="periodic"), r"start = 'periodic': give PERIODIC"),
    "pair that does not go": (lambda: Start("previous", "itself"), r"'previous', .*previous with"),
    "half a pass": (lambda: learn(passes=2.5), r"passes = 2\.5 .*round"),
    "fewer than no passes": (lambda: learn(passes=-1), r"passes = -1 .*round"),
    "half a period": (lambda: learning.spectral_radius(P, H, 8.5), r"period = 8\.5 .*round"),
    "half a harmonic": (lambda: learning.harmonic_contraction(P, H, 8.5), r"period = 8\.5 .*round"),
    "no period": (lambda: learning.norm_optimal_law(P, 1.0, 0), r"period = 0 .*round"),
    "noise of half a pass": (lambda: learning.noise_gain(P, H, 8, 1.5), r"passes = 1\.5 .*round"),
    "noise of half a sample": (lambda: learning.noise_gain(P, H, 8.1, 1), r"period = 8\.1 .*round"),
    "no points": (lambda: learning.contraction(P, H, 0), r"points = 0 .*round"),
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
    "law that never repeats": (
        lambda: learn(law=LearningLaw(NoncausalFilter([1.0], [1.0, -1.0], 1))),
        r"poles \[1\.\].* start otherwise"),
}  # fmt: skip


@pytest.mark.parametrize("call, message", BAD.values(), ids=BAD)
def test_bad_input_names_value_and_mend(call, message):
    with pytest.raises(ValueError, match=message):
        call()
