"""Chatter against exact roots, Hill's matrix, winding numbers, closed forms and energy balance."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
from oracles.chatter import characteristic, exact_exponent, roots_right_of

from rcbook.machines import chatter
from rcbook.machines.chatter import RPM, Cut, Mode

BAR = chatter.HANSON_TSAO2000
MODE = BAR.mode
LEAST = chatter.least_limit(MODE)
LAWS = ["time", "angle"]
FAST = Cut(MODE, 2.0 * LEAST, 6000 * RPM, 0.2, 0.25)  # nine waves a turn: cheap


def exponent(result):
    """Floquet exponent in 1/rad of spindle angle."""
    return np.log(result.multiplier) / (2 * np.pi * result.turns)


# ---- the mode, the lobes, the roots ----


def test_the_mode_of_eq_17():
    assert MODE.natural_frequency == pytest.approx(np.sqrt(12.8e6 / 0.365), rel=1e-14)
    assert MODE.damping_ratio == pytest.approx(208 / 2 / np.sqrt(0.365 * 12.8e6), rel=1e-14)
    # 1/(2 max(-Re G)) on a fine grid of frequencies
    s = 1j * np.linspace(0.9, 1.3, 400_001) * MODE.natural_frequency
    g = 1 / (MODE.mass * s**2 + MODE.damping * s + MODE.stiffness)
    assert pytest.approx(-1 / (2 * g.real.min()), rel=1e-9) == LEAST


@pytest.mark.parametrize("speed", [700.0, 1000.0, 6000.0, 20_000.0, 90_000.0, 400_000.0])
def test_a_pair_of_roots_crosses_at_the_lobe(speed):
    """Just below the limit no root lies to the right, just above it one pair does."""
    tau = 60 / speed
    limit, frequency = chatter.lobes(MODE, speed * RPM)
    assert roots_right_of(MODE, 0.9999 * limit, tau, 0.0) == 0
    assert roots_right_of(MODE, 1.0001 * limit, tau, 0.0) == 2
    residue = characteristic(MODE, limit, tau, 1j * frequency)
    assert abs(residue) < 1e-9 * MODE.stiffness


def test_the_lobes_touch_the_least_limit_and_never_pass_it():
    speeds = np.linspace(5000, 60_000, 4001) * RPM
    limits, frequencies = chatter.lobes(MODE, speeds)
    assert limits.shape == frequencies.shape == speeds.shape
    assert np.all(limits >= LEAST)
    assert limits.min() == pytest.approx(LEAST, rel=1e-4)  # as near as the grid of speeds comes
    assert np.all(frequencies > MODE.natural_frequency)


@pytest.mark.parametrize("speed", [1000.0, 6000.0, 30_000.0, 300_000.0])
@pytest.mark.parametrize("ratio", [0.05, 0.5, 1.0, 3.0])
def test_no_root_lies_right_of_the_rightmost(speed, ratio):
    cut = Cut(MODE, ratio * LEAST, speed * RPM)
    root = chatter.rightmost_root(cut)
    tau = 60 / speed
    size = abs(characteristic(MODE, ratio * LEAST, tau, root))
    assert size < 1e-8 * MODE.stiffness
    assert roots_right_of(MODE, ratio * LEAST, tau, root.real + 0.05) == 0
    assert roots_right_of(MODE, ratio * LEAST, tau, root.real - 0.05) == 2


# ---- the spindle ----


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("rva", [0.0, 0.2, -0.35, 0.9, 0.999])
def test_the_clock_integrates_the_speed_law(law, rva):
    cut = Cut(MODE, LEAST, 100.0, rva, 0.3, law)
    angle = np.linspace(0, 60, 13)
    time, speed = chatter.clock(cut, angle)
    assert time[0] == pytest.approx(0, abs=1e-15)
    if law == "time":  # eq. 15 and its integral
        phase = 0.3 * 100 * time
        turned = 100 * time + rva / 0.3 * (1 - np.cos(phase))
        np.testing.assert_allclose(turned, angle, rtol=1e-12, atol=1e-12)
    else:
        phase = 0.3 * angle
        options = {"epsabs": 1e-13, "epsrel": 1e-10, "limit": 2000}
        slowest = [(1.5 * np.pi + 2 * np.pi * i) / 0.3 for i in range(-1, 4)]
        for a, b, passed in zip(angle, angle[1:], np.diff(time), strict=False):
            points = [p for p in slowest if a < p < b] or None
            value = scipy.integrate.quad(
                lambda x: 1 / (100 * (1 + rva * np.sin(0.3 * x))), a, b, points=points, **options
            )[0]
            assert passed == pytest.approx(value, rel=1e-8)
    np.testing.assert_allclose(speed, 100 * (1 + rva * np.sin(phase)), rtol=1e-9)


def test_the_mean_speed_over_time():
    rva = np.array([0.0, 0.2, 0.6])
    assert Cut(MODE, LEAST, 100.0, rva, 0.3).mean_speed == pytest.approx(100.0, rel=1e-12)
    slower = Cut(MODE, LEAST, 100.0, rva, 0.3, "angle").mean_speed
    assert slower == pytest.approx(100 * np.sqrt(1 - rva**2), rel=1e-12)


# ---- Floquet multipliers ----


def test_multiplier_at_constant_speed_is_the_exact_one():
    """e^(s tau) for the rightmost root; 24 steps a cycle err by 2/24^4 of K, 6e-6."""
    cut = Cut(
        MODE, np.array([[0.5], [1.0], [3.0]]) * LEAST, np.array([800, 1000, 7000, 31e3]) * RPM
    )
    exact = chatter.rightmost_root(cut)
    found = chatter.floquet(cut, per_cycle=24, tolerance=1e-10)
    assert found.multiplier.shape == (3, 4)
    np.testing.assert_allclose(
        found.multiplier.real, np.exp(exact * 2 * np.pi / cut.speed).real, atol=1e-4
    )
    np.testing.assert_allclose(found.growth, exact.real, atol=1.2e-3)  # 200/s per 100 percent of K
    assert np.all(found.turns == 1) and np.all(found.residual < 1e-10)
    # a delay that is wrong by one step of some 1400 a turn shows
    slipped = chatter.rightmost_root(replace(cut, speed=cut.speed * (1 + 1 / 1400)))
    assert np.abs(found.growth - slipped.real)[:, 1].max() > 1.2e-2


def test_errors_fall_with_the_fourth_power_of_the_step():
    cut = Cut(MODE, 2 * LEAST, 3000 * RPM)
    exact = chatter.rightmost_root(cut).real
    errors = [abs(chatter.floquet(cut, n, tolerance=1e-12).growth - exact) for n in (10, 20, 40)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 4, atol=0.1)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("rva, rvf", [(0.2, 0.25), (0.1, 0.5), (0.3, 1.0), (0.2, 2.0), (0.25, 0.4)])
def test_multiplier_at_varying_speed_makes_hills_matrix_singular(law, rva, rvf):
    cut = replace(FAST, rva=rva, rvf=rvf, law=law)
    found = exponent(chatter.floquet(cut, per_cycle=32, tolerance=1e-11))
    exact = exact_exponent(cut, found)
    # 2/32^4 of K is 2e-6; the exponent of a turn moves by some ten times that
    assert abs(found - exact) < 1e-5
    slower = exact_exponent(replace(cut, speed=cut.speed / 1.01), found)
    assert abs(found - slower) > 1e-4


def test_hills_matrix_is_long_enough():
    found = exponent(chatter.floquet(FAST, 16))
    assert exact_exponent(FAST, found, 90) == pytest.approx(exact_exponent(FAST, found), abs=1e-9)


def test_errors_at_varying_speed_fall_with_the_fourth_power_too():
    guess = exponent(chatter.floquet(FAST, 32))
    exact = exact_exponent(FAST, guess)
    errors = [abs(exponent(chatter.floquet(FAST, n, 1e-12)) - exact) for n in (10, 20, 40)]
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 4, atol=0.25)


@pytest.mark.parametrize("rvf", [0.2, 1.0, 3.0, 0.37])
def test_a_variation_of_size_zero_has_no_effect(rvf):
    exact = chatter.rightmost_root(Cut(MODE, 1.5 * LEAST, 5000 * RPM)).real
    still = chatter.floquet(Cut(MODE, 1.5 * LEAST, 5000 * RPM, 0.0, rvf), 24)
    assert still.growth == pytest.approx(exact, abs=2e-3)


@pytest.mark.parametrize("law", LAWS)
def test_half_a_period_later_is_the_same_machine(law):
    ahead = chatter.floquet(replace(FAST, law=law), 20, 1e-10)
    late = chatter.floquet(replace(FAST, rva=-0.2, law=law), 20, 1e-10)
    assert late.multiplier == pytest.approx(ahead.multiplier, rel=1e-4)


def test_units_do_not_matter():
    """Forces in another unit leave the growth alone; time in another unit scales it."""
    heavy = Mode(MODE.mass * 7, MODE.damping * 7, MODE.stiffness * 7)
    slow = Mode(MODE.mass * 9, MODE.damping * 3, MODE.stiffness)
    here = chatter.floquet(FAST)
    there = chatter.floquet(replace(FAST, mode=heavy, cutting_stiffness=14 * LEAST))
    later = chatter.floquet(replace(FAST, mode=slow, speed=FAST.speed / 3))
    assert there.multiplier == pytest.approx(here.multiplier, rel=1e-9)
    assert 3 * later.growth == pytest.approx(here.growth, rel=1e-8)


def test_a_chart_is_its_points():
    """Batches of mixed speeds and ratios come back in their places."""
    cut = Cut(MODE, 2 * LEAST, np.array([[5000.0], [9000.0]]) * RPM, 0.2, [0.5, 0.2, 1.0])
    chart = chatter.floquet(cut, 16)
    for i in range(2):
        for j in range(3):
            one = chatter.floquet(replace(FAST, speed=cut.speed[i, j], rvf=cut.rvf[i, j]), 16)
            assert chart.growth[i, j] == pytest.approx(one.growth, rel=2e-3)
    np.testing.assert_allclose(chart.turns, [[2, 5, 1]] * 2)


# ---- limits ----


def test_limit_at_constant_speed_is_the_lobe():
    speeds = np.array([1000, 5200, 14_000, 40_000]) * RPM
    found = chatter.stability_limit(Cut(MODE, 1.0, speeds), precision=1e-5, per_cycle=20)
    # the bisection's 1e-5 and the step's 2/20^4 = 1.3e-5
    np.testing.assert_allclose(found, chatter.lobes(MODE, speeds)[0], rtol=3e-5)


def test_limit_at_varying_speed_is_where_the_growth_is_zero():
    limit = chatter.stability_limit(FAST, precision=1e-5, per_cycle=32)
    found = exponent(chatter.floquet(replace(FAST, cutting_stiffness=limit), 32))
    assert abs(exact_exponent(replace(FAST, cutting_stiffness=limit), found).real) < 1e-5


def test_a_limit_beyond_the_search_is_infinite():
    one_lobe = Cut(MODE, 1.0, MODE.natural_frequency * 0.97)  # between two lobes
    assert chatter.lobes(MODE, one_lobe.speed)[0] > 3 * LEAST
    assert chatter.stability_limit(one_lobe, highest=2.0) == np.inf


# ---- simulation ----


def test_the_first_turn_is_a_free_oscillation_in_contact():
    """The old surface is smooth for one turn, so the blow rings down with stiffness k + K."""
    cut = Cut(MODE, LEAST, 6000 * RPM, 0.2, 0.25)
    run = chatter.simulate(cut, 0.99, 1e-4, kick=0.01, per_cycle=200)
    decay = MODE.damping / (2 * MODE.mass)
    ringing = np.sqrt((MODE.stiffness + LEAST) / MODE.mass - decay**2)
    swing = 0.01 / ringing * np.exp(-decay * run.time) * np.sin(ringing * run.time)
    # the phase after nine cycles is off by pi 9 3/200^2 K/k, 2e-4, of 1.6 um
    exact = LEAST * 1e-4 / MODE.stiffness + swing
    np.testing.assert_allclose(run.displacement, exact, atol=3e-10)
    assert run.velocity[0] == pytest.approx(0.01, rel=1e-14)
    assert run.force[0] == LEAST * 1e-4


def test_simulation_errors_fall_with_the_square_of_the_step():
    """Also with loss of contact, where the force has kinks."""
    cut = Cut(MODE, 3 * LEAST, 9000 * RPM, 0.2, 0.5)
    fine, *coarse = (
        chatter.simulate(cut, 3, 1e-4, kick=1.5, per_cycle=n) for n in (1280, 20, 40, 80, 160)
    )
    assert fine.in_contact.mean() < 0.9
    errors = [
        np.std(r.displacement - np.interp(r.angle, fine.angle, fine.displacement)) for r in coarse
    ]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 2, atol=0.35)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("rva, ratio", [(0.0, 1.3), (0.2, 2.2), (0.2, 3.2)])
def test_simulated_growth_is_the_multiplier(law, rva, ratio):
    """In contact throughout, measured over ten speed periods after ten have gone by."""
    cut = Cut(MODE, ratio * LEAST, 6000 * RPM, rva, 0.5, law)
    expected = chatter.floquet(cut, 20)
    run = chatter.simulate(cut, 44, 1.0, kick=1e-5)
    assert run.in_contact.all()
    swing = run.displacement - cut.cutting_stiffness / MODE.stiffness
    early, late = (swing[a * run.per_turn : (a + 4) * run.per_turn] for a in (20, 40))
    growth = np.log(np.std(late) / np.std(early)) / (40 * np.pi / cut.mean_speed)
    # 3/40^2 of K is 0.2 percent, and K moves the growth by some 60/s per 100 percent here
    assert growth == pytest.approx(expected.growth, abs=0.6)
    wrong = chatter.floquet(replace(cut, speed=cut.speed * 1.02), 20)
    assert abs(wrong.growth - expected.growth) > 0.6


def test_the_first_turns_of_a_run_are_the_shorter_run():
    """Bit for bit, for cuts that share a clock and one that does not."""
    cut = Cut(MODE, np.array([1.2, 2.5]) * LEAST, 6000 * RPM, np.array([[0.0], [0.2]]), 0.5)
    push = chatter.noise(1.0, 200, 2000, np.random.default_rng(2), 20)
    short, long = (chatter.simulate(cut, n, 1e-4, 0.1, push) for n in (7, 12))
    cropped = long.until(7)
    for name in ("angle", "time", "displacement", "velocity", "force", "surface"):
        assert np.array_equal(getattr(cropped, name), getattr(short, name))
    alone = chatter.simulate(Cut(MODE, 2.5 * LEAST, 6000 * RPM, 0.2, 0.5), 7, 1e-4, 0.1, push)
    assert alone.per_turn == short.per_turn
    np.testing.assert_allclose(short.displacement[1, 1], alone.displacement, rtol=1e-9)
    assert short.time.shape == (2, 2, short.angle.size)


def test_chatter_ends_in_a_bounded_motion_with_air_cuts():
    cut = Cut(MODE, np.array([1.2, 1.6, 2.5]) * LEAST, 6000 * RPM)
    run = chatter.simulate(cut, 160, 1e-4, kick=0.1)
    assert np.all(run.force >= 0)
    assert np.all(run.in_contact.mean(axis=-1) < 1)
    middle = [
        np.std(run.displacement[:, a * run.per_turn : (a + 40) * run.per_turn], axis=-1)
        for a in (80, 120)
    ]
    np.testing.assert_allclose(middle[1], middle[0], rtol=0.1)  # it no longer grows
    # a removed chip cannot be thicker than all the passes that left it
    assert np.all(run.force < run.cut.cutting_stiffness[:, None] * 1e-4 * 160)


def test_a_varying_speed_quiets_a_cut_that_chatters():
    """Two methods agree on the paper's cutting speed: a fifth helps, a whole turn does not."""
    cut = replace(BAR, cutting_stiffness=1.6 * LEAST, rva=[0.0, 0.2, 0.2], rvf=[0.2, 0.2, 1.0])
    assert list(chatter.floquet(cut).growth > 0) == [True, False, True]
    run = chatter.simulate(cut, 25, 1e-4, kick=0.1, per_cycle=24)
    still, varied, in_step = run.vibration(15)
    assert min(still, in_step) > 100 * varied
    assert list(run.in_contact.all(axis=-1)) == [False, True, False]


def test_in_a_limit_cycle_the_force_gives_what_the_damper_takes():
    cut = Cut(MODE, 1.3 * LEAST, 6000 * RPM)
    run = chatter.simulate(cut, 200, 1e-4, kick=1e-5, per_cycle=80)
    last = slice(-100 * run.per_turn, None)
    given = np.mean(run.force[last] * run.velocity[last])
    taken = MODE.damping * np.mean(run.velocity[last] ** 2)
    assert taken > 0
    assert given == pytest.approx(taken, rel=0.01)


def test_the_force_is_the_chip_between_tool_and_old_surface():
    cut = Cut(MODE, 3 * LEAST, 6000 * RPM, 0.2, 0.5)
    run = chatter.simulate(cut, 60, 1e-4, kick=0.1)
    n = run.per_turn
    chip = run.surface[:-n] + 1e-4 - run.displacement[n:]
    np.testing.assert_allclose(
        run.force[n:], cut.cutting_stiffness * np.maximum(0, chip), atol=1e-9 * run.force.max()
    )
    assert not run.in_contact.all()
    # and in the air the old surface stays, one chip farther
    air = np.flatnonzero(run.force[n:] == 0)
    np.testing.assert_allclose(run.surface[n:][air], run.surface[:-n][air] + 1e-4, rtol=1e-12)


def test_a_chip_of_twice_the_size_makes_twice_the_chatter():
    cut = Cut(MODE, 1.5 * LEAST, 6000 * RPM)
    small = chatter.simulate(cut, 30, 1e-4, kick=0.1)
    large = chatter.simulate(cut, 30, 2e-4, kick=0.2)
    np.testing.assert_allclose(large.displacement, 2 * small.displacement, atol=1e-9)
    assert not small.in_contact.all()


def test_no_kick_no_motion():
    run = chatter.simulate(FAST, 3, 1e-4)
    np.testing.assert_allclose(run.displacement, 2 * LEAST * 1e-4 / MODE.stiffness, rtol=1e-10)
    assert run.vibration(2) < 1e-15


def test_a_stable_cut_answers_to_a_slow_force_as_its_stiffness():
    """At a tenth of the natural frequency and a spindle too fast to see waves: 1 percent."""
    cut = Cut(MODE, 1e-6 * LEAST, 6000 * RPM)
    run = chatter.simulate(cut, 40, 1e-9, disturbance=lambda t: 10 * np.sin(2 * np.pi * 94.25 * t))
    expected = 10 / MODE.stiffness / np.sqrt(2) / abs(1 - 0.1**2 + 2j * MODE.damping_ratio * 0.1)
    assert run.vibration(20 * 6000 / 60 / 94.25) == pytest.approx(expected, rel=0.01)


def test_noise_has_its_rms_and_is_a_function_of_time():
    force = chatter.noise(3.0, 200, 2000, np.random.default_rng(5))
    time = np.arange(50_000) / 7_000
    assert np.sqrt(np.mean(force(time) ** 2)) == pytest.approx(3.0, rel=0.05)
    np.testing.assert_allclose(force(time[::7]), force(time)[::7])


# ---- bad input ----


REFUSED = [
    ("mass", lambda: Mode(0.0, 1, 1), r"mass = 0\.0 must be a positive"),
    ("stiffness NaN", lambda: Mode(1, 1, np.nan), "stiffness = nan must be a positive"),
    ("overdamped", lambda: Mode(1, 3.0, 1), r"damping = 3\.0 .* choose less than 1"),
    ("stiffness 0", lambda: replace(BAR, cutting_stiffness=0), "cutting_stiffness = 0.0 must lie"),
    ("speed", lambda: replace(BAR, speed=[1, -3.0]), r"speed = -3\.0 must lie between 0 and inf"),
    ("stopping", lambda: replace(BAR, rva=1.0), r"rva = 1\.0 must lie between -1 and 1"),
    ("rvf", lambda: replace(BAR, rvf=np.nan), "rvf = nan must lie"),
    ("text", lambda: replace(BAR, speed="fast"), "speed = 'fast' must hold real numbers"),
    ("law", lambda: replace(BAR, law="sine"), "law 'sine' is none of time, angle"),
    (
        "shapes",
        lambda: replace(BAR, speed=[1.0, 2.0], rva=[0, 0.1, 0.2]),
        r"shapes .* do not broadcast; make them agree",
    ),
    ("clock", lambda: chatter.clock(BAR, [0, np.inf]), "angle = .*give finite"),
    ("lobes", lambda: chatter.lobes(MODE, 0.0), r"speed = 0\.0 must lie"),
    ("root", lambda: chatter.rightmost_root(BAR), r"rva = .*0\.2.*set rva = 0"),
    ("coarse", lambda: chatter.floquet(BAR, 3), "per_cycle = 3 must be a whole number not below 4"),
    ("tolerance", lambda: chatter.floquet(BAR, 10, 0.0), r"tolerance = 0\.0 must be a positive"),
    ("long period", lambda: chatter.floquet(replace(BAR, rvf=1e-6)), "rvf = 1e-06 needs .* higher"),
    (
        "outgrown",
        lambda: chatter.floquet(replace(FAST, cutting_stiffness=9 * LEAST, rvf=1e-3, rva=0.01)),
        "outgrows all numbers in one period; choose a larger rvf",
    ),
    (
        "precision",
        lambda: chatter.stability_limit(BAR, precision=0.0),
        r"precision = 0\.0 must be a positive",
    ),
    ("ratio", lambda: chatter.stability_limit(BAR, ratio=1.0), r"ratio = 1\.0 must be above 1"),
    ("highest", lambda: chatter.stability_limit(BAR, highest=0.5), "highest = 0.5 must be above 1"),
    ("turns", lambda: chatter.simulate(BAR, 0, 1e-4), "turns = 0 must be a positive"),
    ("chip", lambda: chatter.simulate(BAR, 1, -1e-4), "chip = -0.0001 must be a positive"),
    ("kick", lambda: chatter.simulate(BAR, 1, 1e-4, np.inf), "kick = inf must be a real"),
    ("step", lambda: chatter.simulate(BAR, 1, 1e-4, per_cycle=4), "per_cycle = 4 must be"),
    (
        "disturbance",
        lambda: chatter.simulate(BAR, 1, 1e-4, disturbance=lambda t: np.zeros(3)),
        r"disturbance has shape \(3,\) .*sample by sample",
    ),
    (
        "record",
        lambda: chatter.simulate(FAST, 1, 1e-4).vibration(5),
        "turns = 5 are not in the record; simulate longer",
    ),
    (
        "band",
        lambda: chatter.noise(1.0, 300, 200, np.random.default_rng(0)),
        r"lowest = 300\.0 must lie below highest = 200\.0",
    ),
]


@pytest.mark.parametrize("call, message", [r[1:] for r in REFUSED], ids=[r[0] for r in REFUSED])
def test_bad_input_is_refused_at_the_door(call, message):
    with pytest.raises(ValueError, match=message):
        call()


# ---- the average over the speeds ----


def test_a_wave_grows_from_turn_to_turn_above_the_least_limit():
    """|K| = |m s^2 + c s + k + K| first at the least limit, at w = wn sqrt(1 + 2 zeta), by hand."""
    weakest = MODE.natural_frequency * np.sqrt(1 + 2 * MODE.damping_ratio)
    factor = chatter.surface_factor(MODE, chatter.least_limit(MODE), weakest)
    assert abs(factor) == pytest.approx(1, rel=1e-12)
    near = weakest * np.array([0.99, 1.01])
    assert np.all(np.abs(chatter.surface_factor(MODE, chatter.least_limit(MODE), near)) < 1)


def test_the_average_at_constant_speed_is_the_least_limit():
    cut = chatter.Cut(MODE, 1e6, 100.0, rva=[0.0, 1e-6])
    assert chatter.averaged_limit(cut) == pytest.approx(chatter.least_limit(MODE), rel=1e-4)


@pytest.mark.parametrize(("rva", "close"), [(0.1, 0.02), (0.2, 0.02), (0.3, 0.03)])
def test_the_average_is_close_to_the_limit_where_speeds_average_out(rva, close):
    """One period of the speed in 7.7 turns; against the multipliers, which know all phases."""
    cut = replace(chatter.HANSON_TSAO2000, rva=rva, rvf=0.13)
    exact = chatter.stability_limit(cut, precision=2e-3, per_cycle=8)
    assert chatter.averaged_limit(cut) == pytest.approx(exact, rel=close)


def test_the_average_is_that_of_an_integral():
    """At the limit no number of waves has a mean log above zero, and one has zero: by quadrature
    over the angle, where the law is one in angle and its speed is known in closed form."""
    cut = replace(chatter.HANSON_TSAO2000, rva=0.25, law="angle")
    limit = float(chatter.averaged_limit(cut))

    def mean(wave):
        def logarithm(angle):
            s = 1j * wave * (1 + 0.25 * np.sin(angle))
            return np.log(
                abs(limit / (MODE.mass * s**2 + MODE.damping * s + MODE.stiffness + limit))
            )

        return scipy.integrate.quad(logarithm, 0, 2 * np.pi, epsabs=1e-9)[0] / (2 * np.pi)

    waves = MODE.natural_frequency * np.linspace(0.8, 1.6, 81)
    assert max(map(mean, waves)) == pytest.approx(0, abs=2e-3)
