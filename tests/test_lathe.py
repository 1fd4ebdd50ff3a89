"""The lathe's servos against the printed polynomials, and sections against geometry."""

import numpy as np
import pytest
from oracles.lathe import area

from rcbook import zdomain
from rcbook.machines import lathe

SERVO = lathe.LEE_OH_KIM
SEEDS = range(4)
SIDES = [3, 4, 5, 6, 11]


# ---- servos ----


def test_electric_servo_multiplies_out_to_eq_16():
    """y = 0.14 (u1 + 3.2 u2 + 1.8711 u3) + 0.16 y1 - 0.003 y2 - 0.0063 y3: exact products."""
    plant = lathe.LEE_OH_KIM.plant
    np.testing.assert_allclose(plant.b / 0.14, [1, 3.2, 1.8711], rtol=1e-14)
    np.testing.assert_allclose(-plant.a[1:], [0.16, -0.003, -0.0063], atol=1e-16)
    assert (plant.delay, plant.dt) == (1, 0.01)


def test_electric_servo_reflects_to_eq_17():
    """The taps are printed to four decimals, rounded; the divisor 1.6458 is not: 0.14 3.43^2 is
    1.6471, so the printed one is 8e-4 of it too small."""
    law = zdomain.zero_phase_inverse(lathe.LEE_OH_KIM.plant, normalisation="dc")
    exact = law.b / law.b[0] * 2.43
    np.testing.assert_allclose(exact, [2.43, 0.6112, -0.1527, 0.0183, 0.0063], atol=0.5e-4)
    np.testing.assert_allclose(law.a / law.a[0], [1, 0.77], atol=1e-14)
    assert law.advance == 2
    divisor = 2.43 * law.a[0] / law.b[0]
    assert divisor == pytest.approx(0.14 * 3.43**2, rel=1e-13)
    assert divisor == pytest.approx(1.6458, rel=1e-3)
    assert divisor != pytest.approx(1.6458, abs=0.5e-4)  # not a rounding
    slipped = np.roll(exact, 1)
    assert np.abs(slipped - [2.43, 0.6112, -0.1527, 0.0183, 0.0063]).max() > 0.1


def test_electric_servo_under_zero_phase_tracking_is_eq_19():
    plant = lathe.LEE_OH_KIM.plant
    _, b_minus = zdomain.split_zeros(plant.b)
    taps = np.convolve(b_minus, b_minus[::-1])
    # printed: 2.43, 6.9, 2.43 over 11.76; 1 + 2.43^2 = 6.9049 and 3.43^2 = 11.7649
    np.testing.assert_allclose(taps, [2.43, 6.9049, 2.43], rtol=1e-14)
    np.testing.assert_allclose(taps, [2.43, 6.9, 2.43], atol=0.05)
    assert b_minus.sum() ** 2 == pytest.approx(3.43**2, rel=1e-14)
    assert b_minus.sum() ** 2 == pytest.approx(11.76, abs=0.005)


def test_nc_lathe_multiplies_out_to_eq_21():
    plant = lathe.LEE_OH_KIM_NC.plant
    np.testing.assert_allclose(plant.b, [0.046, 0.138], rtol=1e-14)
    # (1 - 0.6/z)^2 + (0.15/z)^2
    np.testing.assert_allclose(plant.a, [1, -1.2, 0.3825], rtol=1e-14)
    np.testing.assert_allclose(plant.zeros, [-3.0], rtol=1e-14)
    np.testing.assert_allclose(np.sort_complex(plant.poles), [0.6 - 0.15j, 0.6 + 0.15j])


@pytest.mark.parametrize("servo", [lathe.LEE_OH_KIM, lathe.LEE_OH_KIM_NC], ids=["eq 13", "eq 21"])
@pytest.mark.parametrize("zeros, poles", [(1.0, 1.0), (1.25, 1.25), (0.75, 0.75), (1.1, 0.9)])
def test_a_misjudged_servo_has_scaled_roots_and_the_same_gain(servo, zeros, poles):
    plant = servo.misjudged(zeros=zeros, poles=poles).plant
    assert plant.b[0] == servo.gain
    by_size = lambda r: sorted(r, key=lambda x: (round(abs(x), 9), np.imag(x)))  # noqa: E731
    np.testing.assert_allclose(
        by_size(plant.zeros), by_size(-zeros * np.array(servo.zeros)), rtol=1e-12
    )
    np.testing.assert_allclose(
        by_size(plant.poles), by_size(-poles * np.array(servo.poles)), rtol=1e-12
    )
    assert (plant.delay, plant.dt) == (1, servo.dt)


def test_misjudging_one_kind_of_root_leaves_the_other():
    zeros, poles = SERVO.zeros, SERVO.poles
    assert SERVO.misjudged() == SERVO
    assert SERVO.misjudged(zeros=2.0) == lathe.Servo(0.14, (1.54, 4.86), poles, 0.01)
    assert SERVO.misjudged(poles=0.5) == lathe.Servo(
        0.14, zeros, (0.07, -0.075 + 0.075j, -0.075 - 0.075j), 0.01
    )


def test_every_coefficient_may_be_misjudged_by_a_factor_of_its_own():
    guess = SERVO.misjudged(zeros=(2.0, 0.5), poles=(4.0, 0.5, 0.5))  # powers of two: exact
    assert guess == lathe.Servo(0.14, (1.54, 1.215), (0.56, *np.array(SERVO.poles[1:]) / 2), 0.01)
    # a conjugate pair that is not misjudged as a pair is no servo
    with pytest.raises(ValueError, match="without its conjugate"):
        _ = SERVO.misjudged(poles=(1.0, 2.0, 1.0)).plant


def test_the_steady_gain_is_the_product_of_the_factors_at_one():
    # eq. 13 at z = 1, by hand
    by_hand = 0.14 * 1.77 * 3.43 / (1.14 * (0.85**2 + 0.15**2))
    assert SERVO.steady_gain == pytest.approx(by_hand, rel=1e-14)
    assert lathe.LEE_OH_KIM_NC.steady_gain == pytest.approx(
        0.046 * 4 / (0.4**2 + 0.15**2), rel=1e-14
    )


def test_misjudging_back_and_forth_gives_the_servo():
    there = lathe.LEE_OH_KIM.misjudged(2.0, 0.5)
    back = there.misjudged(0.5, 2.0)
    assert back == lathe.LEE_OH_KIM != there  # powers of two: exact


def test_a_servo_without_zeros_or_poles_is_a_delay():
    plant = lathe.Servo(2.0, (), (), 0.1).plant
    assert (plant.b.tolist(), plant.a.tolist(), plant.delay) == ([2.0], [1.0], 1)


# ---- the spindle ----


def test_samples_per_turn_are_not_whole_at_the_papers_speeds():
    # 60/0.937 and 60/1.874 by long division
    assert lathe.samples_per_turn(93.7, 0.01) == pytest.approx(64.0341515474920, rel=1e-14)
    assert lathe.samples_per_turn(187.4, 0.01) == pytest.approx(32.0170757737460, rel=1e-14)
    assert lathe.samples_per_turn(93.75, 0.01) == pytest.approx(64, rel=1e-14)


@pytest.mark.parametrize("per_turn", [8, 16.0, 64.03])
def test_spindle_angle_makes_one_turn_in_the_samples_of_a_turn(per_turn):
    angle = lathe.spindle_angle(40, per_turn, start=0.3)
    assert angle.shape == (40,)
    assert angle[0] == 0.3
    # degrees, as an independent unit
    np.testing.assert_allclose(
        np.degrees(angle - 0.3), 360.0 / per_turn * np.arange(40), rtol=1e-12
    )
    assert lathe.spindle_angle(2.0, 8).tolist() == [0.0, 2 * np.pi / 8]


# ---- sections ----


@pytest.mark.parametrize("sides", SIDES)
def test_polygon_has_its_inradius_mid_side_and_its_corner_radius_between(sides):
    k = np.arange(-2 * sides, 3 * sides)
    middle = lathe.polygon_section(2 * np.pi * k / sides, sides, 2.5)
    corner = lathe.polygon_section(np.pi * (2 * k + 1) / sides, sides, 2.5)
    # three turns lose a few ulp in the fold; slope tan(pi/3) at most
    np.testing.assert_allclose(middle, 2.5, rtol=1e-13)
    np.testing.assert_allclose(corner, 2.5 / np.cos(np.pi / sides), rtol=1e-13)
    dense = lathe.polygon_section(np.linspace(-9, 9, 5001), sides, 2.5)
    assert dense.min() >= 2.5
    assert dense.max() <= 2.5 / np.cos(np.pi / sides) * (1 + 1e-14)


def test_square_of_half_side_ten_has_corners_at_root_two_times_ten():
    r = lathe.polygon_section(lathe.spindle_angle(16, 64.0, start=-np.pi / 4), 4, 10.0)
    assert r[0] == pytest.approx(10 * np.sqrt(2), rel=1e-14)
    assert r[8] == pytest.approx(10, rel=1e-14)


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("seed", SEEDS)
def test_polygon_points_lie_on_the_half_planes_of_its_sides(sides, seed):
    """max over sides of the distance along the side's normal is the inradius."""
    angle = np.random.default_rng(seed).uniform(-20, 20, 100)
    r = lathe.polygon_section(angle, sides, 3.0)
    x, y = r * np.cos(angle), r * np.sin(angle)
    normals = 2 * np.pi * np.arange(sides) / sides
    distance = np.outer(x, np.cos(normals)) + np.outer(y, np.sin(normals))
    np.testing.assert_allclose(distance.max(axis=1), 3.0, rtol=1e-13)  # 20 rad: a few ulp
    rolled = lathe.polygon_section(angle + 2 * np.pi / sides, sides, 3.0)
    np.testing.assert_allclose(rolled, r, rtol=1e-13)
    mirrored = lathe.polygon_section(-angle, sides, 3.0)
    np.testing.assert_allclose(mirrored, r, rtol=1e-13)
    turned = lathe.polygon_section(angle + 0.1, sides, 3.0)  # a mutant: another angle
    assert np.abs(turned - r).max() > 0.01


@pytest.mark.parametrize("sides", SIDES)
def test_polygon_has_the_area_of_its_triangles(sides):
    found = area(lambda t: lathe.polygon_section(t, sides, 2.5), SIDES)
    # quad is asked for 1.5e-8 and reaches far less on smooth pieces
    assert found == pytest.approx(sides * 2.5**2 * np.tan(np.pi / sides), rel=1e-8)


@pytest.mark.parametrize("a, b", [(3.0, 2.0), (1.0, 4.0), (2.0, 2.0)])
def test_ellipse_satisfies_its_equation_and_has_its_extremes_and_area(a, b):
    quarter = lathe.ellipse_section(np.pi / 2 * np.arange(4), a, b)
    np.testing.assert_allclose(quarter, [a, b, a, b], rtol=1e-14)
    t = np.linspace(-7, 7, 1001)
    r = lathe.ellipse_section(t, a, b)
    np.testing.assert_allclose((r * np.cos(t) / a) ** 2 + (r * np.sin(t) / b) ** 2, 1, rtol=1e-13)
    assert np.all((r >= min(a, b) * (1 - 1e-15)) & (r <= max(a, b) * (1 + 1e-15)))
    found = area(lambda t: lathe.ellipse_section(t, a, b), SIDES)
    assert found == pytest.approx(np.pi * a * b, rel=1e-8)
    swapped = lathe.ellipse_section(t, b, a)  # a mutant: half axes exchanged
    wrong = (swapped * np.cos(t) / a) ** 2 + (swapped * np.sin(t) / b) ** 2
    assert a == b or np.abs(wrong - 1).max() > 0.1


def test_sections_take_one_angle_or_a_table_of_them():
    table = np.linspace(0, 3, 6).reshape(2, 3)
    for section in (
        lambda t: lathe.polygon_section(t, 5, 1.0),
        lambda t: lathe.ellipse_section(t, 2.0, 1.0),
    ):
        assert section(table).shape == (2, 3)
        assert section(table)[1, 2] == section(3.0)


# ---- bad input ----

NAN, INF = np.nan, np.inf


def servo(gain=1.0, zeros=(), poles=(), dt=0.01):
    return lathe.Servo(gain, zeros, poles, dt).plant


BAD = {
    "pole without conjugate": (lambda: servo(poles=(0.1, 0.2 + 0.1j)),
        r"0\.2\+0\.1j.* without its conjugate"),
    "zero without conjugate": (lambda: servo(zeros=(0.1j,)), r"0\.1j.* without its conjugate"),
    "NaN gain": (lambda: servo(NAN), r"gain = nan must be"),
    "NaN zero": (lambda: servo(zeros=(NAN,)), r"nan.* NaN or infinity; give finite"),
    "NaN pole": (lambda: servo(poles=(NAN,)), r"nan.* NaN or infinity; give finite"),
    "negative interval": (lambda: servo(dt=-0.01), r"dt = -0\.01 must be a positive"),
    "NaN factor on zeros": (lambda: SERVO.misjudged(zeros=NAN), r"zeros = nan must be"),
    "factor too many": (lambda: SERVO.misjudged(zeros=(1, 2, 3)), r"zeros has 3 factors; .*, or 2"),
    "infinite factor on poles": (lambda: SERVO.misjudged(poles=INF), r"poles = inf must be"),
    "standing spindle": (lambda: lathe.samples_per_turn(0.0, 0.01), r"speed = 0\.0 .*positive"),
    "backward spindle": (lambda: lathe.samples_per_turn(-9.0, 0.01), r"speed = -9\.0 .*positive"),
    "NaN speed": (lambda: lathe.samples_per_turn(NAN, 0.01), r"speed = nan .*positive"),
    "no interval": (lambda: lathe.samples_per_turn(90.0, 0.0), r"dt = 0\.0 .*positive"),
    "part of a sample": (lambda: lathe.spindle_angle(64.03, 64.03), r"n = 64\.03 .*round"),
    "no samples": (lambda: lathe.spindle_angle(0, 64.0), r"n = 0 .*round"),
    "no turn": (lambda: lathe.spindle_angle(4, 0.0), r"per_turn = 0\.0 .*positive"),
    "NaN start": (lambda: lathe.spindle_angle(4, 8.0, NAN), r"start = nan must be"),
    "two sides": (lambda: lathe.polygon_section(0.0, 2, 1.0), r"sides = 2 .*below 3"),
    "broken sides": (lambda: lathe.polygon_section(0.0, 3.5, 1.0), r"sides = 3\.5 .*round"),
    "negative inradius": (lambda: lathe.polygon_section(0.0, 4, -1.0), r"inradius = -1\.0 .*pos"),
    "NaN inradius": (lambda: lathe.polygon_section(0.0, 4, NAN), r"inradius = nan .*pos"),
    "NaN angle": (lambda: lathe.polygon_section([0.0, NAN], 4, 1.0), r"angle.*nan.*give finite"),
    "infinite angle": (lambda: lathe.ellipse_section(INF, 1.0, 1.0), r"angle.*inf.*give finite"),
    "negative half axis a": (lambda: lathe.ellipse_section(0.0, -2.0, 1.0), r"a = -2\.0 .*pos"),
    "no half axis b": (lambda: lathe.ellipse_section(0.0, 2.0, 0.0), r"b = 0\.0 .*positive"),
}  # fmt: skip


@pytest.mark.parametrize("call, message", BAD.values(), ids=BAD)
def test_bad_input_names_value_and_mend(call, message):
    with pytest.raises(ValueError, match=message):
        call()


# ---- between the samples, and at the limits of the feed ----


def test_between_samples_of_a_parabola_a_straight_path_is_off_by_a_quarter():
    """k^2 between k and k + 1 lies below its chord by at most 1/4, in the middle."""
    n = 6
    shape = lambda k: np.minimum(k, n - k) ** 2  # noqa: E731  two arcs, meeting at n/2
    assert lathe.error_between(shape(np.arange(n)), shape, 10) == pytest.approx(0.25, rel=1e-12)
    off = shape(np.arange(n)) + np.eye(n)[2]  # the chord rises with the sample that is off
    assert lathe.error_between(off, shape, 10) == pytest.approx(1.0, abs=0.26)
    assert lathe.error_between(np.full(5, 2.0), lambda k: 0 * k + 3.0) == 1.0


def test_a_command_within_its_limits_is_followed_and_a_step_at_the_limits():
    wave = np.sin(2 * np.pi * np.arange(20) / 20)
    np.testing.assert_allclose(lathe.rate_limited(wave, 0.1, 3.2), wave, atol=1e-13)
    step = np.repeat([0.0, 8.0], 40)
    ramp = lathe.rate_limited(step, 0.5, 2.0)  # one unit a sample up, and as fast down
    expected = np.interp(np.arange(80), [0, 7, 39, 47, 79], [7, 0, 0, 8, 8])
    np.testing.assert_allclose(ramp, expected, atol=1e-12)
    speeds = np.diff(lathe.rate_limited(step, 0.5, 4.0, 0.8))
    assert np.abs(speeds).max() <= 2.0 + 1e-12
    assert np.abs(np.diff(speeds)).max() == pytest.approx(0.2, abs=1e-12)  # 0.8 x 0.5^2


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: lathe.error_between(np.ones(5), np.sin, 0), r"points = 0 .*round"),
        (lambda: lathe.rate_limited(np.ones(5), 0.1, 0.0), r"speed = 0\.0 must be pos"),
    ],
)
def test_motion_refuses_what_cannot_be(call, message):
    with pytest.raises(ValueError, match=message):
        call()
