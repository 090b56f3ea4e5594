"""Even spreading: points moved along a surface until they are about as far apart as the surface allows."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import cg
from scipy.spatial import cKDTree

_Array = NDArray[np.float64]
Project = Callable[[_Array], tuple[_Array, _Array]]

_SAME_SHEET = -0.3  # cosine between normals: 90-degree edges are one sheet, the two sides of a wall are not
_PATCH = 24  # neighbours that measure area and border
_NEAR = 10  # neighbours that repel and carry the flow
_ROUNDS = 24
_SETTLED = 1.0  # spacings: a flow that moves less at the median is left to the repulsion
_REACH = 2.0  # spacings a flow may move at once: areas and directions are those of the start
_POLISH = 20
_RATE = 0.35  # of the overlap; six neighbours make it stable up to 0.5
_LONELY = 30.0  # times the median area
_STRIDE = 0.25  # of the distance kept: a step never passes a neighbour
_REFRESH = 3  # steps that share their neighbours
_HALF_DISC = 4 / (3 * np.pi)  # distance of the centroid of a half disc from its centre
_ROWS = 50_000


def spread(points: _Array, project: Project) -> _Array:
    """Spread points evenly over the part of a surface they cover; number and order are kept.

    Two motions alternate, each followed by the projection. *Flow* carries crowds far: the gradient field whose
    divergence is what every point's area lacks, from one sparse linear solve on the graph of neighbours.
    *Repulsion* settles neighbours: each pair closer than the distance of a hexagonal packing moves apart, by gradient
    steps on the sum of squared overlaps. The two sides of a wall do not act on each other, and no point passes the
    border of the cloud: where all its former neighbours lie to one side.

    From an evenly sampled cloud a point moves half a spacing or so; where the density changes by a multiple over the
    whole cloud, as far as the crowd has to go.

    Args:
        points: (n, 3), on or near the surface, any length unit, finite.
        project: Maps (m, 3) points near the surface to the closest points of it, (m, 3), and unit normals there,
            (m, 3), consistently oriented.

    Returns:
        (n, 3) points as `project` left them. Fewer than four points, and points all in one place, are
            projected and not spread.

    Source: repulsion within a compact kernel as in Turk 1991 (retiling) and Witkin & Heckbert 1994; the flow is
    Moser's (Dacorogna & Moser 1990), linearised and repeated.
    """
    points, normals = project(np.asarray(points, np.float64))
    if len(points) < 4:
        return points
    patch = _Patches(points, normals)
    if not patch.area.mean() > 0:
        return points
    border = _Border(patch)
    # Equal points have no direction to part in.
    jitter = np.random.default_rng(0).standard_normal(points.shape)
    points, normals = project(points + 1e-3 * np.sqrt(patch.area.mean()) * jitter)
    local = patch.smooth_area()
    for _ in range(_ROUNDS):
        points, normals = _repel(points, normals, project, border, _hexagonal(local), _REFRESH)
        patch = _Patches(points, normals)
        motion = _flow(patch)
        spacing = np.sqrt(patch.area.mean())
        length = np.linalg.norm(motion, axis=1)
        if np.median(length) < _SETTLED * spacing:
            break
        part = min(1.0, _REACH * spacing / np.quantile(length, 0.99))
        points, normals = _carry(points, normals, part * motion, project, spacing)
        points, normals = project(border.hold(points, normals))
        local = patch.smooth_area() ** (1 - part) * patch.area.mean() ** part
    distance = np.full(len(points), _hexagonal(patch.area.mean()))
    return _repel(points, normals, project, border, distance, _POLISH)[0]


def _hexagonal(area: _Array | float) -> _Array | float:
    """Return the distance of neighbours in a hexagonal packing with this area per point."""
    return np.sqrt(2 / np.sqrt(3) * area)


def _tangential(vectors: _Array, normals: _Array) -> _Array:
    return vectors - np.einsum("...i,...i->...", vectors, normals)[..., None] * normals


class _Patches:
    """Every point's nearest neighbours on its own sheet, and the area it stands for.

    Attributes:
        points, normals: (n, 3).
        index: (n, k) neighbours, nearest first.
        same: (n, k) which of them are on the point's sheet.
        area: (n,) area per point there.
    """

    def __init__(self, points: _Array, normals: _Array) -> None:
        self.points, self.normals = points, normals
        self.index = cKDTree(points).query(points, min(_PATCH, len(points) - 1) + 1)[1][:, 1:]
        self.same = np.empty(self.index.shape, bool)
        self.area = np.empty(len(points))
        for rows in _slices(len(points)):
            offset = points[self.index[rows]] - points[rows, None]
            self.same[rows] = same = _same_sheet(normals[rows], normals[self.index[rows]])
            mean, radius = _centroid(offset, same.astype(float))
            mean = _tangential(mean, normals[rows])
            lean = np.linalg.norm(mean, axis=1) / np.maximum(radius, 1e-300)
            # Next to a border part of the disc is empty; a lean of 0.25 is within the chance of a full one.
            covered = 1 - 0.5 * np.clip((lean - 0.25) / (_HALF_DISC - 0.25), 0, 1)
            self.area[rows] = np.pi * radius**2 / (same.sum(1) + 0.5) * covered
        # A stray point is far from all others, and must not count as a large surface.
        self.area = np.clip(self.area, 1e-4 * self.area.mean(), _LONELY * np.median(self.area))

    def smooth_area(self) -> _Array:
        """Return the area per point, averaged over each patch."""
        return (self.area + (self.area[self.index] * self.same).sum(1)) / (1 + self.same.sum(1))


class _Border:
    """The part of the surface that was covered at the start, known by its points.

    Where the surface ends, the cloud around a point leans to one side: by 0.42 of the radius of the patch, the points
    counted by their areas. A point that leans more than that, and more than the cloud's own point next to it, has left.
    """

    def __init__(self, patch: _Patches) -> None:
        self._points, self._normals, self._area = patch.points, patch.normals, patch.smooth_area()
        self._tree = cKDTree(patch.points)
        self._lean, self._radius = np.empty(len(patch.points)), np.empty(len(patch.points))
        for rows in _slices(len(patch.points)):
            mean, radius = self._around(patch.points[rows], patch.normals[rows])
            self._lean[rows] = np.linalg.norm(mean, axis=1) / np.maximum(radius, 1e-300)
            self._radius[rows] = radius

    def hold(self, points: _Array, normals: _Array) -> _Array:
        """Move points that left back to the border."""
        away, nearest = self._tree.query(points)
        # Moving by d changes the lean by about d: most points are too far inside to ask their neighbours.
        doubtful = np.flatnonzero(away > (0.9 * _HALF_DISC - self._lean[nearest]) * self._radius[nearest])
        held = points.copy()
        for rows in _slices(len(doubtful)):
            chosen = doubtful[rows]
            mean, radius = self._around(points[chosen], normals[chosen])
            length = np.linalg.norm(mean, axis=1)
            limit = np.maximum(_HALF_DISC, self._lean[nearest[chosen]]) * radius
            held[chosen] += mean * (np.maximum(length - limit, 0) / np.maximum(length, 1e-300))[:, None]
        return held

    def _around(self, points: _Array, normals: _Array) -> tuple[_Array, _Array]:
        """Return where the cloud around each point leans, (m, 3), and the radius of the patch, (m,)."""
        index = self._tree.query(points, min(_PATCH, len(self._points)))[1]
        weight = self._area[index] * _same_sheet(normals, self._normals[index])
        return _centroid(self._points[index] - points[:, None], weight)


def _same_sheet(normals: _Array, others: _Array) -> NDArray[np.bool_]:
    """Tell which of (m, k) neighbours are on the sheet of their point."""
    return np.einsum("mi,mki->mk", normals, others) > _SAME_SHEET


def _centroid(offset: _Array, weight: _Array) -> tuple[_Array, _Array]:
    """Return the centroid (m, 3) of the (m, k) neighbours of positive weight, and their largest distance (m,)."""
    radius = np.sqrt((np.einsum("mki,mki->mk", offset, offset) * (weight > 0)).max(1))
    return np.einsum("mki,mk->mi", offset, weight) / np.maximum(weight.sum(1), 1e-300)[:, None], radius


def _flow(patch: _Patches) -> _Array:
    """Return the tangential motion (n, 3) under which every point's area grows to the mean, to first order.

    The motion is -grad phi with -laplace(phi) = log(mean area / area): continuous where the density jumps, and without
    a component across borders. Growth is limited to a factor e either way.
    """
    points, normals, area = patch.points, patch.normals, patch.area
    count, near = len(points), min(_NEAR, patch.index.shape[1])
    index, same = patch.index[:, :near], patch.same[:, :near]
    growth = np.clip(_balanced(-np.log(area / area.mean()), area), -1, 1)
    offset = np.empty((count, near, 3))
    for rows in _slices(count):
        offset[rows] = _tangential(points[index[rows]] - points[rows, None], normals[rows, None])
    squared = np.maximum(np.einsum("nki,nki->nk", offset, offset), 1e-300)
    # For a full disc, sum_j w (phi_i - phi_j) is -area * laplace(phi).
    weight = same * (4 * area / np.maximum((squared * same).sum(1), 1e-300))[:, None]
    graph = csr_matrix((weight.ravel(), index.ravel(), np.arange(0, count * near + 1, near)), shape=(count, count))
    graph = (graph + graph.T) / 2
    degree = np.maximum(np.asarray(graph.sum(1)).ravel(), 1e-300)
    # No flow crosses from one piece of the surface to another: each keeps its points and its own mean.
    _, piece = connected_components(graph, directed=False)
    growth -= (np.bincount(piece, area * growth) / np.bincount(piece, area))[piece]
    supply = area * growth
    potential = cg(diags(degree) - graph, supply, rtol=1e-3, maxiter=100, M=diags(1 / degree))[0]
    # The gradient by least squares over the neighbours; the normal fills the missing rank.
    weight = same / squared
    moment = np.einsum("nk,nki,nkj->nij", weight, offset, offset) + normals[:, :, None] * normals[:, None]
    moment += 1e-6 * np.eye(3)
    slope = np.einsum("nk,nki->ni", weight * (potential[index] - potential[:, None]), offset)
    return -_tangential(np.linalg.solve(moment, slope[..., None])[..., 0], normals)


def _balanced(values: _Array, area: _Array) -> _Array:
    """Return the values with a mean of zero over the surface."""
    return values - (area * values).sum() / area.sum()


def _carry(points: _Array, normals: _Array, motion: _Array, project: Project, spacing: float) -> tuple[_Array, _Array]:
    """Move points along the surface, in steps of a spacing, so that they follow its curvature."""
    length = np.linalg.norm(motion, axis=1, keepdims=True)
    steps = max(1, int(np.ceil(np.quantile(length, 0.99) / spacing)))
    step = np.minimum(length / steps, spacing)
    direction = motion
    for _ in range(steps):
        direction = _tangential(direction, normals)
        direction = direction / np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-300)
        points, normals = project(points + step * direction)
    return points, normals


def _repel(
    points: _Array, normals: _Array, project: Project, border: _Border, distance: _Array, steps: int
) -> tuple[_Array, _Array]:
    """Move neighbours apart that are closer than `distance`, (n,): the mean of both counts."""
    near = min(_NEAR, len(points) - 1)
    for step in range(steps):
        if step % _REFRESH == 0:
            index = cKDTree(points).query(points, near + 1)[1][:, 1:]
        moved = np.empty_like(points)
        for rows in _slices(len(points)):
            others = index[rows]
            away = points[rows, None] - points[others]
            length = np.sqrt(np.einsum("mki,mki->mk", away, away))
            overlap = np.maximum((distance[rows, None] + distance[others]) / 2 - length, 0)
            overlap *= _same_sheet(normals[rows], normals[others])
            push = np.einsum("mk,mki->mi", overlap / np.maximum(length, 1e-300), away)
            push = _RATE * _tangential(push, normals[rows])
            limit = _STRIDE * distance[rows] / np.maximum(np.linalg.norm(push, axis=1), 1e-300)
            moved[rows] = points[rows] + push * np.minimum(1, limit)[:, None]
        if step % _REFRESH == _REFRESH - 1 or step == steps - 1:
            moved = border.hold(moved, normals)
        points, normals = project(moved)
    return points, normals


def _slices(count: int) -> list[slice]:
    """Return slices of bounded length, so that the arrays over all neighbours of a slice stay small."""
    return [slice(start, start + _ROWS) for start in range(0, count, _ROWS)]
