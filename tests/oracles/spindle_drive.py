"""The spindle drive by its block diagram, worked out by hand."""

import numpy as np
import scipy.integrate


def currents_and_speeds(d, s, velocity_loop=True, slope=0.0):
    """Fig. 3 at one complex frequency: columns are command and load, rows current and speed."""
    amplifier = d.loop_gain * (d.current_gain + d.current_integral / s)
    tachometer = d.tacho_gain / (1 + d.tacho_lag * s)
    controller = (d.velocity_gain + d.velocity_integral / s) * velocity_loop
    # armature: (La s + Ra) i = amplifier (Ui - Kf i) - Cw2 w, rotor: (J s + B) w = Cw1 i - T
    equations = np.array(
        [
            [
                d.inductance * s + d.resistance + amplifier * d.current_feedback,
                d.back_emf + amplifier * controller * tachometer,
            ],
            [-d.torque_constant, d.inertia * s + d.friction + slope],
        ]
    )
    by_command = amplifier * (controller if velocity_loop else 1)
    return np.linalg.solve(equations, np.diag([by_command, -1.0]))


def all_states(d, s, velocity_loop=True, slope=0.0):
    """The same for all states: integrals and tachometer follow from current and speed."""
    current, speed = currents_and_speeds(d, s, velocity_loop, slope)
    tachometer = d.tacho_gain / (1 + d.tacho_lag * s) * speed
    outer = np.array([1.0 if velocity_loop else 0.0, 0.0]) - tachometer
    command = (d.velocity_gain + d.velocity_integral / s) * outer
    if not velocity_loop:
        command = np.array([1.0, 0.0])
    return np.array(
        [
            speed,
            current,
            tachometer,
            (command - d.current_feedback * current) / s,
            d.velocity_integral * outer / s,
        ]
    )


def characteristic_polynomial(d):
    """Of the drive under velocity control, in s with the highest power first, scaled to one."""
    amplifier = d.loop_gain * np.array([d.current_gain, d.current_integral])
    armature = np.polyadd(
        np.array([d.inductance, d.resistance, 0]), d.current_feedback * amplifier
    )  # (La s + Ra) s + Kf Ku (Kpi s + Kii)
    rotor, lag = [d.inertia, d.friction], [d.tacho_lag, 1]
    mechanical = np.polymul(np.polymul(armature, rotor), np.polymul(lag, [1, 0]))
    emf = np.polymul([d.torque_constant * d.back_emf, 0, 0], lag)
    pi = [d.velocity_gain, d.velocity_integral]
    loop = d.torque_constant * d.tacho_gain * np.polymul(amplifier, pi)
    by_hand = np.polyadd(np.polyadd(mechanical, emf), loop)
    return by_hand / by_hand[0]


def equilibrium(d, speed, torque):
    """The states at rest, equation by equation."""
    current = (d.friction * speed + torque) / d.torque_constant
    voltage = d.resistance * current + d.back_emf * speed
    return [
        speed,
        current,
        d.tacho_gain * speed,
        voltage / (d.loop_gain * d.current_integral),
        d.current_feedback * current,
    ]


def turned(d, u, angle, start):
    """States after the shaft turned by an angle in rad, from its equations and an adaptive method.

    u holds speed command and torque.
    """

    def rates(_, state):
        speed, current, tachometer, current_integral, velocity_integral = state
        missing = d.velocity_gain * (u[0] - tachometer) + velocity_integral
        missing -= d.current_feedback * current
        voltage = d.loop_gain * (d.current_gain * missing + d.current_integral * current_integral)
        by_time = [
            (d.torque_constant * current - d.friction * speed - u[1]) / d.inertia,
            (voltage - d.resistance * current - d.back_emf * speed) / d.inductance,
            (d.tacho_gain * speed - tachometer) / d.tacho_lag,
            missing,
            d.velocity_integral * (u[0] - tachometer),
        ]
        return np.array(by_time) / speed

    scale = np.abs(start) + 1e-3
    done = scipy.integrate.solve_ivp(
        rates, (0, angle), start, method="LSODA", rtol=1e-11, atol=1e-11 * scale
    )
    return done.y[:, -1]
