"""The milling chapter's numbers against small programs that share no code with the package.

Everything starts from the printed eq. 6 and the gains of the text: plain loops over eqs 24 to 28
(eq. 25 moved as the errata say) round a plant that is a sum over its impulse response, the closed
form of the staircase, partial fractions, and roots of polynomials multiplied out by hand.
"""

import nbformat
import numpy as np
import pytest
from conftest import ROOT
from scipy.optimize import brentq, minimize

from rcbook import ledger
from rcbook.book import falsify

KEY = "horng1989"
A1, A2, B0, B1 = -0.7537, -0.2404, 9.0452, -7.8975  # eq. 6
KP, KI = 0.064, 0.032  # eq. 11
DT = 1 / 60  # s
SLOW, FAST = (-A1 + np.array([1, -1]) * np.sqrt(A1**2 - 4 * A2)) / 2  # poles of eq. 7
SAME = 1e-9  # the same sums in another order; settling times fall on the same sample


@pytest.fixture(scope="module")
def computed():
    """What the notebook computes for every claim."""
    (trial,) = falsify.trials(ledger.load(KEY), ROOT / "notebooks", [("", None)])
    assert not trial.troubles
    return {id.removeprefix(f"{KEY}."): value for id, value in trial.computed.items()}


# ---- the thesis's equations once more ----


def closed_loop(kp=KP, ki=KI, a1=A1, a2=A2, b0=B0, b1=B1):
    """P and Q of eq. 12, multiplied out."""
    p = [1, a1 - 1 + kp * b0, a2 - a1 + kp * b1 + ki * b0, -a2 + ki * b1]
    return p, [kp * b0, kp * b1 + ki * b0, ki * b1]


P, Q = closed_loop()


def modes(t, sine=0.0):
    """Step response of eq. 7 after t intervals of 1/60 s, whole or not: a lag, a damped cosine."""
    gains = [(B0 * p + B1) / (p - q) / (1 - p) for p, q in ((SLOW, FAST), (FAST, SLOW))]
    swing = np.abs(FAST) ** t * (np.cos(np.pi * t) + sine * np.sin(np.pi * t))
    return gains[0] * (1 - SLOW**t) + gains[1] * (1 - swing)


def impulse(n, per_turn=6, sine=0.0):
    """Force after one sample of one millivolt, `per_turn` samples in each tenth of a second."""
    return np.diff(modes(np.arange(n) * 6 / per_turn, sine), prepend=0.0)


def wave(n, per_turn=6, size=0.3):
    return size * np.sin(2 * np.pi * np.arange(n) / per_turn + 2 * np.pi / 3)


def run(gain, w, per_turn=6, start=0, h=None, pi=(KP, KI), limits=(np.inf, np.inf)):
    """Force and PI command after a step of 20 lb; without the memory where `gain` is None."""
    n, before = len(w), 2 * per_turn + 8
    h = impulse(n, per_turn) if h is None else h
    force, command, memory, error, inner = np.zeros((5, before + n))  # zeros before the start
    sent = np.zeros(n)
    for k in range(start, n):
        i = before + k
        force[i] = h[1 : k + 1][::-1] @ sent[:k]
        error[i] = 20 - force[i]
        u = sum(Q[j] * memory[i - per_turn - j] for j in range(3))
        u -= Q[1] * memory[i - 1] + Q[2] * memory[i - 2]
        u += sum((gain or 0) * P[j] * error[i - per_turn + 1 - j] for j in range(4))
        memory[i] = 20 if gain is None else np.clip(u / Q[0], -limits[1], limits[1])
        inner[i] = memory[i] - force[i]
        wanted = command[i - 1] + pi[0] * inner[i] + pi[1] * inner[i - 1]
        command[i] = np.clip(wanted, -limits[0], limits[0])
        sent[k] = command[i] + w[k]
    return force[before:], command[before:]


def settled(y, band, dt=DT, goal=20.0):
    """Instant of the sample from which on nothing leaves the band; infinite when it goes on."""
    outside = [k for k in range(len(y)) if abs(y[k] - goal) > band]
    if outside and outside[-1] >= len(y) - 10:
        return np.inf
    return (outside[-1] + 1) * dt if outside else 0.0


def overshoot(y):
    return 100 * (max(y) / 20 - 1)


QUIET, SHAKEN = np.zeros(240), wave(240)


# ---- the model and the PI loop ----


def test_two_seconds_of_the_unit_step_are_88_pounds_and_not_89(computed):
    # the alternative text once said 89
    final = (B0 + B1) / (1 + A1 + A2)
    assert modes(120.0) == pytest.approx(88.4, abs=0.05)
    assert computed["fig3.no-convergence"]["part_late"] == pytest.approx(modes(120.0) / final)
    assert computed["fig3.no-convergence"]["time_constant_s"] == pytest.approx(
        -DT / np.log(SLOW), rel=SAME
    )


def test_plant_alone_settles_in_eight_seconds_and_the_pi_loop_in_eight_samples(computed):
    final = (B0 + B1) / (1 + A1 + A2)
    alone = settled(modes(np.arange(1200.0)), 0.1 * final, goal=final)
    force, _ = run(None, QUIET)
    row = computed["ch5.order-settling"]
    assert (row["alone_s"], row["pi_s"]) == pytest.approx((alone, settled(force, 2)), rel=SAME)


def test_window_of_real_poles_is_that_of_the_discriminant(computed):
    """The locus meets where the discriminant of the cubic P changes its sign."""

    def discriminant(kp):
        p, _ = closed_loop(kp, kp / 2)
        a, b, c, d = p
        return 18 * a * b * c * d - 4 * b**3 * d + (b * c) ** 2 - 4 * a * c**3 - 27 * (a * d) ** 2

    row = computed["fig5.real-poles"]
    window = brentq(discriminant, 0.03, 0.06), brentq(discriminant, 0.06, 0.1)
    assert (row["real_from"], row["real_up_to"]) == pytest.approx(window, rel=1e-7)  # double roots

    def jury(kp):
        (_, b, c, d), _ = closed_loop(kp, kp / 2)
        return min(1 + b + c + d, 1 - b + c - d, 1 - d**2 - abs(c - b * d))

    assert row["stable_up_to"] == pytest.approx(brentq(jury, 0.1, 0.4), rel=1e-7)


def test_step_of_the_pi_loop(computed):
    force, command = run(None, np.zeros(600))
    assert computed["fig6.overshoot"] == pytest.approx(overshoot(force), rel=SAME)
    assert computed["fig6.settling-10"] == pytest.approx(settled(force, 2), rel=SAME)
    assert computed["fig7.max-command"] == pytest.approx(max(command), rel=SAME)
    assert computed["fig7.time-of-max"] == pytest.approx(np.argmax(command) * DT, rel=SAME)
    assert computed["fig7.final-command"] == pytest.approx(
        20 * (1 + A1 + A2) / (B0 + B1),
        rel=1e-6,  # what is left of the transient after 10 s
    )


def test_the_rival_pair_of_gains_is_better_in_both(computed):
    row = computed["ch3.trade-off"]
    force, _ = run(None, QUIET, pi=(row["kp"], row["kp"] * (row["alpha"] - 1)))
    assert (row["overshoot"], row["settling_s"]) == pytest.approx(
        (overshoot(force), settled(force, 2)), rel=SAME
    )
    ours, _ = run(None, QUIET)
    assert overshoot(force) < overshoot(ours) and settled(force, 2) < settled(ours, 2)


def test_runout_under_pi_control_is_6_pounds_from_peak_to_peak(computed):
    force, _ = run(None, wave(600))
    assert computed["fig9.force-amplitude"] == pytest.approx(np.ptp(force[540:]), rel=1e-7)
    z = np.exp(2j * np.pi / 6)
    controller = KP + KI / z
    angle = np.degrees(np.angle(-controller / (1 - 1 / z)))
    assert computed["fig10.opposite-phase"] == pytest.approx(abs(angle), rel=1e-7)


# ---- zeros and poles outside the unit circle ----


def test_a_cancelled_zero_outside_stays_as_a_root(computed):
    """Eq. 15 divides by Q; the zero of eq. 7 mirrored is b0 over -b1."""
    assert computed["ch5.unstable-zero"]["root"] == pytest.approx(-B0 / B1, rel=1e-9)
    assert computed["ch5.unstable-zero"]["ranges"] == 0
    grown = computed["ch5.unstable-zero"]
    # after two seconds the mode has grown by its 120th power, within the size of its start
    assert 1 < grown["command_lb"] / (-B0 / B1) ** 120 < 100
    assert grown["force_lb"] < 25


def test_pi_control_holds_the_plant_with_either_pole_outside(computed):
    """Cubics multiplied out; with the fast pole outside only a negative Kp will do."""
    row = computed["ch7.unstable-poles"]
    assert (row["slow"], row["fast"]) == pytest.approx((1 / SLOW, 1 / FAST), rel=SAME)
    a1, a2 = -(1 / SLOW + FAST), FAST / SLOW
    largest = max(abs(np.roots(closed_loop(a1=a1, a2=a2)[0])))
    assert row["with_slow"] == pytest.approx(largest, rel=1e-9) and largest < 1
    a1, a2 = -(SLOW + 1 / FAST), SLOW / FAST
    grid = ((kp, alpha) for kp in np.linspace(0.02, 0.14, 49) for alpha in np.linspace(1, 2, 41))
    least = min(
        max(abs(np.roots(closed_loop(kp, kp * (alpha - 1), a1, a2)[0]))) for kp, alpha in grid
    )
    assert row["on_map"] == pytest.approx(least, rel=1e-9) and least > 1
    p = closed_loop(row["kp"], row["ki"], a1, a2)[0]
    assert row["with_fast"] == pytest.approx(max(abs(np.roots(p))), rel=1e-9)
    assert row["with_fast"] < 1 and row["kp"] < 0
    # Jury's conditions: values at 1 and -1, and the product of the roots
    b, c, d = p[1:]
    assert min(1 + b + c + d, 1 - b + c - d, 1 - d**2 - abs(c - b * d)) > 0
    # the product limits ki; with the largest and Kp = 0 the value at -1 has the wrong sign, and
    # it grows with Kp: for no Kp >= 0 is there an integral gain
    most_ki = (-a2 + 1) / -B1
    assert np.polyval(closed_loop(0.0, most_ki, a1, a2)[0], -1) > 0 and B0 > B1


def test_a_late_sample_takes_the_fast_pole_from_pi_control(computed):
    """The same grid with the numerator a sample later; a local search finds nothing below one."""
    open_loop = np.pad(np.convolve([1, -1], [1, -(SLOW + 1 / FAST), SLOW / FAST]), (0, 1))

    def radius(gains):
        return max(abs(np.roots(open_loop + np.pad(np.convolve(gains, [B0, B1]), (2, 0)))))

    pairs = [(kp, ki) for kp in np.linspace(-0.975, 0.975, 40) for ki in np.linspace(0.05, 1, 20)]
    best = min(pairs, key=radius)
    assert computed["ch7.unstable-poles"]["later"] == pytest.approx(radius(best), rel=1e-9)
    found = minimize(radius, best, method="Nelder-Mead", options={"maxiter": 4000})
    assert 1 < found.fun <= radius(best)


def test_the_limits_of_the_gain_are_those_of_the_condition_of_eq_16(computed):
    """|1 - k| < 1, and the roots of the memory for six samples a turn, |1 - k|^(1/6)."""
    assert computed["eq16.kr-range"] == pytest.approx([0, 2], abs=1e-6)  # the word theorem


def test_one_late_sample_leaves_pi_control_stable_and_the_memory_not(computed):
    """Characteristic polynomials with the numerator a sample later, multiplied out."""
    open_loop = np.convolve([1, -1], [1, A1, A2])
    forward = np.concatenate([[0, 0], np.convolve([KP, KI], [B0, B1])])  # one sample late
    pi_alone = np.pad(open_loop, (0, 1)) + forward
    row = computed["ch5.mismatch"]
    assert row["pi_radius"] == pytest.approx(max(abs(np.roots(pi_alone))), rel=1e-9)
    generator = [1, 0, 0, 0, 0, 0, -1]
    memory = 0.8 * np.concatenate([np.zeros(5), P])
    left = np.convolve(np.convolve(Q, generator), pi_alone)
    right = np.convolve(memory, forward)
    whole = left + np.pad(right, (0, left.size - right.size))
    assert row["radius"] == pytest.approx(max(abs(np.roots(whole))), rel=1e-7) and row["radius"] > 1


# ---- the experiment ----


def test_times_of_figs_13_16_19_and_20(computed):
    """Without error is one percent of 20 lb, 0.2 lb, by the table of words."""
    for id, gain, scale in (
        ("fig13.runout-eliminated", 0.8, 1000),
        ("fig13.revolutions", 0.8, 10),
        ("fig19.kr-0p4-time", 0.4, 1),
        ("fig20.kr-1p4-time", 1.4, 1),
    ):
        assert computed[id] == pytest.approx(scale * settled(run(gain, SHAKEN)[0], 0.2), rel=SAME)
    assert computed["fig16.settling-10"] == pytest.approx(settled(run(0.8, QUIET)[0], 2), rel=SAME)


def test_without_runout_the_force_is_a_staircase():
    """20 (1 - (1 - k)^m) in turn m, and nothing between the steps."""
    for gain in (0.4, 0.8, 1.4):
        force, _ = run(gain, QUIET)
        turns = np.arange(240) // 6
        np.testing.assert_allclose(force, 20 * (1 - (1 - gain) ** turns), atol=1e-9)


def test_what_is_left_of_the_runout_shrinks_turn_by_turn(computed):
    effect = run(0.8, SHAKEN)[0] - run(0.8, QUIET)[0]
    spreads = [np.ptp(effect[6 * i : 6 * i + 6]) for i in range(4)]
    row = computed["fig13.period-by-period"]
    assert [row[f"p{i}"] for i in (1, 2, 3, 4)] == pytest.approx(spreads, rel=1e-7)
    assert spreads[3] / spreads[2] == pytest.approx(0.2, rel=1e-2)  # later modes of P die out


def test_ends_of_the_satisfactory_band_are_roots_and_not_grid_points(computed):
    """At each end a sample touches the yardstick: 2 lb after two turns, or 4 lb over."""

    def fault(gain, w):
        force, _ = run(gain, w)
        return max(max(abs(force[12:] - 20)) - 2, max(force) - 24)

    low, high = computed["ch6.kr-band"]
    assert fault(low, SHAKEN) == pytest.approx(0, abs=1e-7)
    assert fault(high, SHAKEN) == pytest.approx(0, abs=1e-7)
    assert fault(low - 1e-3, SHAKEN) > 0 > fault(low + 1e-3, SHAKEN)
    assert fault(high + 1e-3, SHAKEN) > 0 > fault(high - 1e-3, SHAKEN)


def test_no_gain_up_to_0p6_is_within_ten_percent_after_two_turns(computed):
    gains = np.append(np.arange(0.29, 0.6, 0.02), 0.6)
    off = [max(abs(run(k, w)[0][12:] - 20)) for k in gains for w in (QUIET, SHAKEN)]
    row = computed["ch6.kr-sluggish"]
    assert row["least_lb"] == pytest.approx(min(off), rel=1e-9) and min(off) > 2
    assert row["quiet_low"] == pytest.approx(1 - np.sqrt(0.1), rel=1e-9)  # of the staircase


def test_the_upper_end_of_the_quiet_band_is_exactly_the_yardstick():
    """Of the staircase, a gain of 1.2 is 4 lb over and one of 1 - 0.1^(1/2) 2 lb off."""
    for gain in (1.2, 1 - np.sqrt(0.1)):
        stairs = 20 * (1 - (1 - gain) ** np.arange(8))
        fault = max(max(abs(stairs[2:] - 20)) - 2, max(stairs) - 24)
        assert fault == pytest.approx(0, abs=1e-12)


def test_a_gain_of_1p4_overshoots_by_40_percent_and_with_runout_by_more(computed):
    row = computed["fig20.kr-1p4-oscillates"]
    assert row["quiet"] == pytest.approx(40, rel=1e-9)
    assert row["overshoot"] == pytest.approx(overshoot(run(1.4, SHAKEN)[0]), rel=1e-9)


def test_the_vibration_with_both_commands_limited(computed):
    """Clipped values remembered, limits of 50; the last two of twenty seconds."""
    force, _ = run(2.4, wave(1200), limits=(50, 50))
    half = np.ptp(force[1080:]) / 2
    assert half == pytest.approx(57.893, abs=0.001)  # what the reason quotes
    row = computed["fig21.kr-2p4-amplitude"]
    assert row["growth"] == pytest.approx(1.4, rel=1e-9)  # |1 - k|
    edge, _ = run(2.0, wave(600))
    assert row["spread_2p0_lb"] == pytest.approx(np.ptp(edge[480:]), rel=1e-7)
    assert abs(half - 47) > 0.5 and abs(2 * half - 47) > 0.5


# ---- the sampling rate ----


def resampled(per_turn, sine=0.0, w=0.3, start=0, seconds=4):
    n, dt = round(seconds * 10 * per_turn), 0.1 / per_turn
    h = impulse(n, per_turn, sine)
    force, _ = run(0.8, wave(n, per_turn, w), per_turn, start, h)
    return [settled(force, 2, dt), settled(force, 0.2, dt), overshoot(force[: 2 * 10 * per_turn])]


def test_two_samples_a_turn_are_slow_once_the_machine_is_resampled(computed):
    """Every third sample of eq. 7, which no choice for its fast pole can change."""
    assert resampled(2)[1] == pytest.approx(1.45, rel=SAME)
    assert resampled(2, w=0)[1] == pytest.approx(1.60, rel=SAME)
    assert computed["fig22.n2-time"] == pytest.approx(resampled(2, start=4)[1], rel=SAME)
    assert computed["fig22.n2-time"] > 1.5


def test_the_resampled_band_is_6_to_10_and_12_drops_out_by_settling(computed):
    good = []
    for per_turn in (2, 4, 6, 8, 10, 12):
        ten, _, over = resampled(per_turn)
        if ten <= 0.2 + SAME and over < 20:
            good.append(per_turn)
    assert good == [6, 8, 10]
    assert computed["ch6.n-band"] == [6, 10]


def test_only_half_of_the_trend_with_the_sampling_rate_is_there(computed):
    """The caption once said that the re-sampled reading has the trend, and the ledger denied it."""
    row = computed["ch6.n-trend"]
    (slow, _, over_2), (quick, _, _), (_, _, over_12) = (resampled(n) for n in (2, 6, 12))
    assert (row["settling_2_s"], row["settling_6_s"]) == pytest.approx((slow, quick), rel=SAME)
    assert (row["overshoot_2"], row["overshoot_12"]) == pytest.approx((over_2, over_12), rel=1e-6)
    assert slow > quick and over_12 < over_2 and over_12 < 20
    assert not row["holds"] and not row["holds_corrected"]


def test_half_a_sine_in_the_fast_pole_makes_twelve_samples_a_turn_unstable(computed):
    over = resampled(12, sine=0.5)[2]
    assert computed["fig22.n12-oscillates"]["plus_half"] == pytest.approx(over, rel=1e-6)
    force, _ = run(0.8, wave(480, 12), 12, 0, impulse(480, 12, 0.5))
    assert np.ptp(force[360:]) > np.ptp(force[240:360])  # it grows: no transient


def test_one_reading_meets_three_printed_statements_of_figs_22_and_23(computed):
    """Re-sampled, without runout, begun at once: time at 2, settling at 12, and the band."""
    tried = {n: resampled(n, w=0) for n in (2, 4, 6, 8, 10, 12)}
    assert tried[2][1] == pytest.approx(1.60, rel=SAME) and tried[2][1] > 1.5
    assert computed["fig22.n12-settling"] == pytest.approx(0.2, rel=SAME)  # same coefficients
    assert tried[12][0] == pytest.approx(29 / 120, rel=SAME) and tried[12][0] < 0.3
    good = [n for n, (ten, _, over) in tried.items() if ten <= 0.2 + SAME and over < 20]
    assert good == [6, 8, 10]


@pytest.mark.parametrize("per_turn, turns", [(2, 2.5), (6, 1.5)])
def test_a_memory_that_alone_waits_for_its_lags_idles_half_a_turn_less(per_turn, turns):
    """Eqs 24 to 28 in a loop from k = 0 on, with V_r kept at zero up to k = N + 2."""
    before, n, h = 2 * per_turn + 8, 40, impulse(40)
    memory, error, inner, command = np.zeros((4, before + n))
    force = np.zeros(n)
    for k in range(n):
        i = before + k
        force[k] = h[1 : k + 1][::-1] @ command[before:i]
        error[i] = 20 - force[k]
        if k >= per_turn + 2:
            u = sum(Q[j] * memory[i - per_turn - j] for j in range(3))
            u -= Q[1] * memory[i - 1] + Q[2] * memory[i - 2]
            u += sum(0.8 * P[j] * error[i - per_turn + 1 - j] for j in range(4))
            memory[i] = u / Q[0]
        inner[i] = memory[i] - force[k]
        command[i] = command[i - 1] + KP * inner[i] + KI * inner[i - 1]
    assert np.flatnonzero(np.abs(force) > SAME)[0] / per_turn == turns


# ---- captions ----


def test_no_caption_looks_for_what_is_printed_on_the_wrong_side():
    """Printed lines stand above the picture of their cell."""
    notebook = nbformat.read(ROOT / "notebooks" / "peripheral_milling.ipynb", as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            assert "under the figure" not in cell.source, cell.id
