"""Poisson-disk sampling with exact counts: even clouds from meshes and from denser clouds."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from n2n.errors import InputError

_RADIUS = 0.8  # of the root of area per point: where the sampler reaches about the count
_ATTEMPTS = 4
_SPARE = 1.01
_ENOUGH = 1.02
_BISECTIONS = 12
_FEWEST = 100
_DENSE = 20  # times the count; more points to choose from change nothing but the time


def poisson_disk(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], count: int, seed: int = 0
) -> NDArray[np.float64]:
    """Return exactly `count` points of a mesh that keep their distance from each other, (count, 3).

    The sampler is given a radius and returns as many points as it likes; the radius is reduced until they are enough,
    then some are left out at random. If they never are enough, evenly random points of the surface fill up.

    Args:
        vertices: (v, 3).
        faces: (f, 3) vertex indices.
        count: At least 1.
        seed: Of everything random, 0 to 2^31 - 1.

    Source: score-denoise (keeps the first `count`, fills up at random).
    Differs: the radius is chosen so that at most a few per cent are left out; keeping 10 000 of 14 000 would tear
        holes.
    """
    import point_cloud_utils as pcu

    vertices, faces = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)
    area = triangle_areas(vertices, faces).sum()
    if not area > 0:
        raise InputError("the mesh has no area; a surface is needed to sample points from")
    random = np.random.default_rng([seed, count])
    own = seed + 1  # the sampler takes 0 for the time of day
    radius, found = _RADIUS * np.sqrt(area / count), np.empty((0, 3))
    for _ in range(_ATTEMPTS):
        face, weight = pcu.sample_mesh_poisson_disk(vertices, faces, -1, radius=float(radius), random_seed=own)
        # One point alone comes back without its dimension.
        found = np.einsum("nk,nki->ni", np.reshape(weight, (-1, 3)), vertices[faces[np.atleast_1d(face)]])
        if len(found) >= count:
            break
        radius *= np.sqrt(max(len(found), 1) / (_SPARE * count))
    if len(found) < count:
        found = np.concatenate([found, uniform(vertices, faces, count - len(found), random)[0]])
    return found[np.sort(random.permutation(len(found))[:count])]


def uniform(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], count: int, random: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return points evenly random by area, (count, 3), and the face of each, (count,)."""
    areas = triangle_areas(vertices, faces)
    face = random.choice(len(faces), count, p=areas / areas.sum())
    u, v = random.random((2, count, 1))
    flip = u + v > 1
    u, v = np.where(flip, 1 - u, u), np.where(flip, 1 - v, v)
    a, b, c = (vertices[faces[face, k]] for k in range(3))
    return a + u * (b - a) + v * (c - a), face


def triangle_areas(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the area of each triangle, (f,)."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def thin(points: NDArray[np.float64], count: int, seed: int = 0) -> NDArray[np.int64]:
    """Return the rows of exactly `count` points that keep their distance from each other, (count,) ascending.

    The radius is bisected until it leaves just enough points; the last of them are left out.

    Args:
        points: (n, 3), n >= count.
        count: At least 1.
        seed: Of the order in which points are looked at.

    Raises:
        InputError: There are fewer points than that.
    """
    if count > len(points):
        raise InputError(f"{count} points were asked for, but there are only {len(points)}")
    order = np.random.default_rng([seed, count]).permutation(len(points))[: max(_DENSE * count, _FEWEST)]
    points = points[order]
    tree, chosen = cKDTree(points), np.arange(len(points))
    # Above what any surface has: independent points are half a root of area per point away from the nearest one.
    low, high = 0.0, 4 * float(np.median(tree.query(points, 2)[0][:, 1])) * np.sqrt(len(points) / count)
    for _ in range(_BISECTIONS):
        if len(chosen) <= _ENOUGH * count:
            break
        radius = (low + high) / 2
        kept = _disks(tree.query_pairs(radius, output_type="ndarray"), len(points))
        if len(kept) < count:
            high = radius
        else:
            low, chosen = radius, kept
    return np.sort(order[chosen[:count]])


def _disks(pairs: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Return the rows that stay if each that stays removes its later partners, in order.

    In rounds, which comes to the same: whoever comes before all open partners stays, its partners go.

    Args:
        pairs: (p, 2) rows that are too close to each other, the earlier one first.
        count: How many rows there are.
    """
    waits, stays = np.ones(count, bool), np.zeros(count, bool)
    while len(pairs):
        first, later = pairs.T
        leads = waits.copy()
        leads[later] = False
        stays |= leads
        waits &= ~leads
        waits[later[leads[first]]] = False
        pairs = pairs[waits[pairs].all(axis=1)]
    return np.flatnonzero(stays | waits)
