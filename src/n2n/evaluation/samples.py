"""Points that stand for a surface: taken as they are, or drawn from a mesh."""

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from n2n.errors import InputError
from n2n.geometry.frame import Frame

_LOGGER = "trimesh"  # warns about even samplings that return fewer points; their number is reported anyway


@dataclass(frozen=True)
class Samples:
    """Points of a surface with the normals they may have.

    Attributes:
        points: (n, 3).
        normals: Unit normals, (n, 3), their orientation not to be relied on; None where unknown.
        origin: How they came about, in a few words.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64] | None
    origin: str

    def within(self, frame: Frame) -> "Samples":
        """Return them in the coordinates of a frame."""
        return Samples(frame.to_unit(self.points), self.normals, self.origin)

    def rows(self, rows: NDArray[np.int64]) -> "Samples":
        """Return some of them."""
        normals = None if self.normals is None else self.normals[rows]
        return Samples(self.points[rows], normals, f"{len(rows):,} of {self.origin}")


def draw(vertices: NDArray[np.float64], faces: NDArray[np.int64], count: int, sampler: str, seed: int) -> Samples:
    """Draw points from a mesh, with the normals of their faces.

    Args:
        vertices: (v, 3).
        faces: (f, 3).
        count: How many; `even` rejects some and may return fewer.
        sampler: uniform, even or poisson.
        seed: Of the draw.

    Raises:
        InputError: The mesh has no area.
    """
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    if not len(faces) or not mesh.area > 0:
        raise InputError("the mesh has no area: it cannot be sampled; give one with triangles")
    points, index = SAMPLERS[sampler](mesh, count, seed)
    return Samples(points, None if index is None else _face_normals(mesh)[index], f"{sampler} samples, seed {seed}")


def take(points: NDArray[np.float64], normals: NDArray[np.float64] | None, count: int | None, seed: int) -> Samples:
    """Take all points of a cloud, or as many as asked for, drawn without repetition.

    Args:
        points: (n, 3).
        normals: (n, 3) of any length, or None.
        count: None takes all; a smaller cloud is taken whole, too.
        seed: Of the draw.
    """
    unit = None if normals is None else _normalise(np.asarray(normals, np.float64))
    if count is None or len(points) <= count:
        return Samples(points, unit, "all points")
    rows = np.random.default_rng(seed).permutation(len(points))[:count]
    return Samples(points[rows], None if unit is None else unit[rows], f"points drawn of {len(points):,}, seed {seed}")


def _uniform(mesh: trimesh.Trimesh, count: int, seed: int) -> tuple[Any, Any]:
    return trimesh.sample.sample_surface(mesh, count, seed=seed)


def _even(mesh: trimesh.Trimesh, count: int, seed: int) -> tuple[Any, Any]:
    """Reject points closer than sqrt(area / 3 count), which leaves fewer than asked for."""
    log = logging.getLogger(_LOGGER)
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        return trimesh.sample.sample_surface_even(mesh, count, seed=seed)
    finally:
        log.setLevel(level)


def _poisson(mesh: trimesh.Trimesh, count: int, seed: int) -> tuple[Any, Any]:
    from n2n.geometry.poisson import poisson_disk

    return poisson_disk(np.asarray(mesh.vertices), np.asarray(mesh.faces), count, seed), None


SAMPLERS = {"uniform": _uniform, "even": _even, "poisson": _poisson}
"""Name -> function of mesh, count and seed that returns points (n, 3) and their faces (n,), or None."""


def _face_normals(mesh: trimesh.Trimesh) -> NDArray[np.float64]:
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    return _normalise(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def _normalise(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)
