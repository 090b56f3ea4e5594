"""Metrics: Chamfer and point-to-mesh distances against libraries called in the plain way."""

from collections.abc import Callable
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from benchmarks.tables import number, span, table
from benchmarks.timing import ratio, spread, timed_in_turns
from n2n.metrics.chamfer import chamfer
from n2n.metrics.point_mesh import distances_to_mesh, point_to_mesh

TITLE = "Metrics"
TRIAL = {"points": 300, "subdivisions": 1, "rounds": 2}
_NOISE = 0.01


def run(points: int = 100_000, subdivisions: int = 5, rounds: int = 7) -> dict[str, Any]:
    """Measure.

    Args:
        points: Of each cloud.
        subdivisions: Of the mesh, an icosahedron's: 20 * 4^subdivisions faces.
        rounds: Turns.
    """
    import point_cloud_utils as pcu

    mesh = _dented_sphere(subdivisions)
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    random = np.random.default_rng(0)
    clean, other = (np.array(trimesh.sample.sample_surface(mesh, points, seed=seed)[0]) for seed in (0, 1))
    noisy = clean + _NOISE * random.standard_normal(clean.shape)

    def plain_chamfer() -> float:
        forth, back = cKDTree(other).query(noisy)[0], cKDTree(noisy).query(other)[0]
        return 0.5 * float((forth**2).mean() + (back**2).mean())

    def plain_forward() -> float:
        return float((pcu.closest_points_on_mesh(noisy, vertices, faces)[0].astype(float) ** 2).mean())

    def forward() -> float:
        return float((distances_to_mesh(noisy, vertices, faces) ** 2).mean())

    both, _ = timed_in_turns(lambda: point_to_mesh(noisy, vertices, faces), lambda: None, rounds=rounds)
    return {
        "points": points,
        "faces": len(faces),
        "rounds": rounds,
        "l2cd": _compare(lambda: chamfer(noisy, other, 2), plain_chamfer, rounds),
        "forward": _compare(forward, plain_forward, rounds),
        "p2m": {"ours": spread(both)},
    }


def render(result: dict[str, Any]) -> str:
    cd, forward, both = result["l2cd"], result["forward"], result["p2m"]["ours"]
    rows = [
        ["L2CD", "scipy's k-d tree, one core", *_cells(cd)],
        ["P2M, points to mesh", "point_cloud_utils", *_cells(forward)],
        ["P2M, both directions", "none: no library has faces to points", span(both, " s"), "", "", ""],
    ]
    header = ["metric", "against", "n2n", "other", "faster", "values differ by"]
    return "\n".join(
        [
            f"{result['points']:,} noisy points ({_NOISE:.0%}) against as many of the surface, and against its mesh of "
            f"{result['faces']:,} faces; {result['rounds']} turns.",
            "",
            table(header, rows),
        ]
    )


def _cells(row: dict[str, Any]) -> list[str]:
    times = [span(row["ours"], " s"), span(row["other"], " s"), span(row["ratio"], " x")]
    return [*times, f"{number(row['disagreement'])} (relative)"]


def _compare(ours: Callable[[], float], other: Callable[[], float], rounds: int) -> dict[str, Any]:
    first, second = timed_in_turns(ours, other, rounds=rounds)
    return {
        "ours": spread(first),
        "other": spread(second),
        "ratio": ratio(second, first),
        "disagreement": abs(other() / ours() - 1),
    }


def _dented_sphere(subdivisions: int) -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(subdivisions)
    mesh.vertices *= 1 + 0.2 * np.sin(5 * mesh.vertices).prod(axis=1, keepdims=True)
    return mesh
