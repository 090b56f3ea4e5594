"""Are a scan and its truth in one frame? Sensor noise cannot be undone by moving and scaling, a wrong frame can."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from n2n.geometry.poisson import uniform
from n2n.geometry.reference import Reference

_SCAN, _TRUTH = 2000, 30_000  # points looked at
_ROUNDS = 30
_KEPT = 0.95  # the farthest pairs may be outliers
_SCALES = (0.5, 2.0)  # a scan that shrinks to a point fits everything
# How much of the distance a change of frame may explain: 1.2 with noise of 5 % of the longest edge, 12 seen where the
# scales were mixed.
_UNDONE = 2.5
# Below this share of the longest edge nothing is told from rounding.
_MISFIT = 0.005
_ON_SURFACE = 0.01  # of the longest edge: how far apart the samples of a surface lie
_RATIO = 2.0  # of the extents of scan and truth; sensor noise and what a scan does not reach stay far below


class Fit(NamedTuple):
    """How much closer to its truth a scan comes by a similarity.

    Attributes:
        before, after: Median distance to the truth, as it is and after the best similarity nearby.
        scale: Of that similarity.
        shift: How far it moves the middle of the scan.
    """

    before: float
    after: float
    scale: float
    shift: float


def similarity(points: NDArray[np.float64], reference: Reference) -> Fit:
    """Move, turn and scale a scan onto its truth, from where it is (iterative closest points).

    Args:
        points: The scan, (n, 3).
        reference: Mesh or cloud.
    """
    random = np.random.default_rng(0)
    truth = _surface(reference, random)
    tree = cKDTree(truth)
    scan = points[random.permutation(len(points))[:_SCAN]]
    moved, scale = scan, 1.0
    before = after = float(np.median(tree.query(scan)[0]))
    for _ in range(_ROUNDS):
        distance, nearest = tree.query(moved)
        near = distance <= np.quantile(distance, _KEPT)
        factor, turn, shift = _best(scan[near], truth[nearest[near]])
        if not _SCALES[0] < factor < _SCALES[1]:
            break
        moved, scale = factor * scan @ turn.T + shift, factor
        after = float(np.median(tree.query(moved)[0]))
    return Fit(before, after, scale, float(np.linalg.norm(moved.mean(axis=0) - scan.mean(axis=0))))


def is_moved(fit: Fit, reference: Reference) -> bool:
    """Tell whether another frame explains most of the distance between points and their truth."""
    return fit.before > max(_UNDONE * fit.after, _MISFIT * extent(positions(reference)))


def on_surface(points: NDArray[np.float64], reference: Reference) -> bool:
    """Tell whether a clean cloud lies on a surface, as far as samples of it can tell."""
    near = _ON_SURFACE * extent(positions(reference))
    return same_frame(points, reference) and similarity(points, reference).before < near


def same_frame(points: NDArray[np.float64], reference: Reference) -> bool:
    """Tell whether points and truth lie at the same place in about the same size."""
    truth = positions(reference)
    if not len(truth):
        return True
    ratio = extent(points) / max(extent(truth), np.finfo(float).tiny)
    apart = float(np.abs(middle(points) - middle(truth)).max())
    return bool(1 / _RATIO < ratio < _RATIO and apart < extent(truth) / 2)


def positions(reference: Reference) -> NDArray[np.float64]:
    """Return the mesh's vertices, else the cloud, (n, 3); none where nothing is known."""
    known = reference.points if reference.vertices is None else reference.vertices
    return np.empty((0, 3)) if known is None else known


def extent(points: NDArray[np.float64]) -> float:
    """Return the longest edge of the box of points."""
    return float(np.ptp(points, axis=0).max())


def middle(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the middle of the box of points, (3,)."""
    return (points.min(axis=0) + points.max(axis=0)) / 2


def _surface(reference: Reference, random: np.random.Generator) -> NDArray[np.float64]:
    if reference.vertices is not None and reference.faces is not None:
        return uniform(reference.vertices, reference.faces, _TRUTH, random)[0]
    known = reference.points
    return known[random.permutation(len(known))[:_TRUTH]]


def _best(source: NDArray[np.float64], target: NDArray[np.float64]) -> tuple[float, NDArray, NDArray]:
    """Return scale, rotation and shift that bring paired points together in least squares.

    Source: Umeyama 1991.
    """
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    left, values, right = np.linalg.svd(b.T @ a)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    turn = left * signs @ right
    scale = float((values * signs).sum() / (a**2).sum())
    return scale, turn, target.mean(axis=0) - scale * turn @ source.mean(axis=0)
