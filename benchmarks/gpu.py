"""On an NVIDIA GPU: the step against the card's own peaks, matching, time to quality, agreement with the CPU."""

import copy
import statistics
import time
from collections.abc import Callable, Sequence
from typing import Any

import torch

import n2n
from benchmarks.matching import leaves
from benchmarks.scene import NOISE, SHAPE, first_block
from benchmarks.tables import number, span, table
from benchmarks.timing import in_turns, ratio, spread
from benchmarks.traffic import Traffic
from n2n.geometry.shapes import SHAPES, scan
from n2n.tasks.field import Field
from n2n.transport.assignment import exact_assignment, matching_cost
from n2n.transport.batched import batched_assignment

TITLE = "GPU"
TRIAL = {
    "device": "cpu",
    "rounds": 2,
    "side": 64,
    "copied": 2**16,
    "steps": [300],
    "sizes": [(4, 8)],
    "points": [300],
    "iterations": [5],
    "compiled": False,
}
# Unit coordinates. float32 sums in another order: values to 1e-5 of the radius, directions to 1e-3.
_TOLERANCE = {"f": 1e-5, "grad f": 1e-3}
_ENOUGH = 1.02


def run(
    device: str = "cuda",
    rounds: int = 10,
    side: int = 8192,
    copied: int = 2**28,
    steps: Sequence[int] = (10_000, 50_000),
    sizes: Sequence[tuple[int, int]] = ((512, 64), (4096, 64), (4096, 127)),
    points: Sequence[int] = (10_000, 50_000, 200_000),
    iterations: Sequence[int] = (40, 80, 160),
    compiled: bool = True,
) -> dict[str, Any]:
    """Measure.

    Args:
        device: cuda; cpu is for trying this section out.
        rounds: Turns.
        side: Of the square matrices whose product gives the peak of floating-point operations.
        copied: float32 numbers whose copy gives the peak of bandwidth.
        steps: Sizes of the clouds whose optimiser step is measured.
        sizes: Leaves and points per leaf of the matchings.
        points: Sizes of the clouds that are fitted to the end.
        iterations: Lengths of these fits.
        compiled: Also measure the step with a compiled field.
    """
    if device == "cuda" and not torch.cuda.is_available():
        return {"skipped": "no CUDA device"}
    where = torch.device(device)
    peaks = _peaks(where, side, copied, rounds)
    quality = [_quality(where, count, iterations) for count in points]
    return {
        "device": torch.cuda.get_device_name() if where.type == "cuda" else device,
        "peaks": peaks,
        "steps": [_step(where, count, rounds, compiled, peaks) for count in steps],
        "matching": [_matching(where, b, k, rounds) for b, k in sizes],
        "quality": [row for rows, _ in quality for row in rows],
        "agreement": _agreement(quality[0][1], where),
    }


def render(result: dict[str, Any]) -> str:
    if "skipped" in result:
        return f"Skipped: {result['skipped']}."
    peaks = result["peaks"]
    steps = [
        [
            f"{row['points']:,}",
            span(row["eager"], " ms"),
            span(row["compiled"], " ms") if isinstance(row["compiled"], dict) else row["compiled"] or "-",
            f"{row['operations']:,}",
            f"{number(row['flops'] / 1e9)} GFLOP/s ({_percent(row['flops'] / peaks['flops'])})",
            f"{number(row['bytes'] / 1e9)} GB/s ({_percent(row['bytes'] / peaks['bytes'])})",
            _percent(row["roofline"]),
        ]
        for row in result["steps"]
    ]
    matching = [
        [row["leaves"], row["k"], span(row["batched"], " s"), span(row["scipy"], " s"), span(row["ratio"], " x")]
        for row in result["matching"]
    ]
    quality = [
        [
            f"{row['points']:,}",
            row["iterations"],
            *(f"{number(row[name]['seconds'])} s" for name in ("device", "cpu")),
            *(f"{1e4 * row[name]['error']:.2f}" for name in ("device", "cpu")),
            "yes" if row["reached"] else "no",
        ]
        for row in result["quality"]
    ]
    agreement = [
        [
            name,
            f"{row['largest']:.2g}",
            f"{row['tolerance']:g}",
            "yes" if row["largest"] <= row["tolerance"] else "**no**",
        ]
        for name, row in result["agreement"].items()
    ]
    headers = [
        ["points", "step", "field compiled", "operations", "floating point", "bandwidth", "of the roofline"],
        ["leaves", "points per leaf", "batched on the device", "scipy in threads", "faster"],
        ["points", "iterations", "fit", "on the CPU", "error x 10^4", "on the CPU", "as good as the CPU's best"],
        ["", "largest difference", "tolerance", "agrees"],
    ]
    notes = [
        f"{result['device']}: measured peaks {number(peaks['flops'] / 1e12)} TFLOP/s (float32 product, no TF32) and "
        f"{number(peaks['bytes'] / 1e9)} GB/s (copy, read and write). The step is a whole optimiser step; its "
        "operations and bytes are counted as eager torch asks for them, caches not considered.",
        "Matching of the same costs on the device and, from points to plan, by scipy on the CPU of the same machine; "
        f"summed costs agree to {max(row['disagreement'] for row in result['matching']):.1g}.",
        "Whole fits, preparation included. The error is the mean distance of the denoised points from the true "
        f"surface, relative to the bounding radius; as good means within {_ENOUGH - 1:.0%} of the CPU's best for the "
        "same cloud.",
        "The same field, evaluated on both devices.",
    ]
    parts = zip(notes, headers, (steps, matching, quality, agreement), strict=True)
    return "\n\n".join(f"{note}\n\n{table(header, rows)}" for note, header, rows in parts)


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def _clock(function: Callable[[], Any], device: torch.device) -> float:
    """Return the seconds of one call, until the device has finished."""
    _wait(device)
    start = time.perf_counter()
    function()
    _wait(device)
    return time.perf_counter() - start


def _clocks(*functions: Callable[[], Any], device: torch.device, rounds: int) -> tuple[list[float], ...]:
    """Time functions in turns, after two calls of each that are not counted."""
    for function in functions * 2:
        function()
    return in_turns(*[lambda f=function: _clock(f, device) for function in functions], rounds=rounds)


def _wait(device: torch.device) -> None:
    if device.type == "cuda":
        torch.cuda.synchronize()


def _peaks(device: torch.device, side: int, copied: int, rounds: int) -> dict[str, float]:
    """Measure the best this card does, not what its data sheet says."""
    a, b = torch.randn(2, side, side, device=device)
    x = torch.randn(copied, device=device)
    y = torch.empty_like(x)
    product, moved = _clocks(lambda: torch.mm(a, b), lambda: y.copy_(x), device=device, rounds=rounds)
    return {"flops": 2 * side**3 / min(product), "bytes": 2 * x.numel() * x.element_size() / min(moved)}


def _step(device: torch.device, points: int, rounds: int, compiled: bool, peaks: dict[str, float]) -> dict[str, Any]:
    """Measure optimiser steps that share one matching; `roofline` is the share of what the card could do with them."""
    step, queries = _stepper(device, points)
    times = _clocks(step, device=device, rounds=rounds)[0]
    with Traffic() as traffic:
        step()
    took = statistics.median(times)
    return {
        "points": points,
        "queries": queries,
        "eager": spread([1e3 * t for t in times]),
        "compiled": _compiled(device, points, rounds) if compiled else None,
        "operations": traffic.operations,
        "flops": traffic.flops / took,
        "bytes": traffic.bytes / took,
        "roofline": max(traffic.flops / peaks["flops"], traffic.bytes / peaks["bytes"]) / took,
    }


def _compiled(device: torch.device, points: int, rounds: int) -> dict[str, float] | str:
    """Measure the step with a compiled field; a compiler that fails is a result, too."""
    try:
        step, _ = _stepper(device, points, torch.compile)
        return spread([1e3 * t for t in _clocks(step, device=device, rounds=rounds)[0]])
    except Exception as error:
        return f"fails: {type(error).__name__}"


def _stepper(
    device: torch.device, points: int, wrap: Callable[..., Any] | None = None
) -> tuple[Callable[[], None], int]:
    """Return a function that does one optimiser step, and the number of queries in it."""
    module, block = first_block(points, device.type)
    generator, field = torch.Generator().manual_seed(0), module.field
    optimizer = module.configure_optimizers()["optimizer"]
    if wrap is not None:
        field.value_and_gradient = wrap(field.value_and_gradient)

    def step() -> None:
        optimizer.zero_grad()
        with field.shared():
            module.objective.loss(field, block, 0.0, generator)[0].backward()
        optimizer.step()

    return step, block.queries.shape[0] * block.queries.shape[1]


def _matching(device: torch.device, count: int, k: int, rounds: int) -> dict[str, Any]:
    source, target = leaves(count, k)
    there = source.to(device), target.to(device)
    batched, scipy = _clocks(
        lambda: batched_assignment(matching_cost(*there, 2)),
        lambda: exact_assignment(source, target, 2),
        device=device,
        rounds=max(1, rounds // 3),
    )
    plans = batched_assignment(matching_cost(*there, 2)).cpu(), exact_assignment(source, target, 2)
    sums = [
        float((source - target.gather(1, plan[..., None].expand(-1, -1, 3))).double().square().sum()) for plan in plans
    ]
    return {
        "leaves": len(source),
        "k": source.shape[1],
        "batched": spread(batched),
        "scipy": spread(scipy),
        "ratio": ratio(scipy, batched),
        "disagreement": abs(sums[0] / sums[1] - 1),
    }


def _quality(device: torch.device, points: int, iterations: Sequence[int]) -> tuple[list[dict[str, Any]], Field]:
    """Fit to the end with several lengths, on the device and on the CPU in turns."""
    cloud, rows = scan(SHAPE, points, NOISE), []
    for count in iterations:
        here, field = _fitted(cloud, device, count)
        rows.append({"points": points, "iterations": count, "device": here, "cpu": _fitted(cloud, "cpu", count)[0]})
    best = min(row["cpu"]["error"] for row in rows)
    for row in rows:
        row["reached"] = row["device"]["error"] <= _ENOUGH * best
    return rows, field


def _fitted(cloud: Any, device: torch.device | str, iterations: int) -> tuple[dict[str, float], Field]:
    start = time.perf_counter()
    field = n2n.fit(cloud, device=torch.device(device).type, overrides=[f"iterations={iterations}"])
    clean = field.denoise(cloud)
    seconds = time.perf_counter() - start
    error = float(abs(SHAPES[SHAPE][0](clean)).mean()) / field.frames[0].scale
    return {"seconds": seconds, "error": error}, field


def _agreement(field: Field, device: torch.device, queries: int = 100_000) -> dict[str, Any]:
    """Compare f and grad f of one field on both devices."""
    points = 2 * torch.rand(queries, 3, generator=torch.Generator().manual_seed(0)) - 1
    with torch.no_grad():
        here = copy.deepcopy(field.sdf).cpu().value_and_gradient(points)
        there = field.sdf.to(device).value_and_gradient(points.to(device))
    differences = [float((a - b.cpu()).abs().max()) for a, b in zip(here, there, strict=True)]
    return {
        name: {"largest": difference, "tolerance": tolerance}
        for (name, tolerance), difference in zip(_TOLERANCE.items(), differences, strict=True)
    }
