"""The mill as the controller is designed for it: linear, and sampled in the cutter angle."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rcbook import zdomain
from rcbook.machines import spindle_drive
from rcbook.machines.face_mill.mill import FaceMill, sampling_angle
from rcbook.machines.face_mill.readings import OUTPUTS, TORQUES, one_of
from rcbook.zdomain import Plant, multiply, whole_number


def control_model(mill: FaceMill, torque_feedback: bool = True, output: str = "force") -> Plant:
    """Speed command (V) to peak force (N), or torque (N m), linearised and sampled in the angle.

    A tooth meets what the feed has moved while one pitch went by: the integral of the speed over
    `samples_per_pitch` sampling intervals, one after the other, which is an exact moving sum.
    The sampling interval of the plant is an angle in rad.
    Source: Tsao and Pong (1991), eqs 16-18; for the torque eq. 8 averaged over the pitch.
    Raises ValueError for another output than force or torque.
    """
    one_of(output, OUTPUTS, "output")
    slope = mill.torque_slope if torque_feedback else 0.0
    driven = spindle_drive.in_angle(spindle_drive.speed_driven(mill.drive, slope), mill.speed)
    turned = zdomain.interval_integral(driven["speed", "command"], sampling_angle(mill))
    gain = mill.force_slope if output == "force" else mill.torque_slope / mill.pitch
    moving_sum = np.ones(mill.samples_per_pitch)
    return Plant(gain * multiply(turned.b, moving_sum), turned.a, turned.delay, turned.dt)


def frequency_response(
    mill: FaceMill, z: ArrayLike, torque: str = "memory", aliases: int = 40
) -> np.ndarray:
    """Response from sampled speed command (V) to sampled peak force (N) at points z of the circle.

    It is that of the continuous machine behind its hold, summed over the aliases, and so holds for
    a torque that a sampled model of finite order cannot have: with the "memory" of eq. 8 averaged
    over the teeth, as well as "instantaneous" (eq. 14) and "none".
    Raises ValueError for another torque and for points off the circle.
    """
    one_of(torque, (*TORQUES, "none"), "torque")
    aliases = whole_number(aliases, "aliases", 1)
    step, z = sampling_angle(mill), np.asarray(z, dtype=complex)
    if not np.all(np.abs(np.abs(z) - 1) < 1e-9):
        raise ValueError(f"z = {z} leaves the unit circle, where the response is; stay on it")
    turn = np.angle(z)[..., None] + 2 * np.pi * np.arange(-aliases, aliases + 1)
    sigma = 1j * turn / step
    speed = _speed_response(mill, sigma, "command") / _cut_alone(mill, sigma, torque)
    hold, memory = zdomain.phi1(-sigma * step), zdomain.phi1(-sigma * mill.pitch)
    return mill.force_slope * mill.pitch * np.sum(hold * memory * speed, axis=-1)


def is_stable(mill: FaceMill, torque: str = "memory") -> bool:
    """Whether drive and cut alone are stable, without repetitive control.

    The zeros of 1 minus the loop through drive and cut in the right half plane are counted along
    the imaginary axis, up to the 100th harmonic of the turn.
    Raises ValueError for another torque, and when a zero lies too close to the axis to tell.
    """
    one_of(torque, (*TORQUES, "none"), "torque")
    turned = zdomain.turns_round_origin(
        lambda harmonic: _cut_alone(mill, 1j * harmonic, torque), 1e-6, 100.0, 2000
    )
    return round(2 * turned) == 0


def _cut_alone(mill: FaceMill, sigma: np.ndarray, torque: str) -> np.ndarray:
    """1 - (drive from torque to speed)(slope of the torque over the speed), without aliases."""
    memory = zdomain.phi1(-sigma * mill.pitch)
    slope = {"memory": mill.torque_slope * memory, "instantaneous": mill.torque_slope, "none": 0}
    return 1 - _speed_response(mill, sigma, "load") * slope[torque]


def _speed_response(mill: FaceMill, sigma: np.ndarray, source: str) -> np.ndarray:
    driven = spindle_drive.in_angle(spindle_drive.speed_driven(mill.drive), mill.speed)
    poles, residues = zdomain.modes(driven["speed", source])
    return sum(r / (sigma - p) for p, r in zip(poles, residues, strict=True))
