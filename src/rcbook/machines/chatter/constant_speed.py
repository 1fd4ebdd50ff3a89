"""Exact results at constant speed: the stability lobes and the rightmost root."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rcbook.machines.chatter.cut import Cut, Mode, between, modal


def least_limit(mode: Mode) -> float:
    """Cutting stiffness 2 k zeta (1 + zeta) in N/m below which no constant speed chatters."""
    return float(2 * mode.stiffness * mode.damping_ratio * (1 + mode.damping_ratio))


def lobes(mode: Mode, speed: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Exact limit of the cutting stiffness (N/m) at constant speeds (rad/s), and its frequency.

    With 1/G(j w) = P + j Q the limit is K = -1/(2 Re G) = -(P^2 + Q^2)/(2 P), and the phase
    w tau - 2 atan(P/Q), which grows with w, is a whole number of turns.
    The frequency of chatter is in rad/s.  Raises ValueError when a speed is not positive.
    """
    speed = between(speed, "speed", 0.0, np.inf)
    natural, zeta = mode.natural_frequency, mode.damping_ratio
    delay = 2 * np.pi / speed
    # K falls up to this frequency and rises beyond it, so one of its two neighbours is lowest
    weakest = natural * np.sqrt(1 + 2 * zeta)
    turns = np.floor(_lobe_phase(mode, weakest, delay) / (2 * np.pi))
    least = np.floor(natural * delay / (2 * np.pi)) + 1
    candidates = [_lobe_frequency(mode, np.maximum(n, least), delay) for n in (turns, turns + 1)]
    limits = np.array([_lobe_limit(mode, frequency) for frequency in candidates])
    lower = np.argmin(limits, axis=0)
    return np.choose(lower, limits), np.choose(lower, candidates)


def _lobe_phase(mode: Mode, frequency: np.ndarray, delay: np.ndarray) -> np.ndarray:
    p = mode.stiffness - mode.mass * frequency**2
    return frequency * delay - 2 * np.arctan(p / (mode.damping * frequency))


def _lobe_limit(mode: Mode, frequency: np.ndarray) -> np.ndarray:
    p = mode.stiffness - mode.mass * frequency**2
    return -(p**2 + (mode.damping * frequency) ** 2) / (2 * p)


def _lobe_frequency(mode: Mode, turns: np.ndarray, delay: np.ndarray) -> np.ndarray:
    """The frequency above the natural one at which the phase is so many turns, by bisection."""
    low = np.full_like(delay, mode.natural_frequency)
    high = np.maximum(low, 2 * np.pi * turns / delay)
    for _ in range(60):
        middle = (low + high) / 2
        below = _lobe_phase(mode, middle, delay) < 2 * np.pi * turns
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return high


def rightmost_root(cut: Cut) -> np.ndarray:
    """Rightmost root s (1/s) of m s^2 + c s + k + K (1 - e^(-s tau)) = 0, tau = 2 pi/w0.

    Newton's method from two families of starts: whole numbers n of waves to a turn, in the form
    s tau = log(K/(m s^2 + c s + k + K)) + 2 pi j n, up to twice the frequency of the mode; and
    the free mode at stiffnesses from k to k + 2 K, which matters for weak cuts and short delays.
    Raises ValueError when the speed varies.
    """
    if np.any(cut.rva != 0):
        raise ValueError(f"rva = {cut.rva.ravel()}: only a constant speed has roots; set rva = 0")
    mode, k, tau = cut.mode, cut.cutting_stiffness[..., None], 2 * np.pi / cut.speed[..., None]
    highest = 2 * np.sqrt((mode.stiffness + cut.cutting_stiffness.max()) / mode.mass)
    n = np.arange(int(highest * tau.max() / (2 * np.pi)) + 3)
    wave = (1e-3 * mode.natural_frequency + 2j * np.pi * n / tau) * np.ones_like(k)
    free, _ = modal(mode, k * np.linspace(0, 2, 9))
    free = np.concatenate([free, 1j * free.imag], axis=-1)
    with np.errstate(all="ignore"):  # starts that run away are dropped
        for _ in range(100):
            p, slope = _in_contact(mode, k, wave)
            wave = wave - (wave * tau - np.log(k / p) - 2j * np.pi * n) / (tau + slope / p)
            p, slope = _in_contact(mode, k, free)
            free = free - (p - k * np.exp(-free * tau)) / (slope + k * tau * np.exp(-free * tau))
        s = np.concatenate([wave, free], axis=-1)
        size = np.abs(_in_contact(mode, k, s)[0] - k * np.exp(-s * tau))
    exact = size < 1e-9 * (mode.stiffness + k)
    best = np.argmax(np.where(exact, s.real, -np.inf), axis=-1)
    root = np.take_along_axis(s, best[..., None], -1)[..., 0]
    return root.real + 1j * np.abs(root.imag)


def _in_contact(mode: Mode, k: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """m s^2 + c s + stiffness + k, and its slope."""
    rigid = mode.mass * s + mode.damping
    return rigid * s + mode.stiffness + k, rigid + mode.mass * s
