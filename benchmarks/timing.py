"""How long a call takes, for the benchmarks beside this file."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np


def seconds(call: Callable[[], object], least: float = 0.2) -> float:
    """Best time of one call, repeated until `least` seconds have gone by."""
    best, spent = np.inf, 0.0
    while best == np.inf or spent < least:
        start = time.perf_counter()
        call()
        took = time.perf_counter() - start
        best, spent = min(best, took), spent + took
    return best
