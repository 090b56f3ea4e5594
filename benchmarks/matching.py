"""Matching: all leaves at once against scipy in a plain loop, and one plan of a million points."""

import json
import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from benchmarks.processes import child, peak_memory, resident_memory
from benchmarks.scene import NOISE, SHAPE
from benchmarks.tables import megabytes, number, span, table
from benchmarks.timing import ratio, spread, timed_in_turns
from n2n.geometry.shapes import scan
from n2n.transport.assignment import exact_assignment
from n2n.transport.pairing import StratifiedPairing

TITLE = "Matching"
TRIAL = {"sizes": [(8, 8), (4, 15)], "points": 2000, "rounds": 2}
_LEAF = 64


def run(
    sizes: Sequence[tuple[int, int]] = ((1024, 64), (512, 127)), points: int = 1_000_000, rounds: int = 7
) -> dict[str, Any]:
    """Measure.

    Args:
        sizes: Leaves and points per leaf.
        points: Of the large plan.
        rounds: Turns.
    """
    return {"leaves": [_leaves(b, k, rounds) for b, k in sizes], "plan": child("matching", points)}


def render(result: dict[str, Any]) -> str:
    rows = [
        [row["leaves"], row["k"], span(row["ours"], " s"), span(row["loop"], " s"), span(row["ratio"], " x")]
        for row in result["leaves"]
    ]
    large = result["plan"]
    return "\n".join(
        [
            "Squared distances included on both sides; leaves of two scans, cut as in a fit. The summed costs agree to "
            f"{max(row['disagreement'] for row in result['leaves']):.1g}.",
            "",
            table(["leaves", "points per leaf", "`exact_assignment`", "scipy in a plain loop", "faster"], rows),
            "",
            f"A plan of {large['points']:,} points on each side ({large['leaves']:,} leaves of {large['k']}): "
            f"cuts {number(large['cuts'])} s, matching {number(large['matching'])} s, peak memory "
            f"{megabytes(large['extra'])} above the {megabytes(large['before'])} of the process with both clouds.",
        ]
    )


def leaves(count: int, k: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return `count` leaves of k points of two scans of one shape."""
    clouds = [torch.as_tensor(scan(SHAPE, count * k, NOISE, seed), dtype=torch.float32) for seed in (0, 1)]
    first, second = StratifiedPairing(count * k, k)(*clouds, torch.Generator().manual_seed(0))
    return clouds[0][first], clouds[1][second]


def _leaves(count: int, k: int, rounds: int) -> dict[str, Any]:
    source, target = leaves(count, k)
    arrays = list(zip(source.double().numpy(), target.double().numpy(), strict=True))

    def loop() -> list[np.ndarray]:
        return [linear_sum_assignment(cdist(s, t, "sqeuclidean"))[1] for s, t in arrays]

    ours, theirs = timed_in_turns(lambda: exact_assignment(source, target, 2), loop, rounds=rounds)
    costs = [_cost(arrays, plan) for plan in (exact_assignment(source, target, 2).numpy(), loop())]
    return {
        "leaves": len(source),
        "k": source.shape[1],
        "ours": spread(ours),
        "loop": spread(theirs),
        "ratio": ratio(theirs, ours),
        "disagreement": abs(costs[0] / costs[1] - 1),
    }


def _cost(arrays: list[tuple[np.ndarray, np.ndarray]], plan: Sequence[np.ndarray]) -> float:
    return float(sum(np.square(s - t[phi]).sum() for (s, t), phi in zip(arrays, plan, strict=True)))


def plan(points: int) -> dict[str, Any]:
    """Match two clouds once, in this process; `extra` is the peak above what it held before."""
    generator = torch.Generator().manual_seed(0)
    clouds = torch.randn(2, points, 3, generator=generator)
    clouds /= clouds.norm(dim=-1, keepdim=True)
    source, target = clouds
    exact_assignment(source[None, :8], target[None, :8])
    before, start = resident_memory(), time.perf_counter()
    first, second = StratifiedPairing(points, _LEAF)(source, target, generator)
    cut = time.perf_counter()
    exact_assignment(source[first], target[second], 2)
    return {
        "points": points,
        "leaves": len(first),
        "k": first.shape[1],
        "cuts": cut - start,
        "matching": time.perf_counter() - cut,
        "before": before,
        "extra": max(0, peak_memory() - before),
    }


if __name__ == "__main__":
    print(json.dumps(plan(int(sys.argv[1]))))
