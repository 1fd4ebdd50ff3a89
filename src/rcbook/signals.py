"""Periodic references and disturbances, and what one measures on a response."""

from __future__ import annotations

import numpy as np
import scipy  # its signal is loaded when asked for, and takes half a second
from numpy.typing import ArrayLike

from rcbook.zdomain import real_number, whole_number


def signal(values: ArrayLike, name: str = "signal", length: int | None = None) -> np.ndarray:
    """Coerce to a 1-D float array of finite samples.

    Raises ValueError for another shape, another length, NaN or infinity.
    """
    array = np.asarray(values)
    if np.iscomplexobj(array):
        raise ValueError(f"{name} is complex; give real samples")
    array = array.astype(float)  # a copy: the caller may go on using the record
    if array.ndim != 1 or array.size == 0:
        raise ValueError(f"{name} has shape {array.shape}; give one non-empty row of samples")
    if length is not None and array.size != length:
        raise ValueError(f"{name} has {array.size} samples, {length} are needed; make them agree")
    if not np.all(np.isfinite(array)):
        first = int(np.argmin(np.isfinite(array)))
        raise ValueError(f"{name} holds {array[first]} at sample {first}; give finite samples")
    return array


def step(height: float, n: int, start: int = 0) -> np.ndarray:
    """n samples: 0 before sample `start`, `height` from there on."""
    late = np.arange(whole_number(n, "n")) >= whole_number(start, "start", 0)
    return np.where(late, real_number(height, "height"), 0.0)


def sinusoid(
    amplitude: float, frequency: float, dt: float, n: int, phase: float = 0.0
) -> np.ndarray:
    """n samples of amplitude sin(2 pi frequency k dt + phase); frequency in Hz, phase in rad."""
    angle = 2 * np.pi * frequency * dt * np.arange(whole_number(n, "n")) + phase
    return signal(real_number(amplitude, "amplitude") * np.sin(angle), "sinusoid")


def triangle(
    amplitude: float, frequency: float, dt: float, n: int, bias: float = 0.0, phase: float = 0.0
) -> np.ndarray:
    """n samples of a triangular wave about `bias`; a lower tip lies at phase 0 (rad)."""
    angle = 2 * np.pi * frequency * dt * np.arange(whole_number(n, "n")) + phase
    wave = scipy.signal.sawtooth(angle, width=0.5)
    return signal(bias + real_number(amplitude, "amplitude") * wave, "triangle")


def periodic(shape: ArrayLike, n: int, period: float | None = None) -> np.ndarray:
    """n samples of the periodic signal whose one period is `shape`, of `period` samples if given.

    A period that is not the number of samples of the shape is reached by its trigonometric
    interpolation, without the harmonics beyond half the sampling frequency.
    Raises ValueError for a period that is not positive.
    """
    shape, n = signal(shape, "shape"), whole_number(n, "n")
    if period is None:
        return np.resize(shape, n)
    period = real_number(period, "period", positive=True)
    size = shape.size
    order = np.arange(min(size, int(np.floor(period))) // 2 + 1)
    twice = np.where((order == 0) | (2 * order == size), 1, 2)  # the mirror image below zero
    turned = np.exp(2j * np.pi * np.outer(np.arange(n), order) / period)
    return (turned @ (twice * np.fft.rfft(shape)[order])).real / size


def random_period(period: int, amplitude: float, rng: np.random.Generator) -> np.ndarray:
    """One period of a random shape with zero mean, scaled so that max - min = 2 amplitude."""
    shape = rng.standard_normal(whole_number(period, "period", 2))
    shape -= shape.mean()
    return shape * 2 * amplitude / spread(shape)


def spread(y: ArrayLike) -> float:
    """Maximum minus minimum."""
    return float(np.ptp(signal(y)))


def rms(y: ArrayLike) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(signal(y) ** 2)))


def overshoot(y: ArrayLike, target: float) -> float:
    """How far y exceeds a target of either sign, in percent of it; 0 when it never does.

    Raises ValueError when the target is zero or not finite.
    """
    if real_number(target, "target") == 0:
        raise ValueError("overshoot in percent needs a target other than 0")
    return max(0.0, 100 * float(np.max(signal(y) / target) - 1))


def settling_time(y: ArrayLike, target: ArrayLike, band: float, dt: float, hold: int = 1) -> float:
    """Time in s of the last entry into |y - target| <= band, counted from the first sample.

    It is the instant of the first sample from which on no sample is outside; infinite when not
    even the last `hold` samples are inside, because the record then does not show a settled
    response; an oscillation needs a hold of several of its periods.  `target` is one value or a
    signal as long as y.
    Raises ValueError when the band or dt is not positive, or y and the target do not fit.
    """
    y, band = signal(y, "y"), real_number(band, "band", positive=True)
    dt = real_number(dt, "dt", positive=True)
    target = np.full(y.size, float(target)) if np.ndim(target) == 0 else target
    outside = np.flatnonzero(np.abs(y - signal(target, "target", y.size)) > band)
    if outside.size == 0:
        return 0.0
    unsettled = outside[-1] >= y.size - whole_number(hold, "hold")
    return np.inf if unsettled else float((outside[-1] + 1) * dt)


def harmonic(y: ArrayLike, period: float, order: int = 1) -> complex:
    """Complex amplitude c of the harmonic |c| cos(2 pi order k/period + arg c) of y.

    y must hold whole periods, each of them whole or not; raises ValueError when it does not.
    """
    y, period = signal(y), real_number(period, "period", positive=True)
    turns = round(y.size / period)
    if turns < 1 or abs(turns * period - y.size) > 1e-9 * y.size:
        raise ValueError(f"{y.size} samples are not whole periods of {period:g}; cut the record")
    k = np.arange(y.size)
    scale = 1 if 2 * order * turns % y.size == 0 else 2
    return scale * complex(np.mean(y * np.exp(-2j * np.pi * order * k / period)))


def phase_between(y: ArrayLike, x: ArrayLike, period: float) -> float:
    """Phase of y relative to x at the fundamental, degrees from -180 to 180; a lag is negative.

    Raises ValueError when either has no fundamental to speak of (below 1e-9 of its size).
    """
    ours, theirs = harmonic(y, period), harmonic(x, period)
    if min(abs(ours) / (rms(y) or 1), abs(theirs) / (rms(x) or 1)) < 1e-9:
        raise ValueError(f"no fundamental of period {period:g} in one of the signals: no phase")
    return float(np.degrees(np.angle(ours / theirs)))
