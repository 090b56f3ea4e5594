"""Jet and bilateral smoothing by CGAL, the classical denoisers of the published tables."""

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from n2n.baselines.optional import optional
from n2n.errors import ConfigError, InputError


class Jet:
    """Jet smoothing: each point moves onto a polynomial fitted to its neighbours.

    Args:
        neighbours: Points of a fit; 24 is CGAL's advice for real scans.
        degree: Of the polynomial, 1 to 4.
        iterations: Times the cloud is smoothed.

    Raises:
        ConfigError: CGAL is not installed, or an argument is out of range.

    Source: Cazals and Pouget 2005; CGAL::jet_smooth_point_set.
    """

    def __init__(self, neighbours: int = 24, degree: int = 2, iterations: int = 1) -> None:
        _check("neighbours", neighbours, 3)
        _check("degree", degree, 1, 4)
        _check("iterations", iterations, 1)
        coefficients = (degree + 1) * (degree + 2) // 2
        if neighbours + 1 < coefficients:
            raise ConfigError(f"a jet of degree={degree} has {coefficients} coefficients; give as many neighbours")
        self.neighbours, self.degree, self.iterations = neighbours, degree, iterations
        self._cgal = _Cgal("jet smoothing")

    def denoise(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the smoothed points (n, 3); number and order are kept.

        Raises:
            InputError: The cloud has no more points than a neighbourhood.
        """
        _check_count(points, self.neighbours)
        cloud = self._cgal.cloud(points)
        for _ in range(self.iterations):
            self._cgal.processing.jet_smooth_point_set(cloud, self.neighbours, 0.0, self.degree)
        return _finite(self._cgal.positions(cloud), points)


class Bilateral:
    """Bilateral smoothing: neighbours whose normals differ count less, so that edges stay.

    Normals are estimated by jets and oriented along a spanning tree, both by CGAL.

    Args:
        neighbours: Points that are averaged.
        sharpness: Angle in degrees, 0 to 90; smaller keeps sharper edges. 30 is CGAL's default.
        normal_neighbours: Points a normal is fitted to.
        iterations: Times the cloud is smoothed, normals with it.

    Raises:
        ConfigError: CGAL is not installed, or an argument is out of range.

    Source: Huang et al. 2013 (edge-aware resampling); CGAL::bilateral_smooth_point_set.
    """

    def __init__(
        self, neighbours: int = 24, sharpness: int | float = 30, normal_neighbours: int = 24, iterations: int = 3
    ) -> None:
        _check("neighbours", neighbours, 2)
        _check("sharpness", sharpness, 0, 90)
        _check("normal_neighbours", normal_neighbours, 6)
        _check("iterations", iterations, 1)
        self.neighbours, self.sharpness = neighbours, float(sharpness)
        self.normal_neighbours, self.iterations = normal_neighbours, iterations
        self._cgal = _Cgal("bilateral smoothing")

    def denoise(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the smoothed points (n, 3); number and order are kept.

        Raises:
            InputError: The cloud has no more points than a neighbourhood.
        """
        _check_count(points, max(self.neighbours, self.normal_neighbours))
        cgal = self._cgal
        cloud = cgal.cloud(points)
        cgal.processing.jet_estimate_normals(cloud, self.normal_neighbours)
        cgal.processing.mst_orient_normals(cloud, self.normal_neighbours)
        # Points of further components, which the spanning tree does not reach, are set aside; they are points too.
        cloud.cancel_removals()
        for _ in range(self.iterations):
            cgal.processing.bilateral_smooth_point_set(cloud, self.neighbours, 0.0, self.sharpness)
        return _finite(cgal.positions(cloud), points)


class _Cgal:
    """CGAL's point sets, filled from arrays and read back into arrays."""

    def __init__(self, who: str) -> None:
        self._kernel = optional("CGAL.CGAL_Kernel", "cgal", who)
        self._sets = optional("CGAL.CGAL_Point_set_3", "cgal", who)
        self.processing: ModuleType = optional("CGAL.CGAL_Point_set_processing_3", "cgal", who)

    def cloud(self, points: NDArray[np.float64]) -> Any:
        cloud = self._sets.Point_set_3()
        for x, y, z in np.asarray(points, np.float64).tolist():
            cloud.insert(self._kernel.Point_3(x, y, z))
        return cloud

    def positions(self, cloud: Any) -> NDArray[np.float64]:
        """Return the points in the order in which they were inserted: orienting normals rearranges them."""
        moved = np.array([(p.x(), p.y(), p.z()) for p in cloud.points()])
        ordered = np.empty_like(moved)
        ordered[np.fromiter(cloud.indices(), np.int64)] = moved
        return ordered


def _finite(moved: NDArray[np.float64], before: NDArray[np.float64]) -> NDArray[np.float64]:
    """Leave points where they were whose neighbourhood (all on a line, all equal) has no fit."""
    return np.where(np.isfinite(moved).all(axis=1, keepdims=True), moved, before)


def _check(name: str, value: int | float, low: int, high: int | float = float("inf")) -> None:
    if not low <= value <= high:
        limits = f"{low:g} or more" if high == float("inf") else f"{low:g} to {high:g}"
        raise ConfigError(f"{name}={value} is out of range; give {limits}")


def _check_count(points: NDArray[np.float64], neighbours: int) -> None:
    if len(points) <= neighbours:
        raise InputError(f"the cloud has {len(points)} points; {neighbours} neighbours need more, or give fewer")
