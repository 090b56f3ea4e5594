"""Models of sensor noise, for observations with a known truth."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from n2n.errors import InputError

_Cloud = NDArray[np.float64]
_Model = Callable[[_Cloud, float, np.random.Generator, _Cloud | None], _Cloud]

_CAMERAS = 12
_CAMERA_DISTANCE = 4.0  # bounding radii
_PLANE = 16  # points that decide a normal
_LEVELS = 2  # steps to either side
_DISPLACED = 0.5  # share of the points that take a step
_STRAY = 0.05  # share of the points that are outliers
_MARGIN = 0.1  # of the box's sides, around the box of the outliers


def gaussian(points: _Cloud, scale: float, random: np.random.Generator, normals: _Cloud | None = None) -> _Cloud:
    """Add isotropic Gaussian noise: deviation `scale` along every axis."""
    return points + scale * random.standard_normal(points.shape)


def uniform(points: _Cloud, scale: float, random: np.random.Generator, normals: _Cloud | None = None) -> _Cloud:
    """Add noise evenly out of a cube with the same deviation along every axis."""
    reach = np.sqrt(3.0) * scale
    return points + random.uniform(-reach, reach, points.shape)


def laplace(points: _Cloud, scale: float, random: np.random.Generator, normals: _Cloud | None = None) -> _Cloud:
    """Add Laplacian noise with the same deviation along every axis: many small errors, some large ones."""
    return points + random.laplace(0.0, scale / np.sqrt(2.0), points.shape)


def along_ray(points: _Cloud, scale: float, random: np.random.Generator, normals: _Cloud | None = None) -> _Cloud:
    """Add Gaussian noise along the view ray, as the depth of a time-of-flight scanner has it.

    Cameras stand evenly around the object; each point is measured by the one that sees it most nearly head-on. That the
    object hides parts of itself is not taken into account. All of the noise, of deviation `scale`, is in the depth.

    Args:
        points: (n, 3).
        scale: Deviation of the depth.
        random: Generator.
        normals: (n, 3) unit normals, to choose the camera; orientation is ignored where None, then the normals come
            from the nearest points.
    """
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = float(np.linalg.norm(points - centre, axis=1).max())
    cameras = centre + _CAMERA_DISTANCE * radius * even_directions(_CAMERAS)
    rays = points[:, None] - cameras
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    facing = -np.einsum("nci,ni->nc", rays, _outward(points, centre) if normals is None else normals)
    ray = rays[np.arange(len(points)), facing.argmax(axis=1)]
    return points + scale * random.standard_normal((len(points), 1)) * ray


def discrete(points: _Cloud, scale: float, random: np.random.Generator, normals: _Cloud | None = None) -> _Cloud:
    """Displace half of the points by whole steps along each axis, as coarse quantisation does; the rest stays exact.

    The steps -2, -1, 1, 2 are equally likely and as long as gives the deviation `scale` along every axis over all
    points.
    """
    levels = np.array([k for k in range(-_LEVELS, _LEVELS + 1) if k])
    step = scale / np.sqrt(_DISPLACED * (levels**2).mean())
    moved = random.random(len(points)) < _DISPLACED
    return points + step * random.choice(levels, points.shape) * moved[:, None]


def outliers(points: _Cloud, scale: float, random: np.random.Generator, normals: _Cloud | None = None) -> _Cloud:
    """Add Gaussian noise, and replace 5 % of the points by ones evenly out of the box around the object."""
    return _stray(gaussian(points, scale, random), points, random)


def mixed(points: _Cloud, scale: float, random: np.random.Generator, normals: _Cloud | None = None) -> _Cloud:
    """Give each point Gaussian, uniform, Laplacian, ray or discrete noise by chance; then replace 5 % by outliers."""
    kinds = np.stack([model(points, scale, random, normals) for model in _MIXED])
    chosen = random.integers(len(kinds), size=len(points))
    return _stray(kinds[chosen, np.arange(len(points))], points, random)


_MIXED: tuple[_Model, ...] = (gaussian, uniform, laplace, along_ray, discrete)
NOISE_MODELS: dict[str, _Model] = {
    "gaussian": gaussian,
    "uniform": uniform,
    "laplace": laplace,
    "range": along_ray,
    "discrete": discrete,
    "outliers": outliers,
    "mixed": mixed,
}


def add_noise(
    points: _Cloud, model: str, scale: float, random: np.random.Generator, normals: _Cloud | None = None
) -> _Cloud:
    """Return a noisy copy of a clean cloud, (n, 3), row by row.

    Args:
        points: (n, 3).
        model: A name of `NOISE_MODELS`.
        scale: Standard deviation of the noise, in the units of the points.
        random: Generator of everything random.
        normals: (n, 3) unit normals, outwards; only `range` and `mixed` look at them.

    Raises:
        InputError: Unknown model, or a deviation that is none.
    """
    check_model(model, scale)
    return NOISE_MODELS[model](points, float(scale), random, normals)


def check_model(model: str, scale: float) -> None:
    """Raise InputError for an unknown model or a deviation below 0."""
    if model not in NOISE_MODELS:
        raise InputError(f"noise model {model!r} is not known; choose one of: {', '.join(NOISE_MODELS)}")
    if isinstance(scale, bool) or not isinstance(scale, int | float) or not 0 <= scale < float("inf"):
        raise InputError(f"noise={scale} is out of range; give a standard deviation >= 0")


def even_directions(count: int) -> _Cloud:
    """Return `count` unit vectors spread evenly over the sphere, (count, 3): a Fibonacci spiral."""
    height = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    ring = np.sqrt(1 - height**2)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)


def _stray(noisy: _Cloud, clean: _Cloud, random: np.random.Generator) -> _Cloud:
    lower, upper = clean.min(axis=0), clean.max(axis=0)
    margin = _MARGIN * (upper - lower)
    chosen = random.permutation(len(noisy))[: round(_STRAY * len(noisy))]
    result = noisy.copy()
    result[chosen] = random.uniform(lower - margin, upper + margin, (len(chosen), 3))
    return result


def _outward(points: _Cloud, centre: _Cloud) -> _Cloud:
    """Return normals of the nearest points' planes, (n, 3), turned away from the centre."""
    nearest = cKDTree(points).query(points, min(_PLANE, len(points)))[1]
    patch = points[nearest]
    patch = patch - patch.mean(axis=1, keepdims=True)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", patch, patch))[1][:, :, 0]
    away = np.einsum("ni,ni->n", normals, points - centre)
    return normals * np.where(away < 0, -1.0, 1.0)[:, None]
