"""Rows of the table of costs: what a question costs, beside what else would have answered it.

`make bench` runs the files beside this one, prints a line a row and stores the run, from which the
page Cost and scale is made.  Both sides of a ratio are timed in turn, in one process.  A goal that
is missed is printed as missed; it fails nothing.
"""

from __future__ import annotations

import gc
import time
import tracemalloc
from collections.abc import Callable, Sequence
from importlib.metadata import version

import numpy as np
import pytest
import scipy.stats

Call = Callable[[], object]
_LEAST = 0.02  # s: a shorter call is repeated until it has taken so long, and divided


class Row:
    """One row: what is measured, against what, and the goal; a test calls one of its verbs once."""

    def __init__(self, benchmark, area: str) -> None:
        self.benchmark, self.area = benchmark, area

    def faster(
        self,
        ours: Call,
        peer: Call,
        goal: float,
        rounds: int = 7,
        parts: float = 1,
        **words: str,
    ) -> None:
        """How many times longer the peer takes; the goal is a least.

        Where the whole question would take the peer too long it answers one of so many `parts`.
        """
        times, peers = self._pairs(ours, peer, rounds)
        self._store(parts * peers / times, goal, "at least", "x", **words)
        self._costs(times, ours, peer)

    def floors(self, ours: Call, floor: Call, goal: float, rounds: int = 7, **words: str) -> None:
        """How many times longer ours takes than the floor; the goal is a most."""
        times, peers = self._pairs(ours, floor, rounds)
        self._store(times / peers, goal, "at most", " floors", **words)
        self._costs(times, ours, floor)

    def seconds(self, ours: Call, goal: float, rounds: int = 3, **words: str) -> None:
        """How long ours takes; the goal is a most."""
        times, _ = self._pairs(ours, lambda: None, rounds)
        self._store(times, goal, "at most", " s", **words)
        self._costs(times, ours)

    def growth(
        self,
        sizes: Sequence[int],
        make: Callable[[int], Call],
        goal: float,
        rounds: int = 3,
        **words: str,
    ) -> None:
        """Exponent of the time over the size, with its 95 % interval; the goal is a most."""
        calls = {size: make(size) for size in sizes}
        taken = [(size, seconds(call)) for _ in range(rounds) for size, call in calls.items()]
        size, took = np.log(taken).T
        line = scipy.stats.linregress(size, took)
        wide = scipy.stats.t.ppf(0.975, size.size - 2) * line.stderr
        self.benchmark.pedantic(calls[max(sizes)])
        middle = [line.slope - wide, line.slope, line.slope + wide]
        self._store(np.array(middle), goal, "at most", " exponent", **words)
        self.benchmark.extra_info["points"] = taken

    def value(self, found: float, goal: float, unit: str, **words: str) -> None:
        """A number that was measured otherwise, such as seconds of another process; at most."""
        self.benchmark.pedantic(lambda: None)
        self._store(np.array([found]), goal, "at most", f" {unit}", **words)

    def _pairs(self, ours: Call, peer: Call, rounds: int) -> tuple[np.ndarray, np.ndarray]:
        peers, times = [], []
        ours(), peer()  # what is worked out once, and imported late, is no cost of the question

        def before() -> None:
            peers.append(seconds(peer))

        self.benchmark.pedantic(lambda: times.append(seconds(ours)), setup=before, rounds=rounds)
        return np.array(times), np.array(peers)

    def _store(
        self, values: np.ndarray, goal: float, sense: str, unit: str, *, question: str, against: str
    ) -> None:
        median = float(np.median(values))
        self.benchmark.extra_info |= {
            "area": self.area,
            "question": question,
            "against": against,
            "median": median,
            "low": float(values.min()),
            "high": float(values.max()),
            "unit": unit,
            "sense": sense,
            "goal": goal,
            "met": bool(median >= goal if sense == "at least" else median <= goal),
        }

    def _costs(self, times: np.ndarray, ours: Call, peer: Call | None = None) -> None:
        self.benchmark.extra_info |= {"took": float(np.median(times)), "peak": peak(ours)}
        if peer is not None:
            self.benchmark.extra_info["peak_against"] = peak(peer)


def seconds(call: Call) -> float:
    """Time of one call, the mean of as many as take 0.02 s."""
    gc.collect()
    start = time.perf_counter()
    call()
    took, calls = time.perf_counter() - start, 1
    while took < _LEAST:
        more = min(1000, max(1, int(calls * (_LEAST / took - 1)) + 1))
        start = time.perf_counter()
        for _ in range(more):
            call()
        took, calls = took + time.perf_counter() - start, calls + more
    return took / calls


def peak(call: Call) -> int:
    """Bytes that a call holds at most, of what Python and NumPy take for it."""
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.fixture
def row(benchmark, request) -> Row:
    """A row of the table, under the first sentence of its file."""
    return Row(benchmark, request.module.__doc__.partition("\n")[0].rstrip("."))


def pytest_benchmark_update_machine_info(config, machine_info) -> None:
    """What says how fast the machine is stays, what says whose it is goes."""
    cpu = machine_info["cpu"]
    kept = {"cpu": cpu.get("brand_raw", ""), "cores": cpu.get("count"), "python": None}
    kept |= {"python": machine_info["python_version"], "system": machine_info["system"]}
    machine_info.clear()
    machine_info.update(kept)


def pytest_benchmark_update_json(config, benchmarks, output_json) -> None:
    """Which versions were compared, and from which commit; no branch, no author."""
    named = ("numpy", "scipy", "control", "rcbook")
    output_json["versions"] = {name: version(name) for name in named}
    for bench in output_json["benchmarks"]:  # the ratios say all that is shown
        bench.pop("options"), bench.pop("stats")
    commit = output_json["commit_info"]
    output_json["commit_info"] = {name: commit.get(name) for name in ("id", "time", "dirty")}


def pytest_terminal_summary(terminalreporter, config) -> None:
    """One line a row."""
    for bench in config._benchmarksession.benchmarks:
        info = bench["extra_info"]
        if info:
            terminalreporter.write_line(line(info))


def line(info: dict) -> str:
    """A row as text: question, peer, median (low to high), goal, met."""
    numbers = f"{info['median']:.3g}{info['unit']} ({info['low']:.3g} to {info['high']:.3g})"
    met = "met" if info["met"] else "NOT MET"
    goal = f"goal {info['sense']} {info['goal']:g}"
    return f"{info['question']:64} {info['against']:44} {numbers:34} {goal:16} {met}"
