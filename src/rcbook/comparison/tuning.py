"""One rule by which unlike controllers are made comparable: what they may spend is the same.

A controller that acts faster hears more of the noise and forgives less delay.  Both are spent:
the noise gain up to a budget, and the delay margin down to one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rcbook.zdomain import boundary, real_number

_PRECISION = 1e-3  # of the logarithm of a gain, and of a width
_MOST, _LEAST = 1.9, 1e-3  # gains; at 2 a memory round an exact inverse is lost
_AMBITIOUS = 0.98  # of widths; at 1 a memory keeps modes that its plant may stop


@dataclass(frozen=True)
class Budget:
    """What every controller may spend: noise gain, sensor to output, and delay margin."""

    noise_gain: float  # at most
    delay_margin: float  # at least, samples

    def __post_init__(self) -> None:
        for name in ("noise_gain", "delay_margin"):
            object.__setattr__(self, name, real_number(getattr(self, name), name, True))


@dataclass(frozen=True, eq=False)
class Tuned:
    """A controller as the rule sets it, and which of the budgets it spends.

    `spends` is "both", "noise" or "delay"; "neither" at the largest gain that is looked for;
    "noise, over on delay" where no gain holds the delay margin; and "none", with no loop, where no
    gain holds the noise budget.
    """

    loop: Any
    gain: float
    width: float  # 0 to 1, NaN where there is none
    noise_gain: float
    delay_margin: float  # samples
    spends: str


def tune(
    make: Callable[[float, float], Any],
    noise_gain: Callable[[Any], float],
    delay_margin: Callable[[Any], float],
    budget: Budget,
    has_width: bool = False,
) -> Tuned:
    """Set the gain, and the width if there is one, of make(gain, width) by the rule.

    The gain is the largest that holds the noise budget.  The width, from 0 (careful) to 0.98, is
    the largest at which this gain holds the delay margin; where not even 0 does, or there is no
    width, the gain is lowered until the margin holds.  Where no gain does, the noise budget alone
    decides.  Gains are looked for from 1.9 downward, to 0.001.
    `noise_gain` and `delay_margin` of a loop that is not stable have to be infinite and 0.
    """
    ambitious = _AMBITIOUS if has_width else np.nan

    def loudest(width: float) -> float:
        return _largest(lambda gain: noise_gain(make(gain, width)) <= budget.noise_gain)

    def holds(gain: float, width: float) -> bool:
        return bool(gain) and delay_margin(make(gain, width)) >= budget.delay_margin

    def result(gain: float, width: float, spends: str) -> Tuned:
        if not gain:
            return Tuned(None, np.nan, np.nan, np.nan, np.nan, "none")
        loop = make(gain, width)
        return Tuned(loop, gain, width, noise_gain(loop), delay_margin(loop), spends)

    gain = loudest(ambitious)
    if not gain or holds(gain, ambitious):
        return result(gain, ambitious, "noise" if gain < _MOST else "neither")
    careful, least = (0.0, loudest(0.0)) if has_width else (np.nan, gain)
    if has_width and holds(least, careful):
        width = boundary(lambda w: holds(loudest(w), w), careful, ambitious, _PRECISION)
        return result(loudest(width), width, "both")
    lower = _largest(lambda gain: gain <= least and holds(gain, careful))
    if not lower:
        return result(gain, ambitious, "noise, over on delay")
    return result(lower, careful, "delay")


def _largest(allowed: Callable[[float], bool]) -> float:
    """The largest gain that is allowed, 0 where none is: halved until it is, and bisected."""
    gain = _MOST
    while not allowed(gain):
        gain /= 2
        if gain < _LEAST:
            return 0.0
    if gain == _MOST:
        return gain
    inside, outside = np.log(gain), np.log(2 * gain)
    return float(np.exp(boundary(lambda x: allowed(np.exp(x)), inside, outside, _PRECISION)))
