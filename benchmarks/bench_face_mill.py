"""What a turn of the cutter costs: the library against scipy's solve_ivp, at equal accuracy.

The other side is the reference of the tests, LSODA from tooth to tooth with the memory of one pitch
by the method of steps; both are compared with a much finer run.  One process, ratios of one run.
Run it with `python benchmarks/bench_face_mill.py`; it asserts nothing about time.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from oracles.face_mill import Reference
from test_face_mill import FORCE, HEAVY, MILL, repetitive_controller

from rcbook.machines import face_mill
from rcbook.machines.face_mill import Experiment

TURNS = 4


def error(run: face_mill.Run, finest: face_mill.Run) -> float:
    """Largest error of the speed in rad/s at the samples."""
    at, fine = (r.speed[:: r.experiment.substeps] for r in (run, finest))
    return float(np.abs(at - fine).max())


def compare(name: str, one: Experiment) -> None:
    """A table of cost and error, and the ratio where the errors are nearest."""
    finest = face_mill.simulate(replace(one, substeps=96))
    ours, theirs = [], []
    for substeps in (4, 8, 16, 32):
        start = time.perf_counter()
        run = face_mill.simulate(replace(one, substeps=substeps))
        ours.append((error(run, finest), time.perf_counter() - start, f"{substeps} steps"))
    for rtol in (1e-4, 1e-5, 1e-6, 1e-7):
        start = time.perf_counter()
        run = Reference(one, TURNS, rtol=rtol)
        took = time.perf_counter() - start
        speed = np.array(run.records["speed"])[:: Reference.QUARTERS]
        off = float(np.abs(speed - finest.speed[:: finest.experiment.substeps]).max())
        theirs.append((off, took, f"rtol {rtol:.0e}"))
    print(f"\n{name}: seconds per turn, error of the speed in rad/s")
    for off, took, label in ours + theirs:
        print(f"  {label:12} {took / TURNS:8.3f} {off:10.1e}")
    for off, took, label in theirs:
        near = min(ours, key=lambda row: abs(np.log(row[0] / off)))
        print(f"  solve_ivp at {label}: {took / near[1]:.0f} times the cost of {near[2]}")


def abreast() -> None:
    """Cost of a turn when many runs go side by side."""
    one = Experiment(MILL, FORCE, turns=3, substeps=4)
    times = {}
    for runs in (1, 16, 256):
        start = time.perf_counter()
        face_mill.simulate_all([one] * runs)
        times[runs] = (time.perf_counter() - start) / runs
    print("\ncost of one run among many, relative to one alone")
    for runs, each in times.items():
        print(f"  {runs:4d} abreast: {each / times[1]:.3f}")


if __name__ == "__main__":
    compare("light cut", Experiment(MILL, FORCE, controlled=2, engaged=1, turns=TURNS))
    heavy = Experiment(HEAVY, repetitive_controller(HEAVY), controlled=2, engaged=1, turns=TURNS)
    compare("heavy cut", heavy)
    abreast()
