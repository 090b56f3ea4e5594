"""Triangles as arrays: which of them a mesh stands for, and their exact distances to points.

Coordinates come first here, (3, k) and (3 corners, 3, k): sums over coordinates then add whole rows, which is several
times faster than over (k, 3).
"""

import numpy as np
from numpy.typing import NDArray

from n2n.errors import InputError
from n2n.metrics.nearest import as_points

Array = NDArray[np.float64]


def triangles_of(
    vertices: Array, faces: NDArray[np.int64], min_triangle_area: float = 0.0
) -> tuple[Array, NDArray[np.int64]]:
    """Return the triangles of a mesh; one smaller than the guard is replaced by its edges.

    Args:
        vertices, faces: (v, 3) and (f, 3).
        min_triangle_area: Guard of pytorch3d, unit^2: a face of smaller area counts only by its three edges.

    Returns:
        Triangles (3 corners, 3 coordinates, t), an edge being a triangle with two equal corners; and the face each of
        them belongs to, (t,), ascending.

    Raises:
        InputError: No faces, faces that are not triangles, or that name vertices which do not exist.

    Source: pytorch3d csrc/utils/geometry_utils.cuh, IsInsideTriangle and PointTriangle3DistanceForward.
    """
    vertices, faces = as_points(vertices, "vertices"), np.asarray(faces)
    if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        raise InputError(f"faces: a mesh needs triangles, an array of shape (f, 3) with f > 0, got {faces.shape}")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"faces: vertices {faces.min()} to {faces.max()} are named, there are {len(vertices)}")
    corners = np.ascontiguousarray(vertices[faces].transpose(1, 2, 0))
    owner = np.arange(len(faces))
    a, b, c = corners
    small = 0.5 * np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0) < min_triangle_area
    if not small.any():
        return corners, owner
    a, b, c = corners[:, :, small]
    edges = [np.stack(edge) for edge in ((a, b, b), (b, c, c), (c, a, a))]
    owner = np.concatenate([owner[~small], *[owner[small]] * 3])
    order = np.argsort(owner, kind="stable")
    return np.concatenate([corners[:, :, ~small], *edges], axis=2)[:, :, order], owner[order]


def offsets_to(points: Array, triangles: Array) -> tuple[Array, Array]:
    """Find the point of each triangle that is nearest to the point beside it.

    The nearest point lies on an edge or is the foot of the perpendicular. All are tried and the nearest is taken, so
    that no rounding of a sliver's normal can choose wrongly.

    Args:
        points: (3, k).
        triangles: (3 corners, 3, k).

    Returns:
        Vectors (3, k) from the points to the nearest points of the triangles, and their squared lengths (k,).

    Source: Ericson, Real-Time Collision Detection, 5.1.5, for the foot of the perpendicular.
    """
    a = triangles[0] - points
    ab, ac = triangles[1] - triangles[0], triangles[2] - triangles[0]
    d1, d2 = -_dot(ab, a), -_dot(ac, a)
    bb, bc, cc = _dot(ab, ab), _dot(ab, ac), _dot(ac, ac)
    # Weights of the foot, times the squared area of the parallelogram.
    v, w, area = cc * d1 - bc * d2, bb * d2 - bc * d1, bb * cc - bc * bc
    inside = (v > 0) & (w > 0) & (v + w < area)
    scale = 1 / np.where(inside, area, 1.0)
    best = a + (np.where(inside, v, 0.0) * scale) * ab + (np.where(inside, w, 0.0) * scale) * ac
    squared = _dot(best, best)
    for start, edge, along, length in (
        (a, ab, d1, bb),
        (a, ac, d2, cc),
        (a + ab, ac - ab, d2 - d1 + bb - bc, bb + cc - 2 * bc),
    ):
        share = np.clip(along / np.where(length > 0, length, 1.0), 0.0, 1.0)
        offset = start + share * edge
        length_of = _dot(offset, offset)
        closer = length_of < squared
        best, squared = np.where(closer, offset, best), np.where(closer, length_of, squared)
    return best, squared


def _dot(a: Array, b: Array) -> Array:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
