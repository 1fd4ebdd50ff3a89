"""One function of many pieces, in this process or by the workers of an executor."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from typing import Any


def spread(
    function: Callable[[Any], Any], pieces: Iterable[Any], executor: Executor | None = None
) -> list[Any]:
    """Results of `function` for the pieces, in their order; the first exception is raised here.

    The pieces are cut by whoever calls, whatever the number of workers, so that the results are
    the same bit for bit.  For other processes the function must be one that pickle knows by name.
    Raises TypeError when `executor` is not a concurrent.futures.Executor.
    """
    if executor is None:
        return [function(piece) for piece in pieces]
    if not isinstance(executor, Executor):
        raise TypeError(
            f"executor = {executor!r} must be a concurrent.futures.Executor; "
            "for example ProcessPoolExecutor(2), or get_executor() of a Dask client"
        )
    return list(executor.map(function, list(pieces)))  # Dask maps no iterators
