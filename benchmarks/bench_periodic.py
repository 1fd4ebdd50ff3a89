"""Three ways to the one-period matrix, and verdicts at long periods, as ratios of one run.

Run it with `python benchmarks/bench_periodic.py`; it asserts nothing about time.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from timing import seconds

from rcbook import zdomain
from rcbook.loops import periodic
from rcbook.machines.boring_bar import HANSON_TSAO2000, sinusoidal_intervals

ROUTES = {
    "product of eq. 10": periodic.product_of_matrices,
    "appendix": periodic.lifted,
    "recursion": periodic.dense,
}


def scheduled(n: int, gamma: float = 0.3, q: tuple[float, ...] = (1.0,)) -> periodic.PeriodicLoop:
    """The gain-scheduled design on the boring bar."""
    bar = HANSON_TSAO2000
    intervals = sinusoidal_intervals(bar.sampling_interval, gamma, n)
    plant = periodic.sample(bar.plant, intervals)
    return periodic.PeriodicLoop(
        plant, periodic.zero_phase(bar.plant, intervals), periodic.plain(n, q)
    )


def routes() -> None:
    """Time to form the matrix, relative to the appendix at the same period."""
    print("forming the one-period matrix, relative to the appendix")
    print(f"{'N':>6}" + "".join(f"{name:>20}" for name in ROUTES))
    for n in (16, 32, 64, 128, 256):
        loop = scheduled(n)
        times = {
            name: seconds(lambda way=way, loop=loop: way(loop)) for name, way in ROUTES.items()
        }
        print(f"{n:6d}" + "".join(f"{t / times['appendix']:20.2f}" for t in times.values()))


def verdicts() -> None:
    """Time of a verdict, relative to one application of the one-period map."""
    print("\none verdict, in applications of the one-period map")
    for n in (128, 512, 2048):
        loop = scheduled(n)
        once = periodic.one_period_map(loop)
        state = np.ones(once.shape[0])
        each = seconds(lambda once=once, state=state: once @ state)
        energy = seconds(lambda loop=loop: periodic.verdict(replace(loop)))  # a loop not yet judged
        counted = seconds(lambda loop=loop: periodic.count_outside(loop))
        print(f"{n:6d}: by energy {energy / each:8.0f}, by counting {counted / each:8.0f}")


def noise() -> None:
    """Time of a noise gain, relative to one product of matrices as large as the state."""
    print("\none noise gain, in products of dense matrices of the states")
    for n in (150, 600, 1200):
        loop = scheduled(n, q=zdomain.symmetric_fir([0.8, 0.1]))
        matrix = periodic.dense(loop)
        product = seconds(lambda matrix=matrix: matrix @ matrix)
        gain = seconds(lambda loop=loop: periodic.noise_gain(loop))
        print(f"{n:6d}: {gain / product:8.1f}")


if __name__ == "__main__":
    routes()
    verdicts()
    noise()
