"""Distances between points and a mesh, exact and in float64."""

from typing import NamedTuple

import numpy as np
import point_cloud_utils as pcu
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from n2n.metrics.box_tree import BoxTree
from n2n.metrics.nearest import as_points, spatial_order
from n2n.metrics.triangles import offsets_to, triangles_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_CHUNK = 1 << 16
_CROSSINGS = 8  # of a line, either way
_BEYOND, _PRECISION = 1e-3, 1e-5  # from one crossing to the next, of the reach; of the mesh's size


class PointMesh(NamedTuple):
    """Both directions of P2M, unit^2.

    Attributes:
        forward: Mean squared distance of the points to the mesh.
        backward: Mean squared distance of the faces to their nearest point; above 0 for perfect points too.
    """

    forward: float
    backward: float

    @property
    def total(self) -> float:
        """What tables call P2M."""
        return self.forward + self.backward


def point_to_mesh(points: Array, vertices: Array, faces: Index, min_triangle_area: float = 0.0) -> PointMesh:
    """Measure points against a mesh in both directions.

    Args:
        points: (n, 3).
        vertices, faces: (v, 3) and (f, 3), same coordinates.
        min_triangle_area: Faces of smaller area, unit^2, lose their interior: only their edges count, in both
            directions. pytorch3d: 0 up to 0.4, 1e-5 in 0.5 to 0.6.1, 5e-3 since 0.6.2.

    Returns:
        Raw: no factor of 10^4.

    Raises:
        InputError: Points or mesh are empty, not finite, or of another shape.

    Source: pytorch3d loss/point_mesh_distance.py, `point_mesh_face_distance`.

    >>> corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> point_to_mesh(np.array([[0.1, 0.1, 2.0]]), corner, np.array([[0, 1, 2]])).total
    8.0
    """
    points, triangles, owner = _centred(points, vertices, faces, min_triangle_area)
    points = np.ascontiguousarray(points[:, spatial_order(points.T)])
    forward = _nearest_triangles(points, triangles)[0]
    backward = _nearest_points(points, triangles)
    return PointMesh(float(forward.mean()), float(np.minimum.reduceat(backward, _starts(owner)).mean()))


def distances_to_mesh(points: Array, vertices: Array, faces: Index) -> Array:
    """Return the unsigned distance of every point to the mesh, (n,), unit of the coordinates."""
    points, triangles, _ = _centred(points, vertices, faces)
    return np.sqrt(_nearest_triangles(points, triangles)[0])


def line_distances(points: Array, directions: Array, vertices: Array, faces: Index, reach: float) -> Array:
    """Return how far every point is from the mesh along a line through it.

    Args:
        points: (n, 3).
        directions: (n, 3) unit vectors, of any sign.
        vertices, faces: (v, 3) and (f, 3), same coordinates.
        reach: Crossings farther away are of some other part of the mesh.

    Returns:
        (n,) unit of the coordinates: the mean distance of the crossings within reach, as a surface that crosses the
        line again and again is no better for being close somewhere; `reach` where there is none. Rays are traced in
        single precision.

    >>> corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> up = np.array([[0.0, 0, 1], [1, 0, 0]])
    >>> line_distances(np.array([[0.1, 0.1, 2.0]] * 2), up, corner, np.array([[0, 1, 2]]), reach=3.0).round(5)
    array([2., 3.])
    """
    middle = vertices.mean(axis=0)
    vertices, faces = np.ascontiguousarray(vertices - middle), np.ascontiguousarray(faces)
    start, ray = np.tile(points - middle, (2, 1)), np.concatenate([directions, -directions])
    beyond = max(_BEYOND * reach, _PRECISION * float(np.abs(vertices).max()))
    travelled, total, count = np.zeros(len(ray)), np.zeros(len(ray)), np.zeros(len(ray))
    for _ in range(_CROSSINGS):
        face, _, step = pcu.ray_mesh_intersection(vertices, faces, start + travelled[:, None] * ray, ray)
        crossing = travelled + np.where(face >= 0, step, np.inf)
        is_near = crossing <= reach
        if not is_near.any():
            break
        total[is_near] += crossing[is_near]
        count[is_near] += 1
        # Those that are through start at the reach from now on, where nothing counts any more.
        travelled = np.where(is_near, crossing + beyond, reach)
    total, count = total.reshape(2, -1).sum(axis=0), count.reshape(2, -1).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), reach)


def closest_on_mesh(points: Array, vertices: Array, faces: Index) -> Array:
    """Return the nearest point of the mesh to every point, (n, 3): the projection no denoiser can beat."""
    moved, triangles, _ = _centred(points, vertices, faces)
    nearest = _nearest_triangles(moved, triangles)[1]
    closest = np.empty((len(nearest), 3))
    for start in range(0, len(nearest), _CHUNK):
        part = slice(start, start + _CHUNK)
        closest[part] = points[part] + offsets_to(moved[:, part], triangles[:, :, nearest[part]])[0].T
    return closest


def _centred(points: Array, vertices: Array, faces: Index, guard: float = 0.0) -> tuple[Array, Array, Index]:
    """Return points (3, n), triangles (3, 3, t) and their faces, moved to 0, where products keep digits."""
    triangles, owner = triangles_of(vertices, faces, guard)
    middle = triangles.mean(axis=(0, 2))
    return np.ascontiguousarray((as_points(points, "points") - middle).T), triangles - middle[:, None], owner


def _starts(owner: Index) -> Index:
    return np.flatnonzero(np.diff(owner, prepend=-1))


def _nearest_triangles(points: Array, triangles: Array) -> tuple[Array, Index]:
    """Return squared distances (n,) of points to their nearest triangle, and which that is (n,)."""
    first = cKDTree(triangles.mean(axis=0).T).query(points.T, workers=-1)[1]
    tree = BoxTree(triangles.min(axis=0), triangles.max(axis=0))
    return tree.nearest(
        points, points, first, lambda point, triangle: offsets_to(points[:, point], triangles[:, :, triangle])[1]
    )


def _nearest_points(points: Array, triangles: Array) -> Array:
    """Return squared distances (t,) of triangles to their nearest point."""
    first = cKDTree(points.T).query(triangles.mean(axis=0).T, workers=-1)[1]
    tree = BoxTree(points, points)
    return tree.nearest(
        triangles.min(axis=0),
        triangles.max(axis=0),
        first,
        lambda triangle, point: offsets_to(points[:, point], triangles[:, :, triangle])[1],
    )[0]
