"""The workers of an executor change nothing but who does the work."""

import multiprocessing
import operator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
from distributed import Client, LocalCluster

from rcbook.loops import repetitive
from rcbook.loops.repetitive import Process
from rcbook.machines import chatter
from rcbook.machines.chatter import RPM, Cut
from rcbook.spread import spread
from rcbook.zdomain import Plant

MODE = chatter.HANSON_TSAO2000.mode
LEAST = chatter.least_limit(MODE)
CUTS = Cut(MODE, 1.0, np.linspace(6000, 30_000, 70) * RPM, 0.2, 0.5)


def processes(workers):
    # started afresh: a copy of a process with threads may hang
    return ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))


@pytest.fixture(scope="module", params=["one process", "two processes", "threads", "dask"])
def executor(request):
    if request.param == "dask":
        here = {"processes": False, "dashboard_address": None}
        with (
            LocalCluster(n_workers=2, threads_per_worker=1, **here) as cluster,
            Client(cluster) as client,
        ):
            yield client.get_executor()
    else:
        pools = {"one process": (processes, 1), "two processes": (processes, 2)}
        kind, workers = pools.get(request.param, (ThreadPoolExecutor, 3))
        with kind(workers) as pool:
            yield pool


def test_a_chart_is_the_same_bit_for_bit(executor):
    axis = np.linspace(0.5, 4, 30) * LEAST
    alone = chatter.stability_chart(CUTS, axis)
    assert np.array_equal(chatter.stability_chart(CUTS, axis, executor), alone)


def test_multipliers_and_limits_are_the_same_bit_for_bit(executor):
    for mine, theirs in zip(
        chatter.floquet(CUTS), chatter.floquet(CUTS, executor=executor), strict=True
    ):
        assert np.array_equal(mine, theirs)
    limits = [
        chatter.stability_limit(CUTS, precision=0.02, executor=pool) for pool in (None, executor)
    ]
    assert np.array_equal(*limits)


def overshoot(run):
    """Negative while the output of a step of 20 stays below 24."""
    return float(run.output.max() - 24 if run.output[-1] > 18 else 18 - run.output[-1])


def test_acceptable_gains_are_the_same(executor):
    loop = repetitive.design(Process(Plant([0.5], [1, -0.5], 1, 1.0)), 6, 0.8)
    grid, step = np.arange(0.1, 1.8, 0.1), np.full(20, 20.0)
    alone = repetitive.acceptable_gains(loop, grid, overshoot, step)
    shared = repetitive.acceptable_gains(loop, grid, overshoot, step, executor=executor)
    assert shared == alone


def test_results_come_in_the_order_of_the_pieces(executor):
    assert spread(partial(operator.mul, 3), range(20), executor) == list(range(0, 60, 3))


def test_an_exception_of_a_piece_is_raised_here(executor):
    with pytest.raises(ZeroDivisionError):
        spread(partial(operator.truediv, 1), [2, 0, 4], executor)
    assert spread(abs, [-1], executor) == [1]  # and the executor goes on


def test_what_is_no_executor_is_refused():
    with pytest.raises(TypeError, match=r"executor = 2 must be a concurrent\.futures\.Executor"):
        spread(abs, [1], 2)
