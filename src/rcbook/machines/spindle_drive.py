"""The spindle drive: a brushless motor with current loop, velocity loop and tachometer.

Ku (Kpi + Kii/s) drives the armature from the current error, Kpv + Kiv/s makes the current command
from the velocity error, and the amplifier limits that command to what it can supply.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rcbook.zdomain import real_number

if TYPE_CHECKING:  # what takes a second to import is imported where it is used
    import control

STATES = ("speed", "current", "tachometer", "current_integral", "velocity_integral")


@dataclass(frozen=True)
class SpindleDrive:
    """Parameters of a drive; speeds are measured and commanded in V, currents too.

    Raises ValueError for a parameter that is not positive and finite.
    """

    friction: float  # B, N m s/rad
    inertia: float  # J, kg m2
    inductance: float  # La, H
    resistance: float  # Ra, ohm
    torque_constant: float  # Cw1, N m/A
    back_emf: float  # Cw2, V s/rad
    tacho_gain: float  # Cwt, V s/rad
    tacho_lag: float  # Tg, s
    velocity_gain: float  # Kpv, V/V
    velocity_integral: float  # Kiv, 1/s
    current_feedback: float  # Kf, V/A
    loop_gain: float  # Ku, V/V
    current_gain: float  # Kpi, V/V
    current_integral: float  # Kii, 1/s
    current_limit: float  # A

    def __post_init__(self) -> None:
        for field in fields(self):
            value = real_number(getattr(self, field.name), field.name, positive=True)
            object.__setattr__(self, field.name, value)

    @property
    def command_limit(self) -> float:
        """Largest current command in V."""
        return self.current_feedback * self.current_limit


TSAO_PONG1991 = SpindleDrive(  # table 1
    friction=0.02158,
    inertia=0.04041,
    inductance=0.0063,
    resistance=0.45,
    torque_constant=0.91,
    back_emf=0.91,
    tacho_gain=0.0286,
    tacho_lag=0.0004,
    velocity_gain=2.805,
    velocity_integral=241.0,
    current_feedback=0.05,
    loop_gain=13.0,
    current_gain=240.0,
    current_integral=1.2e6,
    current_limit=50.0,
)


def current_driven(drive: SpindleDrive) -> control.StateSpace:
    """The drive with its velocity loop open: current command (V), torque (N m) to all states.

    Five states as in `STATES`; the velocity integral is there and fed by minus the tachometer.
    Source: Tsao and Pong (1991), fig. 3 and table 1.
    """
    d = drive
    amplified = d.loop_gain * d.current_gain
    a = np.zeros((5, 5))
    a[0, :2] = [-d.friction / d.inertia, d.torque_constant / d.inertia]
    a[1, :2] = [-d.back_emf, -(d.resistance + amplified * d.current_feedback)]
    a[1, 3] = d.loop_gain * d.current_integral
    a[1] /= d.inductance
    a[2, [0, 2]] = d.tacho_gain / d.tacho_lag, -1 / d.tacho_lag
    a[3, 1] = -d.current_feedback
    a[4, 2] = -d.velocity_integral
    b = np.zeros((5, 2))
    b[0, 1] = -1 / d.inertia
    b[[1, 3], 0] = amplified / d.inductance, 1.0
    return _driven(a, b)


def speed_driven(drive: SpindleDrive, torque_slope: float = 0.0) -> control.StateSpace:
    """The drive under velocity control: speed command (V) and cutting torque (N m) to all states.

    `torque_slope` (N m s/rad) is a torque that answers to the speed at once and is counted into the
    drive, as G_d is in eq. 16.
    Source: Tsao and Pong (1991), eqs 10-11 and 16.
    """
    inner = current_driven(drive)
    feedback = np.array([0, 0, -drive.velocity_gain, 0, 1.0])
    a = inner.A + np.outer(inner.B[:, 0], feedback)
    a[0, 0] -= real_number(torque_slope, "torque_slope") / drive.inertia
    b = inner.B.copy()
    b[:, 0] = inner.B[:, 0] * drive.velocity_gain
    b[4, 0] = drive.velocity_integral
    return _driven(a, b)


def _driven(a: np.ndarray, b: np.ndarray) -> control.StateSpace:
    """From command and load to all states."""
    import control

    return control.ss(a, b, np.eye(5), 0, states=STATES, outputs=STATES, inputs=["command", "load"])


def steady_state(drive: SpindleDrive, speed: float, torque: float = 0.0) -> np.ndarray:
    """The five states at a constant speed in rad/s under a constant torque in N m."""
    system = speed_driven(drive)
    inputs = np.array(
        [drive.tacho_gain * real_number(speed, "speed"), real_number(torque, "torque")]
    )
    return np.linalg.solve(system.A, -system.B @ inputs)


def in_angle(system: control.StateSpace, speed: float) -> control.StateSpace:
    """The same system with the shaft angle in rad for its time, at a nominal speed in rad/s.

    Source: Tsao and Pong (1991), eqs 12 and 15, s = w0 sigma.
    """
    import control

    speed = real_number(speed, "speed", positive=True)
    labels = {"states": system.state_labels, "outputs": system.output_labels}
    return control.ss(
        system.A / speed, system.B / speed, system.C, system.D, inputs=system.input_labels, **labels
    )


def runge_kutta(
    drive: SpindleDrive, inputs: ArrayLike, step: float, start: ArrayLike
) -> np.ndarray:
    """States after every step in the shaft angle by the classical fourth-order method.

    `inputs` has a row of speed command (V) and torque (N m), held over the step, for each; `step`
    is an angle in rad, `start` the five states before.  It is the wrong method for so stiff a
    drive, and here to show how it goes wrong: nothing warns of a step that is too long.
    Raises ValueError for inputs without two columns and a step that is not positive.
    """
    inputs, state = np.asarray(inputs, dtype=float), np.asarray(start, dtype=float)
    step, system = real_number(step, "step", positive=True), speed_driven(drive)
    if inputs.ndim != 2 or inputs.shape[1] != 2:
        raise ValueError(f"inputs have shape {inputs.shape}; give a row of command and torque each")
    states = np.empty((len(inputs), state.size))
    for k, u in enumerate(inputs):
        stages = [np.zeros(state.size)]
        for share in (0, 0.5, 0.5, 1):
            now = state + share * step * stages[-1]
            stages.append((system.A @ now + system.B @ u) / now[0])
        states[k] = state = state + step / 6 * (np.array([1, 2, 2, 1]) @ stages[1:])
    return states
