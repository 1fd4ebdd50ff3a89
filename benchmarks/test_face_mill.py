"""What a turn of the cutter costs: the library beside SciPy's LSODA from tooth to tooth.

Both sides have a largest error of the speed at the samples of about 1e-5 rad/s, and ours the
smaller one; that is asserted before anything is timed.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from oracles.face_mill import Reference

from rcbook import zdomain
from rcbook.loops import repetitive
from rcbook.loops.repetitive import RepetitiveController
from rcbook.machines.face_mill import TSAO_PONG1991 as MILL
from rcbook.machines.face_mill import Experiment, Run, control_model, simulate, simulate_all

TURNS = 3
RTOL = 1e-7  # of LSODA
CUTS = {"light": (MILL, 2), "heavy": (replace(MILL, depth=4.5e-3), 3)}  # and steps per sample


def experiment(cut: str) -> Experiment:
    mill, substeps = CUTS[cut]
    inverse = zdomain.zero_phase_inverse(control_model(mill), cancel_unstable=True)
    memory = repetitive.plain(mill.samples_per_turn, zdomain.binomial_q(2))
    law = RepetitiveController(inverse, memory, gain=1.0)
    return Experiment(mill, law, controlled=2, engaged=1, turns=TURNS, substeps=substeps)


def at_samples(run: Run | Reference) -> np.ndarray:
    if isinstance(run, Run):
        return run.speed[:: run.experiment.substeps]
    return np.array(run.records["speed"])[:: run.QUARTERS]


def assert_no_worse(one: Experiment) -> None:
    truth = at_samples(Reference(one, TURNS, rtol=1e-9))
    ours, theirs = (
        np.abs(at_samples(run) - truth).max()
        for run in (simulate(one), Reference(one, TURNS, rtol=RTOL))
    )
    assert ours < theirs < 2e-5


@pytest.mark.parametrize("cut", CUTS)
def test_a_controlled_run_to_1e_5(row, cut):
    one = experiment(cut)
    assert_no_worse(one)
    row.faster(
        lambda: simulate(one),
        lambda: Reference(one, TURNS, rtol=RTOL),
        25,
        rounds=5,
        question=f"face mill under control, {cut} cut, {TURNS} turns, to 1e-5 rad/s",
        against="LSODA from tooth to tooth, no worse",
    )


def test_five_hundred_runs_abreast(row):
    """All of them, of which the peer runs one."""
    one = experiment("light")
    depths = MILL.depth * np.linspace(0.9, 1.1, 500)
    many = [replace(one, mill=replace(MILL, depth=depth)) for depth in depths]
    row.faster(
        lambda: simulate_all(many),
        lambda: Reference(one, TURNS, rtol=RTOL),
        300,
        rounds=3,
        parts=len(many),
        question=f"{len(many)} such runs abreast, light cut",
        against="one run of LSODA, no worse",
    )
