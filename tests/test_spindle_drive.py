"""The spindle drive against its block diagram, worked out by hand and by python-control."""

from dataclasses import fields, replace

import control
import numpy as np
import pytest
from oracles.spindle_drive import all_states, characteristic_polynomial, equilibrium, turned

from rcbook.machines import spindle_drive
from rcbook.machines.spindle_drive import STATES, TSAO_PONG1991, SpindleDrive

DRIVE = TSAO_PONG1991
S = 1j * np.geomspace(0.1, 1e5, 60)  # rad/s, from below the slowest mode to above the fastest
SPEED = 20.94


def random_drive(seed):
    """Every parameter of table 1 times a random factor of 0.5 to 2."""
    rng = np.random.default_rng(seed)
    factors = 2 ** rng.uniform(-1, 1, len(fields(DRIVE)))
    return SpindleDrive(
        *(getattr(DRIVE, f.name) * x for f, x in zip(fields(DRIVE), factors, strict=True))
    )


DRIVES = {"table 1": DRIVE} | {f"random {seed}": random_drive(seed) for seed in range(4)}
each_drive = pytest.mark.parametrize("d", DRIVES.values(), ids=DRIVES)


def agreement(system, d, **how):
    """Largest relative difference over frequencies, column by column of inputs."""
    ours = np.moveaxis(system(S), -1, 0)
    truth = np.array([all_states(d, s, **how) for s in S])
    return np.max(np.abs(ours - truth) / np.abs(truth).max(axis=0))


# ---- block diagram ----


def test_parameters_are_those_of_table_1():
    printed = [0.02158, 0.04041, 0.0063, 0.45, 0.91, 0.91, 0.0286, 0.0004]
    printed += [2.805, 241.0, 0.05, 13.0, 240.0, 1.2e6, 50.0]
    assert [getattr(DRIVE, f.name) for f in fields(DRIVE)] == printed
    assert DRIVE.command_limit == pytest.approx(2.5, rel=1e-15)  # 50 A times 0.05 V/A


# Five states whose sizes and rates lie up to 1e10 apart: a solution loses that many roundings.
ROUNDING = 1e-6


@each_drive
def test_drive_under_velocity_control_follows_its_block_diagram(d):
    assert agreement(spindle_drive.speed_driven(d), d) < ROUNDING


@each_drive
def test_drive_with_open_velocity_loop_follows_its_block_diagram(d):
    assert agreement(spindle_drive.current_driven(d), d, velocity_loop=False) < ROUNDING


@pytest.mark.parametrize("slope", [-0.34, -1.2, 0.5])
def test_a_torque_slope_closes_the_loop_of_equation_16(slope):
    system = spindle_drive.speed_driven(DRIVE, slope)
    assert agreement(system, DRIVE, slope=slope) < ROUNDING
    # eq. 16 literally: G_u / (1 + G_f G_d) with w = G_u U - G_f T
    free = spindle_drive.speed_driven(DRIVE)(S)
    literally = free[0, 0] / (1 - free[0, 1] * slope)
    np.testing.assert_allclose(system(S)[0, 0], literally, rtol=ROUNDING)


@pytest.mark.parametrize("name", ["back_emf", "loop_gain", "tacho_lag", "friction"])
def test_block_diagram_notices_a_parameter_off_by_a_percent(name):
    wrong = replace(DRIVE, **{name: 1.01 * getattr(DRIVE, name)})
    assert agreement(spindle_drive.speed_driven(wrong), DRIVE) > 10 * ROUNDING


def test_python_control_connects_the_blocks_to_the_same_drive():
    d, s = DRIVE, control.tf("s")
    blocks = [
        control.ss(
            d.velocity_gain + d.velocity_integral / s, inputs="ev", outputs="ui", name="velocity"
        ),
        control.ss(
            d.loop_gain * (d.current_gain + d.current_integral / s),
            inputs="ei",
            outputs="v",
            name="amplifier",
        ),
        control.ss(
            1 / (d.inductance * s + d.resistance), inputs="va", outputs="i", name="armature"
        ),
        control.ss(1 / (d.inertia * s + d.friction), inputs="net", outputs="w", name="rotor"),
        control.ss(d.tacho_gain / (d.tacho_lag * s + 1), inputs="w", outputs="wa", name="tacho"),
        control.summing_junction(["uw", "-wa"], "ev", name="outer"),
        control.ss([], [], [], [[1, -d.current_feedback]], inputs=["ui", "i"], outputs="ei"),
        control.ss([], [], [], [[1, -d.back_emf]], inputs=["v", "w"], outputs="va"),
        control.ss([], [], [], [[d.torque_constant, -1]], inputs=["i", "load"], outputs="net"),
    ]
    whole = control.interconnect(blocks, inputs=["uw", "load"], outputs=["w", "i", "wa"])
    ours = spindle_drive.speed_driven(d)[["speed", "current", "tachometer"], :]
    scale = np.abs(whole(S)).max(axis=-1, keepdims=True)
    assert np.max(np.abs(ours(S) - whole(S)) / scale) < ROUNDING
    np.testing.assert_allclose(  # each sorted by size; conjugates share one
        np.sort(np.abs(ours.poles())), np.sort(np.abs(whole.poles())), rtol=1e-7
    )


@each_drive
def test_poles_are_the_roots_of_the_characteristic_polynomial(d):
    by_hand = characteristic_polynomial(d)
    found = np.poly(spindle_drive.speed_driven(d).A)
    np.testing.assert_allclose(found, by_hand, rtol=1e-9)  # roots and back


def test_transfer_functions_are_of_fifth_order_and_stable():
    for d in DRIVES.values():
        system = spindle_drive.speed_driven(d)
        assert system.poles().size == 5 and system.poles().real.max() < 0
        assert tuple(system.state_labels) == tuple(system.output_labels) == STATES
        assert system.input_labels == ["command", "load"]


# ---- steady state ----


@each_drive
@pytest.mark.parametrize("speed, torque", [(20.9, 0.0), (20.9, 7.2), (73.3, 26.0), (5.0, -3.0)])
def test_steady_state_is_the_equilibrium_worked_out_by_hand(d, speed, torque):
    by_hand = equilibrium(d, speed, torque)
    found = spindle_drive.steady_state(d, speed, torque)
    np.testing.assert_allclose(found, by_hand, rtol=1e-9)
    system = spindle_drive.speed_driven(d)
    rates = system.A @ found + system.B @ [d.tacho_gain * speed, torque]
    sizes = np.abs(system.A) @ np.abs(found)  # of the terms that cancel
    assert np.all(np.abs(rates) < 1e-12 * sizes)
    off = system.A @ found + system.B @ [d.tacho_gain * speed, torque + 0.1]  # another torque
    assert np.any(np.abs(off) > 1e-6 * sizes)


# ---- angle for time ----


def test_in_angle_divides_the_poles_by_the_speed():
    system = spindle_drive.speed_driven(DRIVE, -0.34)
    turned = spindle_drive.in_angle(system, SPEED)
    np.testing.assert_allclose(turned.poles() * SPEED, system.poles(), rtol=1e-9)
    sigma = S / SPEED
    np.testing.assert_allclose(turned(sigma), system(S), rtol=1e-9)  # s = w0 sigma
    assert turned.state_labels == turned.output_labels == system.state_labels
    assert turned.input_labels == system.input_labels
    assert turned(0)[0, 0].real == pytest.approx(1 / DRIVE.tacho_gain, rel=1e-9)  # integral action
    assert np.abs(turned(S) - system(S)).max() > 1


# ---- the explicit method ----


def test_runge_kutta_is_of_fourth_order_below_its_limit_and_bursts_above():
    """A degree from rest at nominal speed under another command and torque, against LSODA.

    The fastest pole is -1.8e4 per second and the method reaches to 2.785/h: 0.18 degrees at 20.94
    rad/s.
    """
    start = spindle_drive.steady_state(DRIVE, SPEED)
    u = np.array([1.02 * DRIVE.tacho_gain * SPEED, 2.0])
    truth = turned(DRIVE, u, np.radians(1), start)
    errors = []
    for n in (10, 20, 40):
        states = spindle_drive.runge_kutta(DRIVE, [u] * n, np.radians(1) / n, start)
        assert states.shape == (n, 5)
        errors.append(np.abs(states[-1] - truth)[1])
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 4, atol=0.5)
    with np.errstate(all="ignore"):
        coarse = spindle_drive.runge_kutta(DRIVE, [u] * 90, np.radians(0.2), start)
    assert np.nanmax(np.abs(coarse[:, 1])) > 1e3


@pytest.mark.parametrize(
    "inputs, step, message",
    [([1.0, 2.0], 0.1, r"shape \(2,\); give a row"), ([[1.0, 2.0]], 0.0, r"step = 0\.0")],
)
def test_runge_kutta_refuses_bad_input(inputs, step, message):
    with pytest.raises(ValueError, match=message):
        spindle_drive.runge_kutta(DRIVE, inputs, step, np.ones(5))


# ---- bad input ----


@pytest.mark.parametrize("name", [f.name for f in fields(DRIVE)])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf, "1", True])
def test_parameters_have_to_be_positive_and_finite(name, value):
    with pytest.raises(ValueError, match=rf"{name} = .*positive"):
        replace(DRIVE, **{name: value})


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: spindle_drive.steady_state(DRIVE, np.nan), "speed = nan"),
        (lambda: spindle_drive.steady_state(DRIVE, 20.0, np.inf), "torque = inf"),
        (lambda: spindle_drive.speed_driven(DRIVE, np.nan), "torque_slope = nan"),
        (lambda: spindle_drive.in_angle(spindle_drive.speed_driven(DRIVE), 0.0), r"speed = 0\.0"),
        (lambda: spindle_drive.in_angle(spindle_drive.speed_driven(DRIVE), -1), "speed = -1"),
    ],
)
def test_bad_numbers_are_refused_by_name(call, message):
    with pytest.raises(ValueError, match=message):
        call()
