"""Q filters: symmetric, so without phase, and low-pass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rcbook.zdomain.checks import polynomial, whole_number
from rcbook.zdomain.polynomials import evaluate


def symmetric_fir(half: Sequence[float]) -> np.ndarray:
    """Taps of the zero-phase filter h0 + h1 (z + z^-1) + h2 (z^2 + z^-2) + ... from [h0, h1, ...].

    A Q filter of a repetitive loop has this form; its gain at z = 1 is h0 + 2 (h1 + h2 + ...).
    """
    half = polynomial(half, "half of a symmetric filter")
    return np.concatenate([half[:0:-1], half])


def binomial_q(passes: int = 1) -> np.ndarray:
    """Taps of the low-pass ((z + 2 + z^-1)/4)^passes, with gain 1 at z = 1 and 0 at z = -1."""
    taps = np.ones(1)
    for _ in range(whole_number(passes, "passes", least=0)):
        taps = np.convolve(taps, [0.25, 0.5, 0.25])
    return taps


def zero_phase_gain(taps: ArrayLike, z: ArrayLike) -> np.ndarray:
    """Real gain of a symmetric filter, given by all its taps, at points z of the unit circle."""
    taps = odd_symmetric(taps)
    z = np.asarray(z)
    return (z ** float(taps.size // 2) * evaluate(taps, z)).real


def odd_symmetric(taps: ArrayLike) -> np.ndarray:
    """Coerce to a symmetric filter with a middle tap.

    Raises ValueError when the number of taps is even or the two halves differ by more than
    rounding.
    """
    taps = polynomial(taps, "Q filter")
    if taps.size % 2 == 0 or not np.allclose(taps, taps[::-1], rtol=0, atol=1e-12):
        raise ValueError(
            f"Q filter {taps} must be symmetric about a middle tap; see zdomain.symmetric_fir"
        )
    return polynomial((taps + taps[::-1]) / 2)
