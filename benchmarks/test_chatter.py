"""Chatter of a cut at a varying speed.

The other side is semi-discretisation as in the textbook of Insperger and Stepan: equal steps of
time, a delayed position that is linear in a step, and all eigenvalues of the dense map.
"""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import scipy.linalg

from rcbook.machines import chatter
from rcbook.machines.chatter import RPM, Cut

MODE = chatter.HANSON_TSAO2000.mode
SPEEDS = np.linspace(3000, 12000, 200) * RPM
STIFFNESS = np.linspace(0.5, 4, 200) * chatter.least_limit(MODE)
CHART = Cut(MODE, 1.0, SPEEDS, rva=0.2, rvf=0.2)
FEW = CHART.take(slice(20, None, 40))  # five speeds of the chart, evenly spread
AGAINST = "textbook semi-discretisation"


def lags(cut: Cut, time: np.ndarray) -> np.ndarray:
    """Time in s that the last turn took, by Newton's method."""
    beat, swing, lag = cut.rvf * cut.speed, cut.rva / cut.rvf, 2 * np.pi / cut.speed
    for _ in range(20):
        then = time - lag
        turned = cut.speed * (time - then) + swing * (np.cos(beat * then) - np.cos(beat * time))
        lag = lag + (2 * np.pi - turned) / (cut.speed * (1 + cut.rva * np.sin(beat * then)))
    return lag


def textbook(cut: Cut, stiffness: np.ndarray, per_cycle: int = 12) -> np.ndarray:
    """Largest absolute multiplier at one speed, for all stiffnesses at once."""
    period, mode, n = 2 * np.pi / (cut.rvf * cut.speed), cut.mode, stiffness.size
    steps = int(np.ceil(per_cycle * period * mode.natural_frequency / (2 * np.pi)))
    dt = period / steps
    back = lags(cut, (np.arange(steps) + 0.5) * dt) / dt
    turn = int(np.ceil(back.max())) + 1
    a = np.zeros((n, 4, 4))  # position, speed, old position at the start of a step, and its rise
    a[:, 0, 1], a[:, 2, 3] = 1, 1 / dt
    a[:, 1, 0], a[:, 1, 1] = -(mode.stiffness + stiffness) / mode.mass, -mode.damping / mode.mass
    a[:, 1, 2] = stiffness / mode.mass
    one_step = scipy.linalg.expm(a * dt)[:, :2]
    x = np.zeros((n, turn + 1 + steps, turn + 2))  # positions as rows over the first state
    x[:, turn - np.arange(turn + 1), np.r_[0, 2 : turn + 2]] = 1
    v = np.zeros((n, turn + 2))
    v[:, 1] = 1
    for i in range(steps):
        first, share = divmod(i + turn - back[i], 1)
        old = x[:, int(first) : int(first) + 3]
        start, end = ((1 - share) * old[:, k] + share * old[:, k + 1] for k in (0, 1))
        new = one_step @ np.stack([x[:, i + turn], v, start, end - start], axis=1)
        x[:, i + turn + 1], v = new[:, 0], new[:, 1]
    last = x[:, steps:][:, ::-1]
    period_map = np.concatenate([last[:, :1], v[:, None], last[:, 1:]], axis=1)
    return np.abs(np.linalg.eigvals(period_map)).max(axis=1)


def all_textbook(cuts: Cut, stiffness: np.ndarray) -> np.ndarray:
    """Whether each cut is stable at each stiffness."""
    rows = [textbook(cuts.take(i), stiffness) < 1 for i in range(cuts.speed.size)]
    return np.array(rows)


def test_points(row):
    points = Cut(MODE, STIFFNESS[::10], FEW.speed[:, None], 0.2, 0.2)
    row.faster(
        lambda: chatter.floquet(points),
        lambda: all_textbook(FEW, STIFFNESS[::10]),
        goal=8,
        rounds=5,
        question="growth at 5 x 20 points, variable speed",
        against=AGAINST,
    )


def test_chart(row):
    row.faster(
        lambda: chatter.stability_chart(CHART, STIFFNESS),
        lambda: all_textbook(FEW, STIFFNESS),
        goal=100,
        rounds=2,
        parts=CHART.speed.size / FEW.speed.size,
        question="chart of 200 x 200 points, with its islands",
        against="textbook semi-discretisation",
    )


def test_two_processes(row):
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        row.faster(
            lambda: chatter.stability_chart(CHART, STIFFNESS, pool),
            lambda: chatter.stability_chart(CHART, STIFFNESS),
            goal=1.5,
            rounds=3,
            question="chart of 200 x 200 points by two worker processes",
            against="one process",
        )
