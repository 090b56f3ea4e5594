"""Noise level and point spacing, estimated from the noisy points alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.special import gammaincinv

_NEIGHBOURS = (12, 24, 48, 96, 192, 384)
_PROBES = 500
_PATCH_TO_NOISE = 2.75
_LOCAL = 0.01  # of the points: most patches that hold more of them hold shape, too
_WIDER = 1.05  # a patch of twice the points whose ratio grows by less counts shape as noise


@dataclass(frozen=True)
class Scales:
    """What the data says about itself, in the coordinates of the points it was estimated from.

    Attributes:
        noise: Standard deviation of the noise along the surface normal.
        spacing: Square root of the surface area per point.
        patch: Number of neighbours of the smallest patch that is clearly wider than the noise.
        area: Surface area, points * spacing^2.
    """

    noise: float
    spacing: float
    patch: int
    area: float


def estimate_scales(points: NDArray[np.float64], seed: int = 0) -> Scales:
    """Estimate noise and spacing from quadric fits to local patches of growing size.

    A patch narrower than the noise looks like a ball and hides the noise; a patch much wider than the features counts
    shape as noise. The residual is read where the patch first becomes 2.75 times as wide as the residual itself, else
    where that ratio stops growing. Noise along one direction leaves many patches without any, so while patches are
    small the median over all of them counts.

    Args:
        points: (n, 3), n >= 25.
        seed: Chooses which points are probed.
    """
    generator = np.random.default_rng(seed)
    tree = cKDTree(points)
    probes = points[generator.choice(len(points), min(_PROBES, len(points)), replace=False)]
    sizes = [k for k in _NEIGHBOURS if k <= len(points) // 2] or [len(points) // 2]
    best, best_ratio = None, -1.0
    for k in sizes:
        distance, index = tree.query(probes, k)
        radius, residual = _quadric_residual(points[index])
        # The lower quartile: patches that hold an edge or two sheets inflate the mean, never the quartile.
        low, median = np.quantile(residual, [0.25, 0.5]) * (1 + 0.5 / np.sqrt(k))
        ratio = float(np.median(radius) / max(low, 1e-12))
        # The smallest patch has a ratio of 2 in any ball of noise, which says nothing.
        if ratio > _WIDER * best_ratio or best[2] == sizes[0]:
            # Of small patches the median, as the lower quartile that Gaussian noise of this median would have.
            noise = float(median * _quartile_to_median(k - 6) if k <= _LOCAL * len(points) else low)
            # Area per point from the smallest disc that holds the k - 1 points around each probe.
            spacing = np.sqrt(np.pi * np.median(distance[:, -1]) ** 2 / (k - 1))
            best, best_ratio = (noise, float(spacing), k), ratio
        if ratio >= _PATCH_TO_NOISE:
            break
    noise, spacing, patch = best
    return Scales(noise, spacing, patch, spacing**2 * len(points))


def _quartile_to_median(degrees: int) -> float:
    """Return lower quartile over median of the root of a chi-squared variable."""
    low, median = gammaincinv(max(degrees, 1) / 2, [0.25, 0.5])
    return float(np.sqrt(low / median))


def _quadric_residual(patches: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fit a quadric height field to each (p, k, 3) patch; return its rms radius and residual deviation, (p,) each."""
    local = patches - patches.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh(np.einsum("pki,pkj->pij", local, local))
    local = np.einsum("pki,pij->pkj", local, axes)
    height, u, v = local[..., 0], local[..., 1], local[..., 2]
    radius = np.sqrt((u**2 + v**2).mean(axis=1))
    scale = np.maximum(radius, 1e-300)[:, None]
    u, v = u / scale, v / scale
    basis = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    gram = np.einsum("pki,pkj->pij", basis, basis) + 1e-9 * np.eye(6)
    coefficients = np.linalg.solve(gram, np.einsum("pki,pk->pi", basis, height)[..., None])
    residual = height - (basis @ coefficients)[..., 0]
    degrees = max(patches.shape[1] - 6, 1)
    return radius, np.sqrt((residual**2).sum(axis=1) / degrees)
