"""The words for what the paper leaves open, and the check that a word is one of them."""

from __future__ import annotations

OUTPUTS = ("force", "torque")
MEASURES = ("sample", "interval", "pitch")
ENTRIES = ("one by one", "at once")
TORQUES = ("memory", "instantaneous")
LIMITS = ("clamp", "hold")

# What a run records after every step, in this order.
LOGGED = ("time", "speed", "current", "force", "torque", "out_of_cut", "saturated")
LOGGED += ("lowest_current", "highest_current")


def one_of(value: str, allowed: tuple[str, ...], name: str) -> None:
    """Raise ValueError when `value` is none of the `allowed` words."""
    if value not in allowed:
        raise ValueError(f"{name} {value!r} is none of {', '.join(allowed)}")
