"""A coarse oriented surface from local fits: it tells a field where inside is, before any learning."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from n2n.geometry.local_fit import project_to_quadric
from n2n.geometry.orientation import orient, winding_number
from n2n.geometry.scale import Scales

MAX_POINTS = 3000
_AREA_NEIGHBOURS = 9
_FAR_POSITIONS = 20_000
_OPEN = 0.3  # mean normal of a surface that is clearly not closed
_LOWEST_OPEN, _LOWEST = 0.05, 0.4  # levels; far from everything is outside
_SMALLEST_FIT = 24  # neighbours
_ASKED = 6000  # positions where a scaffold must know inside from outside
_OFF = 2.0  # noise deviations; closer to the data nothing is known, nor closer than samples are to each other
_DECIDED = 0.25  # winding numbers closer than that to 0 or 1 are clear
_CLEAR = 0.01  # share of unclear positions that needs no second scaffold
_NEAR = 1.5  # sample spacings; closer than that a sample's plane says more than its distance


@dataclass(frozen=True)
class Scaffold:
    """Oriented samples of the surface.

    Attributes:
        points: (n, 3) positions on local fits, unit coordinates.
        normals: (n, 3) unit normals, outwards.
        areas: (n,) surface area of each sample.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    areas: NDArray[np.float64]

    @classmethod
    def build(cls, cloud: NDArray[np.float64], scales: Scales, seed: int = 0) -> "Scaffold":
        """Thin the cloud evenly, project it onto local quadrics and orient the normals globally.

        A local fit should be wider than the noise, but where walls or bars are thinner than it is wide, it mixes their
        sides, and no orientation is right any more. That shows in the winding numbers, which then are neither 0 nor 1
        in large parts of space; so narrower fits, whose normals are worse but whose sides are apart, are tried then.

        Args:
            cloud: (n, 3) noisy points, unit coordinates.
            scales: Their noise and spacing.
            seed: Chooses the samples and seeds the orientation search.
        """
        generator = np.random.default_rng(seed)
        tree = cKDTree(cloud)
        samples = cloud[_thin(cloud, MAX_POINTS, generator)]
        asked = generator.uniform(cloud.min(axis=0), cloud.max(axis=0), (_ASKED, 3))
        off = max(_OFF * scales.noise, np.sqrt(scales.area / len(samples)))
        asked = asked[tree.query(asked)[0] > off]
        neighbours = max(2 * scales.patch if scales.patch < 48 else scales.patch, 32)
        best = cls._fit(tree, samples, neighbours, scales.noise, seed)
        unclear = best.unclear(asked)
        while unclear > _CLEAR and neighbours > _SMALLEST_FIT:
            neighbours = max(neighbours // 2, _SMALLEST_FIT)
            narrower = cls._fit(tree, samples, neighbours, scales.noise, seed)
            share = narrower.unclear(asked)
            if share < unclear / 2:
                best, unclear = narrower, share
        return best

    @classmethod
    def _fit(cls, tree: cKDTree, samples: NDArray[np.float64], neighbours: int, noise: float, seed: int) -> "Scaffold":
        points, normals = project_to_quadric(tree, samples, neighbours)
        k = min(_AREA_NEIGHBOURS, len(points))
        reach = cKDTree(points).query(points, k)[0][:, -1]
        areas = np.pi * reach**2 / k
        return cls(points, orient(points, normals, areas, noise, seed), areas)

    def unclear(self, positions: NDArray[np.float64]) -> float:
        """Return the share of positions whose winding number is neither about 0 nor about 1."""
        winding = self.winding(positions)
        off = np.minimum(np.abs(winding), np.abs(winding - 1))
        return float((off > _DECIDED).mean()) if len(off) else 0.0

    def sign(self, queries: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return -1 where the winding number says inside and +1 elsewhere, (q,)."""
        return np.where(self.winding(queries) > self.level, -1.0, 1.0)

    def winding(self, queries: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the winding number at the queries, (q,)."""
        return winding_number(queries, self.points, self.normals, self.areas)

    @cached_property
    def level(self) -> float:
        """The winding number that separates inside from outside: the usual one on the surface itself.

        Half for a closed surface, whose mean normal vanishes. For an open one it is less, and 0.5 lies on no surface: a
        flat sheet would be outside on both sides.
        """
        flux = np.linalg.norm(self.areas @ self.normals) / self.areas.sum()
        lowest = _LOWEST_OPEN if flux > _OPEN else _LOWEST
        return float(np.clip(np.median(self.winding(self.points)), lowest, 0.5))

    def distance(self, queries: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return approximate signed distances (q,): to the plane of the nearest sample, or far off to the sample."""
        reach, nearest = cKDTree(self.points).query(queries)
        far = reach > _NEAR * np.sqrt(self.areas[nearest])
        result = np.einsum("qi,qi->q", queries - self.points[nearest], self.normals[nearest])
        result[far] = reach[far] * self.sign(queries[far])
        return result

    def far_field(
        self, cloud: NDArray[np.float64], lower: Sequence[float], upper: Sequence[float], margin: float, seed: int = 0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return random positions of the box far from the cloud, their signs, and how far off the lids are.

        Where two positions of opposite sign are closer to each other than to the cloud, no data lie between them: the
        surface is open there, and the winding number closes it with a lid. Without its distance, f would be told to
        jump.

        Returns:
            Positions farther than `margin` from the cloud, (m, 3); -1 inside, +1 outside, (m,); distance to the
            nearest point of a lid, (m,), infinite where there is none.
        """
        positions = np.random.default_rng(seed).uniform(lower, upper, (_FAR_POSITIONS, 3))
        off = cKDTree(cloud).query(positions)[0]
        positions, off = positions[off > margin], off[off > margin]
        above = self.winding(positions) - self.level
        signs = np.where(above > 0, -1.0, 1.0)
        lids = _lids(positions, above, off)
        return positions, signs, cKDTree(lids).query(positions)[0] if len(lids) else np.full(len(positions), np.inf)


def _lids(positions: NDArray[np.float64], above: NDArray[np.float64], off: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points where `above` changes sign away from the data, (l, 3); none for a closed surface.

    Args:
        positions: (m, 3).
        above: Winding numbers over their level, (m,).
        off: Distances from the data, (m,).
    """
    inside, outside = np.flatnonzero(above > 0), np.flatnonzero(above <= 0)
    if not len(inside) or not len(outside):
        return positions[:0]
    reach, other = cKDTree(positions[outside]).query(positions[inside])
    a, b = inside[reach < off[inside]], outside[other[reach < off[inside]]]
    share = above[a] / (above[a] - above[b])
    return positions[a] + share[:, None] * (positions[b] - positions[a])


def _thin(cloud: NDArray[np.float64], count: int, generator: np.random.Generator) -> NDArray[np.int64]:
    """Return about `count` row indices, at most one per voxel of the size that leaves that many."""
    order = generator.permutation(len(cloud))
    if len(cloud) <= count:
        return order
    low, high = 0.0, float(np.ptp(cloud, axis=0).max())
    chosen = order[:count]
    for _ in range(20):
        voxel = (low + high) / 2
        _, first = np.unique(np.floor(cloud[order] / voxel).astype(np.int64), axis=0, return_index=True)
        if len(first) > count:
            low = voxel
        else:
            chosen, high = order[first], voxel
            if len(first) > 0.95 * count:
                break
    return chosen
