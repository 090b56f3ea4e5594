"""Extraction: coarse to fine against a dense grid and scikit-image, each in a process of its own."""

import json
import sys
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import torch
from skimage.measure import marching_cubes

import n2n
from benchmarks.processes import child, peak_memory, resident_memory
from benchmarks.scene import NOISE, SHAPE
from benchmarks.tables import megabytes, span, table
from benchmarks.timing import in_turns, ratio, spread
from n2n.geometry.isosurface import extract, voxel_size
from n2n.geometry.shapes import scan
from n2n.tasks.field import Field
from n2n.tasks.surface import field_box

TITLE = "Extraction"
TRIAL = {"sizes": [(24, 1)], "points": 300, "overrides": ["iterations=10"]}
_CHUNK = 1 << 16  # points evaluated at once, as in n2n.geometry.sparse_grid


def run(
    sizes: Sequence[tuple[int, int]] = ((128, 3), (256, 3), (512, 1)),
    points: int = 10_000,
    overrides: Sequence[str] = (),
) -> dict[str, Any]:
    """Measure.

    Args:
        sizes: Resolutions and turns of each.
        points: Of the cloud that is fitted.
        overrides: Settings of the fit.
    """
    with tempfile.TemporaryDirectory() as folder:
        field = n2n.fit(scan(SHAPE, points, NOISE), device="cpu", overrides=overrides)
        field.save(folder)
        return {"rows": [_compare(folder, resolution, rounds) for resolution, rounds in sizes]}


def render(result: dict[str, Any]) -> str:
    rows = [
        [
            row["resolution"],
            span(row["sparse"]["seconds"], " s"),
            span(row["dense"]["seconds"], " s"),
            span(row["ratio"], " x"),
            f"{row['dense']['evaluations'] / row['sparse']['evaluations']:.1f} x",
            f"{megabytes(row['sparse']['peak'])} (+{megabytes(row['sparse']['extra'])})",
            f"{megabytes(row['dense']['peak'])} (+{megabytes(row['dense']['extra'])})",
            f"{row['sparse']['faces']:,} / {row['dense']['faces']:,}",
        ]
        for row in result["rows"]
    ]
    header = ["resolution", "sparse", "dense", "faster", "evaluations saved", "peak memory sparse", "dense", "faces"]
    return "\n".join(
        [
            f"A grid fitted to a scan of the {SHAPE}. Sparse is `extract` as `n2n reconstruct` calls it, with one "
            "evaluation more per vertex than dense. Dense evaluates every node of the same box, in slabs, into one "
            "float32 volume, and runs scikit-image's marching cubes on all of it; nothing is extrapolated. Memory is "
            "that of the whole process (in brackets: above what it held before); each measurement has its own. Turns: "
            + ", ".join(f"{row['rounds']} at {row['resolution']}" for row in result["rows"])
            + ".",
            "",
            table(header, rows),
        ]
    )


def _compare(run_dir: str, resolution: int, rounds: int) -> dict[str, Any]:
    ours, theirs = in_turns(
        partial(child, "extraction", "sparse", run_dir, resolution),
        partial(child, "extraction", "dense", run_dir, resolution),
        rounds=rounds,
    )
    times = [[one["seconds"] for one in ones] for ones in (ours, theirs)]
    return {
        "resolution": resolution,
        "rounds": rounds,
        "sparse": _together(ours),
        "dense": _together(theirs),
        "ratio": ratio(times[1], times[0]),
    }


def _together(ones: list[dict[str, Any]]) -> dict[str, Any]:
    largest = {name: max(one[name] for one in ones) for name in ("peak", "extra", "evaluations", "faces")}
    return {**largest, "seconds": spread([one["seconds"] for one in ones])}


def once(way: str, run_dir: str, resolution: int) -> dict[str, Any]:
    """Extract the surface of a saved field in this process."""
    field = Field.load(run_dir, "cpu")
    lower, upper = field_box(field.config)
    voxel = voxel_size(lower, upper, resolution)
    codes = torch.zeros(_CHUNK, dtype=torch.long)

    def evaluate(points: torch.Tensor) -> torch.Tensor:
        return field.sdf(points.to(torch.float32), codes[: len(points)])

    with torch.no_grad(), field.sdf.shared():
        before, start = resident_memory(), time.perf_counter()
        faces, evaluations = (_sparse if way == "sparse" else _dense)(evaluate, lower, upper, voxel)
        seconds = time.perf_counter() - start
    peak = peak_memory()
    return {
        "seconds": seconds,
        "evaluations": evaluations,
        "faces": faces,
        "peak": peak,
        "extra": max(0, peak - before),
    }


def _sparse(evaluate: Any, lower: np.ndarray, upper: np.ndarray, voxel: float) -> tuple[int, int]:
    surface = extract(evaluate, lower, upper, voxel, polish=1)
    return len(surface.faces), surface.evaluations


def _dense(evaluate: Any, lower: np.ndarray, upper: np.ndarray, voxel: float) -> tuple[int, int]:
    nodes = np.ceil((upper - lower) / voxel - 1e-6).astype(int) + 1
    x, y, z = (torch.as_tensor(lower[axis] + voxel * np.arange(nodes[axis])) for axis in range(3))
    slab = torch.cartesian_prod(x[:1], y, z)
    volume = np.empty(nodes, np.float32)
    for i in range(len(x)):
        slab[:, 0] = x[i]
        volume[i] = torch.cat([evaluate(part) for part in slab.split(_CHUNK)]).view(len(y), len(z)).numpy()
    _, faces, _, _ = marching_cubes(volume, 0.0, spacing=(voxel,) * 3, gradient_direction="descent")
    return len(faces), volume.size


if __name__ == "__main__":
    print(json.dumps(once(sys.argv[1], sys.argv[2], int(sys.argv[3]))))
