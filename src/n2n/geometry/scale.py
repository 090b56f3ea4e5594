"""Noise level and point spacing, estimated from the noisy points alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

_NEIGHBOURS = (12, 24, 48, 96, 192, 384)
_PROBES = 500
_PATCH_TO_NOISE = 2.5
_LOCAL = 0.01  # of the points: most patches that hold more of them hold shape, too
_SMALL = 18
# What a patch of a flat sheet with noise 1 shows, by the ratio of its radius (median) to its residual (lower quartile):
# ratio, lower quartile and median of the residual, spacing over the true one. Small patches, and all others, whose
# curves are one. tests/unit/geometry/test_scale.py simulates the sheet. Below the first ratio a patch looks like any
# ball of noise and says nothing.
_SHEET_SMALL = np.array([
    [2.31, 0.62, 0.75, 1.19], [2.50, 0.70, 0.86, 1.13], [2.75, 0.76, 0.93, 1.09], [3.17, 0.80, 0.99, 1.05],
    [3.79, 0.83, 1.03, 1.03], [4.42, 0.845, 1.05, 1.01], [5.79, 0.86, 1.07, 1.0],
])  # fmt: skip
_SHEET = np.array([
    [1.94, 0.65, 0.69, 1.24], [2.07, 0.72, 0.77, 1.18], [2.20, 0.76, 0.82, 1.15], [2.43, 0.825, 0.88, 1.10],
    [2.72, 0.875, 0.92, 1.07], [3.03, 0.91, 0.955, 1.055], [3.36, 0.93, 0.98, 1.045], [4.05, 0.957, 1.0, 1.03],
    [5.60, 0.98, 1.025, 1.015], [8.0, 0.99, 1.03, 1.01],
])  # fmt: skip


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
    """Estimate noise and spacing from quadric fits to local patches of several sizes.

    A patch narrower than the noise looks like a ball and hides part of the noise; a patch wider than the features
    counts shape as noise. How much the first hides is known from its ratio of radius to residual, and is put back. The
    second can only be too large, so the smallest of all answers counts. Noise along one direction leaves many patches
    without any, so while patches are small the median over all of them counts.

    Args:
        points: (n, 3), n >= 25.
        seed: Chooses which points are probed.
    """
    generator = np.random.default_rng(seed)
    tree = cKDTree(points)
    probes = points[generator.choice(len(points), min(_PROBES, len(points)), replace=False)]
    answers, widths = [], []
    for k in [k for k in _NEIGHBOURS if k <= len(points) // 2] or [len(points) // 2]:
        distance, index = tree.query(probes, k)
        radius, residual = _quadric_residual(points[index])
        # The lower quartile: patches that hold an edge or two sheets inflate the mean, never the quartile.
        low, median = np.quantile(residual, [0.25, 0.5]) * (1 + 0.5 / np.sqrt(k))
        widths.append((k, float(np.median(radius))))
        ratio = widths[-1][1] / max(low, 1e-12)
        sheet = _SHEET_SMALL if k < _SMALL else _SHEET
        hidden, hidden_median, wider = (np.interp(ratio, sheet[:, 0], column) for column in sheet[:, 1:].T)
        noise = median / hidden_median if k <= _LOCAL * len(points) else low / hidden
        # Area per point from the smallest disc that holds the k - 1 points around each probe.
        spacing = np.sqrt(np.pi * np.median(distance[:, -1]) ** 2 / (k - 1)) / wider
        answers.append((ratio < sheet[0, 0], float(noise), float(spacing)))
    # Where every patch is a ball, the widest is the least bad.
    blind, noise, spacing = min(answers)
    if blind:
        _, noise, spacing = answers[-1]
    patch = next((k for k, width in widths if width >= _PATCH_TO_NOISE * noise), widths[-1][0])
    return Scales(noise, spacing, patch, spacing**2 * len(points))


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
