"""Analytic shapes with a known signed distance, and simulated noisy scans of them."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from n2n.geometry.noise import add_noise

_Distance = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def _box(p: NDArray[np.float64], centre: tuple, half: tuple) -> NDArray[np.float64]:
    q = np.abs(p - centre) - half
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)


def _cylinder(p: NDArray[np.float64], centre: tuple, axis: int, radius: float, half: float) -> NDArray[np.float64]:
    q = p - centre
    radial = np.linalg.norm(np.delete(q, axis, axis=1), axis=1) - radius
    q = np.stack([radial, np.abs(q[:, axis]) - half], axis=1)
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)


def bracket(p: NDArray[np.float64]) -> NDArray[np.float64]:
    """A mounting bracket, millimetres: base plate, thin upright wall with a hole, gusset, boss with a bore.

    The value has the right sign everywhere and is the exact distance near faces; next to inner edges of the union it is
    a lower bound.
    """
    base = _box(p, (0, 0, 5), (60, 35, 5))
    wall = _box(p, (-56, 0, 40), (4, 35, 40))
    gusset = np.maximum(_box(p, (-32, 0, 30), (28, 3, 28)), ((p[:, 0] + 10) + (p[:, 2] - 28)) / np.sqrt(2))
    boss = _cylinder(p, (28, 0, 17), 2, 18.0, 17.0)
    solid = np.minimum.reduce([base, wall, gusset, boss])
    bore = _cylinder(p, (28, 0, 17), 2, 10.0, 40.0)
    window = _cylinder(p, (-56, 0, 55), 0, 14.0, 20.0)
    return np.maximum(solid, -np.minimum(bore, window))


def sphere(p: NDArray[np.float64]) -> NDArray[np.float64]:
    """The unit sphere."""
    return np.linalg.norm(p, axis=1) - 1


def torus(p: NDArray[np.float64]) -> NDArray[np.float64]:
    """A torus around z, radii 0.7 and 0.25."""
    return np.hypot(np.hypot(p[:, 0], p[:, 1]) - 0.7, p[:, 2]) - 0.25


# Shape -> signed distance, lower and upper corner of a box around it.
SHAPES: dict[str, tuple[_Distance, tuple, tuple]] = {
    "bracket": (bracket, (-65, -40, -5), (65, 40, 85)),
    "sphere": (sphere, (-1.1, -1.1, -1.1), (1.1, 1.1, 1.1)),
    "torus": (torus, (-1, -1, -0.3), (1, 1, 0.3)),
}


@lru_cache(maxsize=4)
def sample_surface(shape: str, count: int, seed: int = 0) -> NDArray[np.float64]:
    """Return `count` points on the surface, evenly by area.

    Points of a thin shell around the surface are even by area; they are then moved onto the surface along the gradient.
    The last few are kept, read-only: a scan and its truth are the same points.
    """
    distance, lower, upper = SHAPES[shape]
    random = np.random.default_rng(seed)
    shell = 0.004 * float(np.linalg.norm(np.subtract(upper, lower)))
    chosen: list[NDArray[np.float64]] = []
    while sum(map(len, chosen)) < count:
        candidates = random.uniform(lower, upper, (200_000, 3))
        chosen.append(candidates[np.abs(distance(candidates)) < shell])
    points = np.concatenate(chosen)[:count]
    for _ in range(6):
        points = points - distance(points)[:, None] * _gradient(distance, points, shell)
    points.flags.writeable = False
    return points


def surface_normals(shape: str, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return outward unit normals at points on or near the surface, (n, 3)."""
    distance, lower, upper = SHAPES[shape]
    return _gradient(distance, points, 0.004 * float(np.linalg.norm(np.subtract(upper, lower))))


def scan(shape: str, count: int, noise: float, seed: int = 0, model: str = "gaussian") -> NDArray[np.float64]:
    """Return a simulated scan: even surface points plus noise, row by row those of `sample_surface`.

    Args:
        shape: A name of `SHAPES`.
        count: Points.
        noise: Standard deviation relative to the bounding radius.
        seed: Of points and noise.
        model: A name of `NOISE_MODELS`.
    """
    points = sample_surface(shape, count, seed)
    radius = float(np.linalg.norm(points - (points.min(axis=0) + points.max(axis=0)) / 2, axis=1).max())
    return add_noise(points, model, noise * radius, np.random.default_rng([seed, 1]), surface_normals(shape, points))


def _gradient(distance: _Distance, points: NDArray[np.float64], shell: float) -> NDArray[np.float64]:
    step = 1e-3 * shell
    slope = np.stack([distance(points + step * e) - distance(points - step * e) for e in np.eye(3)], axis=1)
    return slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)
