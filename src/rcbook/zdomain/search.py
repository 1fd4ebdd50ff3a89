"""Where something stops being true."""

from __future__ import annotations

from collections.abc import Callable

from rcbook.zdomain.checks import real_number


def boundary(
    holds: Callable[[float], bool], inside: float, outside: float, precision: float
) -> float:
    """The last number at which `holds` is true on the way from `inside` to `outside`, by bisection.

    It holds there, and `precision` farther on it does not.  Of several changes on the way one is
    found.
    Raises ValueError when it does not hold `inside`, and for numbers that are not finite.
    """
    inside, outside = real_number(inside, "inside"), real_number(outside, "outside")
    precision = real_number(precision, "precision", positive=True)
    if not holds(inside):
        raise ValueError(f"it does not hold at inside = {inside!r}; begin where it does")
    while abs(outside - inside) > precision:
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if holds(middle) else (inside, middle)
    return inside
