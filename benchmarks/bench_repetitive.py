"""How the library compares with python-control on one repetitive loop, as ratios of one run.

Run it with `python benchmarks/bench_repetitive.py`; it asserts nothing about time.
"""

from __future__ import annotations

import warnings

import control
import numpy as np
from timing import seconds

from rcbook.loops import repetitive
from rcbook.machines.peripheral_mill import HORNG1989

PERIODS = (6, 60, 300)
LONG_PERIODS = (6, 60, 100, 300, 1000)
SAMPLES = 600
GAIN = 0.8


def milling(period: int) -> repetitive.Loop:
    """The cascade of the thesis at another period, the plant left as it is."""
    pi = repetitive.pi_controller(0.064, 1.5, HORNG1989.plant.dt)
    return repetitive.design(repetitive.Process(HORNG1989.plant, pi), period, GAIN)


def closed_loop(loop: repetitive.Loop) -> control.StateSpace:
    """Reference to output as a python-control state space, blocks connected and not multiplied."""

    def block(num: np.ndarray, den: np.ndarray) -> control.StateSpace:
        size = max(num.size, den.size)
        num, den = (np.pad(p, (0, size - p.size)) for p in (num, den))
        return control.ss(control.tf(np.trim_zeros(num, "f"), den, loop.dt))

    repeat, path = loop.repetitive, loop.process.command_path
    return control.feedback(
        block(path.numerator, path.a) * block(repeat.numerator, repeat.denominator)
    )


def responses() -> None:
    """Time per sample of a step of the reference, and the largest difference of the forces."""
    reference = np.full(SAMPLES, 20.0)
    print(f"step response, {SAMPLES} samples, microseconds per sample")
    head = (
        "N",
        "simulate",
        "respond",
        "control",
        "control/simulate",
        "control/respond",
        "differ by",
    )
    print(("{:>5}" + "{:>18}" * 6).format(*head))
    for period in PERIODS:
        loop = milling(period)
        system, t = closed_loop(loop), loop.dt * np.arange(SAMPLES)
        ours = seconds(lambda loop=loop: repetitive.simulate(loop, reference))
        filtered = seconds(lambda loop=loop: repetitive.respond(loop, reference))
        theirs = seconds(lambda s=system, t=t: control.forced_response(s, t, reference))
        outputs = control.forced_response(system, t, reference).outputs
        differ = np.abs(outputs - repetitive.simulate(loop, reference).output).max()
        micro = [1e6 * s / SAMPLES for s in (ours, filtered, theirs)]
        numbers = (*micro, theirs / ours, theirs / filtered)
        print(f"{period:>5}" + "".join(f"{x:>18.2f}" for x in numbers) + f"{differ:>18.1e}")


def radii() -> None:
    """Time of the roots, the error of the largest, and what python-control says of it."""
    print("\nroots: the largest magnitude against |1 - k_r|^(1/N) and the cancelled zero")
    print(f"{'N':>5}{'seconds':>12}{'radius':>18}{'error':>12}{'control .poles()':>20}")
    for period in LONG_PERIODS:
        loop = milling(period)
        took = seconds(lambda period=period: repetitive.roots(milling(period)), least=0.0)
        radius = np.abs(repetitive.roots(loop)[0])
        truth = max((1 - GAIN) ** (1 / period), np.abs(loop.process.command_path.zeros).max())
        theirs = "not tried" if period > 100 else f"{rebuilt_radius(loop):.6f}"
        print(f"{period:>5}{took:>12.4f}{radius:>18.12f}{abs(radius - truth):>12.1e}{theirs:>20}")


def rebuilt_radius(loop: repetitive.Loop) -> float:
    """The radius from a transfer function that python-control multiplied out by itself."""
    z = control.tf("z")
    z.dt = loop.dt
    repeat, path = loop.repetitive, loop.process.command_path
    inverse = control.tf(repeat.compensator.b, np.pad(repeat.compensator.a, (0, 1)), loop.dt)
    store = GAIN * z**-(repeat.delay) / (1 - z ** -round(loop.period))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return float(np.abs(control.feedback(store * inverse * path.to_control()).poles()).max())


if __name__ == "__main__":
    responses()
    radii()
