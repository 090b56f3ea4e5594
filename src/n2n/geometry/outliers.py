"""Points that belong to no surface: repeated ones, ones far from all others, and outliers around the surface."""

import functools
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

_NEIGHBOUR = 4
_LONELY = 30.0  # times the median: the sparse ends of a lidar frame stay, a stray point ten scans away does not
_REACHES = (6, 24)  # few, to see outliers close to the surface; more than a small cluster of them holds
_AROUND, _THINNING = 16, 16  # the usual reach is the median of 16 in every 16th point: of some 256 neighbours
_SUSPECT = 1.8
_AWAY = 2.0
_PATCH = 32
_FLAT = 0.4  # a ball of points has about 0.65
_EVEN = 5.0  # a sheet has 2, a line 4; more, and the patch is a cluster and something far behind it
_ON, _OFF = 3.0, 5.0
_ROUNDS = 5
_FEWEST = 100
_CHUNK = 8192


def first_of_equal(points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which of (n, 3) points have no equal before them, (n,)."""
    order = np.lexsort(points.T)  # stable: equal points keep their order
    first = np.ones(len(points), bool)
    first[order[1:]] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    return first


def outliers_of_each(clouds: Sequence[NDArray[np.float64]]) -> list[NDArray[np.bool_]]:
    """Tell which points of every cloud look like outliers; several clouds at once, where there are several."""
    if len(clouds) == 1:
        return [outliers(clouds[0])]
    # Of many clouds each is small: threads for each of its searches would take longer to start than to work.
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(functools.partial(outliers, workers=1), clouds))


def outliers(points: NDArray[np.float64], workers: int = -1) -> NDArray[np.bool_]:
    """Tell which points look like outliers, (n,); equal points share one verdict.

    A point is one if its fourth neighbour is 30 times as far away as is usual in the cloud: a single far point would
    set the scale of the whole frame. Of the rest, a point is a suspect if its reach, the distance to its 6th or 24th
    neighbour, is 1.8 times the usual one of its surroundings. A suspect on a flat patch of its neighbours is a sparse
    part of the surface. Of the others, those are outliers that are two usual reaches away from all points beyond
    suspicion, or five deviations off the plane through the nearest of them. Outliers hide others behind them, so this
    is repeated without them. Fewer than 100 points are too few to judge by their surroundings.

    An outlier within about four deviations of the noise cannot be told from a point of the surface, and is not.

    Args:
        points: (n, 3), finite.
        workers: Threads; -1: all cores.
    """
    order = np.lexsort(points.T)
    new = np.ones(len(points), bool)
    new[1:] = (points[order[1:]] != points[order[:-1]]).any(axis=1)
    distinct = points[order[new]]
    kept, before = np.arange(len(distinct)), None
    for _ in range(_ROUNDS):
        found, before = _most_evident(distinct[kept], before, workers)
        if not found.any():
            break
        before = _Before(before.reach[~found], before.ranks, distinct[kept[found]])
        kept = kept[~found]
    verdict = np.ones(len(distinct), bool)
    verdict[kept] = False
    result = np.empty(len(points), bool)
    result[order] = verdict[np.cumsum(new) - 1]
    return result


@dataclass
class _Before:
    """What the last round knows: distances (n, r) of points to neighbours of these ranks, and who left since."""

    reach: NDArray[np.float64]
    ranks: list[int]
    gone: NDArray[np.float64]


def _most_evident(
    points: NDArray[np.float64], before: _Before | None, workers: int
) -> tuple[NDArray[np.bool_], _Before]:
    """Tell which points are alone in the cloud, (n,); where none is, which are outliers among their neighbours."""
    found = np.zeros(len(points), bool)
    tree = cKDTree(points)
    ranks = [min(k, len(points) - 1, max(len(points) // 4, _NEIGHBOUR)) for k in (_NEIGHBOUR, *_REACHES)]
    now = _Before(_reach(tree, ranks, before, workers), ranks, points[:0])
    if len(points) <= _NEIGHBOUR:
        return found, now
    found = now.reach[:, 0] > _LONELY * np.median(now.reach[:, 0])
    if found.any() or len(points) < _FEWEST:
        return found, now
    reach = now.reach[:, 1:]
    usual = _usual(points, reach, workers)
    suspected = (reach > _SUSPECT * usual).any(axis=1)
    suspects = np.flatnonzero(suspected)
    if not len(suspects) or len(points) - len(suspects) < 2 * _PATCH:
        return found, now
    height, flatness, distance = _against_patch(tree, points[suspects], workers, skip=1)
    even = distance[:, -1] < _EVEN * distance[:, _PATCH // 4 - 1]
    suspects = suspects[~((height < _ON) & (flatness < _FLAT) & even)]
    height, _, distance = _against_patch(cKDTree(points[~suspected]), points[suspects], workers)
    found[suspects[(distance[:, 0] > _AWAY * usual[suspects, -1]) | (height > _OFF)]] = True
    return found, now


def _reach(tree: cKDTree, ranks: list[int], before: _Before | None, workers: int) -> NDArray[np.float64]:
    """Return the distances (n, r) of all points to their neighbours of these ranks.

    They are searched for anew only where somebody nearer than the farthest of them is gone.
    """
    if before is None or before.ranks != ranks:
        return tree.query(tree.data, [k + 1 for k in ranks], workers=workers)[0]
    reach = before.reach
    lost = cKDTree(before.gone).query(tree.data, workers=workers)[0] <= reach[:, -1]
    reach[lost] = tree.query(tree.data[lost], [k + 1 for k in ranks], workers=workers)[0]
    return reach


def _usual(points: NDArray[np.float64], reach: NDArray[np.float64], workers: int) -> NDArray[np.float64]:
    """Return the median reaches around each point, like `reach` (n, r), from some of all points.

    The surroundings are wide, so that where outliers are alone with each other the surface nearby still decides. They
    change slowly: every point takes those of the nearest of the some.
    """
    count = min(len(points), max(len(points) // _THINNING, 25 * _AROUND))
    some = np.random.default_rng(0).permutation(len(points))[:count]
    tree = cKDTree(points[some])
    around = tree.query(points[some], min(_AROUND, count), workers=workers)[1]
    usual = np.median(reach[some[around]], axis=1)
    return usual[tree.query(points, workers=workers)[1]]


def _against_patch(
    tree: cKDTree, queries: NDArray[np.float64], workers: int, skip: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Fit a plane to the nearest points of the tree, without the first `skip`, for each query.

    Returns:
        Distance of the query from the plane in deviations of the patch, (q,); deviation over length of the patch,
        (q,); distances to the points of the patch, (q, k).
    """
    height, flatness = np.empty(len(queries)), np.empty(len(queries))
    distance = np.empty((len(queries), _PATCH))
    for start in range(0, len(queries), _CHUNK):
        chunk = slice(start, start + _CHUNK)
        far, index = tree.query(queries[chunk], _PATCH + skip, workers=workers)
        patch = tree.data[index[:, skip:]]
        mean = patch.mean(axis=1)
        centred = patch - mean[:, None]
        variance, axes = np.linalg.eigh(np.einsum("qki,qkj->qij", centred, centred) / _PATCH)
        # An exact plane has no deviation but that of rounding, which must not judge.
        least = np.maximum(1e-8 * variance[:, [2]], 1e-300)
        deviation, length = np.sqrt(np.maximum(variance[:, [0, 2]], least)).T
        height[chunk] = np.abs(np.einsum("qi,qi->q", queries[chunk] - mean, axes[:, :, 0])) / deviation
        flatness[chunk] = deviation / length
        distance[chunk] = far[:, skip:]
    return height, flatness, distance
