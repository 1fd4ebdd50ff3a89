"""What was made fast against what it replaced, where the two could part."""

import numpy as np
import pytest
from oracles.repetitive import (
    filtered,
    lowest_crossing,
    open_polynomials,
    recursion,
    stable_factors,
)

from rcbook import zdomain
from rcbook.loops import repetitive
from rcbook.loops.repetitive import (
    FORMS,
    Limit,
    Limits,
    Loop,
    Process,
    RepetitiveController,
    Resonators,
    radii,
)
from rcbook.zdomain import Plant


def random_process(rng, order, inner):
    """A stable plant of an order, zeros inside and out, perhaps under PI control."""
    while True:
        poles = rng.uniform(-0.8, 0.9, order)
        zeros = rng.choice([-1.7, -0.6, -0.3, 0.2, 0.5, 1.4], order - 1, replace=False)
        b = rng.uniform(0.2, 1) * np.atleast_1d(np.poly(zeros))
        plant = Plant(b, np.poly(poles), int(rng.integers(1, 4)), 1.0)
        pi = repetitive.pi_controller(0.02, 1.3, 1.0) if inner else None
        if Process(plant, pi).command_path.is_stable:
            return Process(plant, pi)


MEMORIES = {
    "short": lambda: repetitive.plain(16),
    "q": lambda: repetitive.plain(40, zdomain.binomial_q(2)),
    "long": lambda: repetitive.plain(700, zdomain.binomial_q(1)),
    "fraction": lambda: repetitive.plain(333.4),
    "odd harmonics": lambda: repetitive.odd_harmonic(600),
    "near and far": lambda: repetitive.several(repetitive.plain(17), repetitive.plain(400)),
    "two far": lambda: repetitive.several(
        repetitive.plain(290, zdomain.binomial_q(1)), repetitive.plain(500)
    ),
}


def random_loop(seed, memory):
    rng = np.random.default_rng(seed)
    process = random_process(rng, int(rng.integers(1, 6)), bool(rng.integers(2)))
    gain, form = rng.uniform(0.3, 1.2), FORMS[rng.integers(2)]
    return repetitive.design(process, memory, gain, form=form)


LOOPS = {
    f"{name} {seed}": random_loop(seed, memory())
    for name, memory in MEMORIES.items()
    for seed in range(3)
}
RESONATORS = {
    f"resonators {form}": Loop(
        random_process(np.random.default_rng(1), 3, True),
        repetitive.resonators(
            random_process(np.random.default_rng(1), 3, True).command_path, 12, (0, 1, 3), 0.05
        ),
        form,
    )
    for form in FORMS
}
LOOPS |= RESONATORS | {
    "lead": Loop(
        Process(Plant([0.5], [1, -0.5], 1, 1.0)),
        RepetitiveController(repetitive.lead(2), repetitive.plain(12, [0.25, 0.5, 0.25]), 0.5),
    ),
    "answers at once": Loop(  # a delay of 0: e acts on u in the same sample
        Process(Plant([0.5], [1, -0.5], 1, 1.0)),
        RepetitiveController(repetitive.lead(12), repetitive.plain(12), 0.02),
    ),
    "no controller": Loop(random_process(np.random.default_rng(4), 4, True)),
}
each_loop = pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS.keys())


def records(n, seed=0):
    return np.random.default_rng(seed).standard_normal((3, n))


def agree(run, found, atol):
    for name, truth in zip(("output", "command", "repetitive"), found, strict=True):
        ours = getattr(run, name)
        np.testing.assert_allclose(ours, truth, rtol=0, atol=atol, err_msg=name)


@each_loop
@pytest.mark.parametrize("n", [1, 5, 1500])
def test_a_free_run_is_that_of_the_recursion_and_of_the_filters(loop, n):
    r, w, noise = records(n)
    run = repetitive.respond(loop, r, disturbance=w, noise=noise)
    slow, _, _ = recursion(loop, r, w, noise, Limits())
    scale = max(1.0, *(np.abs(s).max() for s in slow))
    agree(run, slow, 1e-12 * scale)
    # filters of an order as long as the period, and zeros within 0.8 cancelled
    agree(run, filtered(loop, r, w, noise), 1e-9 * scale)


@each_loop
@pytest.mark.parametrize(("keep_u", "keep_v"), [(True, True), (True, False), (False, True)])
def test_a_run_with_limits_is_that_of_the_recursion(loop, keep_u, keep_v):
    """Noise, so that where a limit acted a period ago says nothing; a third of all is clipped."""
    n = 80 if isinstance(loop.repetitive, Resonators) else 1100
    r, w, noise = records(n, seed=2)
    free = repetitive.simulate(loop, r, disturbance=w, noise=0.1 * noise)
    most_v, most_u = (np.quantile(np.abs(s), 0.66) for s in (free.command, free.repetitive))
    for limits in (
        Limits(Limit(most_v, keep_v), Limit(most_u, keep_u)),
        Limits(repetitive=Limit(most_u, keep_u)),
    ):
        run = repetitive.simulate(loop, r, disturbance=w, noise=0.1 * noise, limits=limits)
        slow, ended, counts = recursion(loop, r, w, 0.1 * noise, limits)
        assert (run.unbounded, run.command_clipped, run.repetitive_clipped) == (ended, *counts)
        assert sum(counts) > n // 50
        other, _, _ = recursion(loop, r * (1 + 1e-15), w, 0.1 * noise, limits)
        # resonators with limits are chaotic: what rounding does to them grows by ten in 25 samples
        rounding = max(np.abs(s - t).max() for s, t in zip(slow, other, strict=True))
        assert rounding < 1e-9
        agree(run, slow, 100 * rounding + 1e-12 * max(1.0, *(np.abs(s).max() for s in slow)))


@pytest.mark.parametrize("inner", [True, False], ids=["inner controller", "plant alone"])
@pytest.mark.parametrize("period", [10_000, 10_000.3])
def test_long_periods_clipped_in_every_one(period, inner):
    process = random_process(np.random.default_rng(5), 4, inner)
    loop = repetitive.design(process, repetitive.plain(period, [0.05, 0.9, 0.05]), 0.8)
    n = 41_000
    r = np.sin(2 * np.pi * np.arange(n) / period) + 0.1 * records(n)[0]
    w, noise = 0.1 * records(n)[1:]
    free = repetitive.simulate(loop, r, disturbance=w, noise=noise)
    most_v, most_u = (np.quantile(np.abs(s), 0.9) for s in (free.command, free.repetitive))
    limits = Limits(Limit(most_v), Limit(1.05 * most_u))
    for some in (Limits(), limits):
        run = repetitive.simulate(loop, r, disturbance=w, noise=noise, limits=some)
        slow, ended, counts = recursion(loop, r, w, noise, some)
        assert (run.unbounded, run.command_clipped, run.repetitive_clipped) == (ended, *counts)
        agree(run, slow, 1e-12 * max(1.0, *(np.abs(s).max() for s in slow)))
    assert min(np.diff(np.searchsorted(clipped(run, limits), period * np.arange(1, 5)))) > 100


def clipped(run, limits):
    return np.flatnonzero(np.abs(run.repetitive) == limits.repetitive.value)


@pytest.mark.parametrize("limits", [Limits(), Limits(Limit(3.0)), Limits(Limit(3.0, False))])
@pytest.mark.parametrize("period", [6, 300])
def test_a_run_that_runs_away_ends_at_the_same_sample(period, limits):
    """The plant is unstable, so a limit on its command lets it run away at once."""
    process = Process(Plant([0.5], [1, -1.3, 0.2], 1, 1.0), Plant([0.9], [1.0], 0, 1.0))
    loop = repetitive.design(process, period, 2.6 if limits == Limits() else 0.5)
    n = 240 * period if limits == Limits() else 1000
    r, w, noise = records(n)
    run = repetitive.simulate(loop, 9 * r, disturbance=w, noise=noise, limits=limits)
    slow, ended, counts = recursion(loop, 9 * r, w, noise, limits)
    assert run.unbounded and ended and run.output.size == slow[0].size < n
    assert (run.command_clipped, run.repetitive_clipped) == counts
    for ours, truth in zip((run.output, run.command, run.repetitive), slow, strict=True):
        np.testing.assert_allclose(ours, truth, rtol=1e-9, atol=1e-12 * np.abs(truth).max())


def test_a_limit_that_clips_everything():
    loop = LOOPS["q 0"]
    r, w, noise = records(900)
    limits = Limits(Limit(1e-3), Limit(1e-3))
    run = repetitive.simulate(loop, r, disturbance=w, noise=noise, limits=limits)
    slow, _, counts = recursion(loop, r, w, noise, limits)
    assert (run.command_clipped, run.repetitive_clipped) == counts and min(counts) > 700
    agree(run, slow, 1e-12)


# ---- stability ----


def judged_loop(seed):
    """A loop on a plant of up to four poles, every second one not the one it was designed on."""
    rng = np.random.default_rng(seed)
    poles = rng.uniform(-0.85, 0.95, int(rng.integers(1, 5)))
    zeros = rng.choice([-2.0, -1.0, -0.5, 0.3, 0.7, 1.6], int(rng.integers(0, 4)), replace=False)
    b = rng.uniform(0.5, 2) * np.atleast_1d(np.poly(zeros))
    plant = Plant(b, np.poly(poles), int(rng.integers(1, 4)), 1.0)
    n, q = int(rng.integers(20, 90)), zdomain.binomial_q(int(rng.integers(0, 3)))
    memory = (
        repetitive.plain(n, q),
        repetitive.plain(n + 0.37, q),
        repetitive.odd_harmonic(2 * n, q),
        repetitive.several(repetitive.plain(n, q), repetitive.plain(n + 9, [0.3, 0.4, 0.3])),
    )[seed % 4]
    loop = repetitive.design(plant, memory, 0.5, form=FORMS[seed % 2])
    if seed % 8 < 4:
        return loop
    other = Plant(rng.uniform(0.4, 1.6) * b, np.poly(0.95 * poles), plant.delay + seed % 2, 1.0)
    return Loop(Process(other), loop.repetitive, loop.form)


@pytest.mark.parametrize("seed", range(40))
def test_stable_gains_are_those_from_all_roots(seed):
    loop = judged_loop(seed)
    found, truth = repetitive.stable_gains(loop), stable_factors(*open_polynomials(loop), 100.0)
    # Roots of d that are double on the circle are known to 1e-8, and a gain that brings one back to
    # it no better: what companion matrices find below 1e-6 depends on the order of their sums.
    truth = [(0.0 if low < 1e-6 else low, high) for low, high in truth]
    # companion matrices of up to 400 coefficients; 1e-4 from the circle taken to be on it
    np.testing.assert_allclose(np.ravel(found), np.ravel(truth), rtol=1e-8, atol=1e-8)


def test_a_crossing_next_to_a_harmonic_of_second_order_is_found():
    """Where d is zero twice, three zeros of Im(d conj(n)) lie within a step of the grid."""
    twice = repetitive.several(repetitive.plain(39), repetitive.plain(39))
    loop = repetitive.design(Plant([0.83], [1, 0.45], 3, 1.0), twice, 0.5)
    other = Plant([0.83253556], [1, 0.48866565], 3, 1.0)
    loop = Loop(other, loop.repetitive)
    ((low, high),) = repetitive.stable_gains(loop)
    for edge, inside in ((low, 1.01 * low), (high, 0.99 * high)):
        radius = np.abs(loop.with_gain(edge).roots).max()
        assert radius == pytest.approx(1, abs=1e-10)
        assert np.abs(loop.with_gain(inside).roots).max() < 1 - 1e-11
    assert np.abs(loop.with_gain(0.99 * low).roots).max() > 1


@pytest.mark.parametrize("order", [1, 5])
@pytest.mark.parametrize("period", [300, 1200])
def test_the_limit_at_a_long_period_is_right_to_1e_8(period, order):
    """Against a search in extended precision; most of the error left is that of the limit."""
    process = random_process(np.random.default_rng(3), order, False)
    loop = repetitive.design(process, repetitive.plain(period, zdomain.binomial_q(1)), 0.5)
    ((low, high),) = repetitive.stable_gains(loop)
    truth = lowest_crossing(*open_polynomials(loop), 16 * period)
    assert low == 0 and high == pytest.approx(truth, rel=1e-12)


def test_the_limit_of_a_period_of_ten_thousand_has_a_closed_form():
    """Exact cancellation: z^N = 1 - k."""
    loop = repetitive.design(Plant([0.4, 0.2], [1, -1.2, 0.5], 1, 1.0), 10_000, 0.5)
    ((low, high),) = repetitive.stable_gains(loop)
    assert low == 0 and high == pytest.approx(2, rel=1e-8)
    np.testing.assert_allclose(repetitive.spectral_radii(loop, [0.3, 1.9]), [0.7, 0.9], rtol=1e-9)


@pytest.mark.parametrize("seed", range(40))
def test_spectral_radii_are_those_of_all_roots(seed):
    loop = judged_loop(seed)
    gains = np.r_[np.random.default_rng(seed).uniform(0.02, 4, 4), 1.02]
    found = repetitive.spectral_radii(loop, gains)
    truth = np.array([np.abs(loop.with_gain(k).roots).max() for k in gains])
    # a double root of the plant, or of two memories, is known to the root of rounding only
    tolerance = 1e-10 if seed % 4 < 3 else 1e-7
    np.testing.assert_allclose(found ** (1 / loop.period), truth, rtol=tolerance)


def test_spectral_radii_have_the_shape_of_the_gains():
    loop = judged_loop(0)
    found = repetitive.spectral_radii(loop, [[0.3, 0.9, 1.4]] * 2)
    assert found.shape == (2, 3)
    for row in found:
        for radius, gain in zip(row, (0.3, 0.9, 1.4), strict=True):
            alone = repetitive.spectral_radius(loop.with_gain(gain))
            assert radius == pytest.approx(alone, rel=1e-10)
            assert repetitive.spectral_radii(loop, gain) == pytest.approx(alone, rel=1e-10)
    with pytest.raises(ValueError, match="gains hold -1; give positive"):
        repetitive.spectral_radii(loop, [0.5, -1.0])
    with pytest.raises(ValueError, match="no repetitive controller"):
        repetitive.spectral_radii(Loop(loop.process), [0.5])


@pytest.mark.parametrize("missing", ["outermost", "twice"])
def test_a_root_that_is_not_found_is_missed(monkeypatch, missing):
    """A mutant: candidates without the outermost, or with another in its place."""
    loop, gains = judged_loop(4), np.array([0.3, 1.3, 2.5])
    assert loop.process.plant.a.size + loop.period > radii.SHORT
    truth = repetitive.spectral_radii(loop, gains)
    whole = radii._candidates

    def wrong(*args):
        roots = whole(*args)
        last = np.arange(gains.size), np.nanargmax(roots.real, axis=1)
        roots[last] = np.nan if missing == "outermost" else roots[last] - 0.5
        return roots

    monkeypatch.setattr(radii, "_candidates", wrong)
    np.testing.assert_allclose(repetitive.spectral_radii(loop, gains), truth, rtol=1e-9)
