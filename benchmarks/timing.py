"""Times taken in turns, and how far they spread."""

import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any


def seconds(function: Callable[[], Any]) -> float:
    """Return the wall time of one call."""
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def in_turns(*measurements: Callable[[], Any], rounds: int) -> tuple[list[Any], ...]:
    """Measure A B A B ...: what disturbs a machine for a while disturbs all of them alike.

    Args:
        measurements: Each returns its own result.
        rounds: Results of each.
    """
    rows = [[measure() for measure in measurements] for _ in range(rounds)]
    return tuple(map(list, zip(*rows, strict=True)))


def timed_in_turns(*functions: Callable[[], Any], rounds: int) -> tuple[list[float], ...]:
    """Time functions in turns, after one call of each that is not counted."""
    for function in functions:
        function()
    return in_turns(*[lambda f=function: seconds(f) for function in functions], rounds=rounds)


def spread(values: Sequence[float]) -> dict[str, float]:
    """Return median, smallest and largest.

    >>> spread([3.0, 1.0, 2.0])
    {'median': 2.0, 'min': 1.0, 'max': 3.0}
    """
    return {"median": statistics.median(values), "min": min(values), "max": max(values)}


def ratio(above: Sequence[float], below: Sequence[float]) -> dict[str, float]:
    """Return the spread of the ratios of measurements of the same turn."""
    return spread([a / b for a, b in zip(above, below, strict=True)])
