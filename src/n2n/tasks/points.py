"""Denoising and upsampling: points pulled onto the zero level set of a fitted field, and spread evenly along it."""

from functools import partial

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from torch.nn import functional

from n2n.architectures.base import SDF
from n2n.errors import InputError
from n2n.geometry.frame import Frame
from n2n.geometry.pull import pull
from n2n.geometry.relaxation import spread
from n2n.shapes import Index, Points

_CHUNK = 100_000


def denoise_points(
    sdf: SDF, frame: Frame, points: NDArray[np.float64], shape: int = 0, pulls: int = 3, even: bool = False
) -> NDArray[np.float64]:
    """Pull world points (n, 3) onto the surface; `even` also spreads them along it.

    Source: Ma et al. 2023, Eq. 3 and Sec. 4.1. Differs: the pull may be repeated, as a learned f is a distance only
    to first order: the first pull leaves about a tenth of the way, the second a hundredth. The paper pulls once. A
    pull is repeated only where that leads closer to the surface; those between the steps of `even` are single ones.
    """
    with torch.no_grad(), sdf.shared():
        moved, _ = _project(sdf, frame.to_unit(points), shape, pulls)
        if even:
            moved = spread(moved, partial(_project, sdf, shape=shape, pulls=1))
            moved, _ = _project(sdf, moved, shape, pulls)
    return frame.to_world(moved)


def _project(
    sdf: SDF, points: NDArray[np.float64], shape: int, pulls: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pull unit points (n, 3); return them and the unit normals where `_pulled` tells, (n, 3) each."""
    device = next(sdf.parameters()).device
    moved, normals = np.empty_like(points), np.empty_like(points)
    for start in range(0, len(points), _CHUNK):
        part = torch.as_tensor(points[start : start + _CHUNK], dtype=torch.float32, device=device)
        codes = torch.full((len(part),), shape, dtype=torch.long, device=device)
        part, gradient = _pulled(sdf, part, codes, pulls)
        moved[start : start + _CHUNK] = part.cpu().double().numpy()
        normals[start : start + _CHUNK] = functional.normalize(gradient, dim=-1).cpu().double().numpy()
    return moved, normals


def _pulled(sdf: SDF, points: Points, codes: Index, pulls: int) -> tuple[Points, Points]:
    """Pull points (n, 3), again only where that leads closer to the surface.

    Returns:
        The points, and grad f where they are; of a single pull, where it began.

    Between the sides of a thin wall f may be several times steeper than a distance. There each pull overshoots more
    than the one before: after three, a point had gone fourteen deviations of its noise.
    """
    value, gradient = sdf.value_and_gradient(points, codes)
    points = pull(points, value, gradient)
    if pulls > 1:
        value, gradient = sdf.value_and_gradient(points, codes)
    for _ in range(pulls - 1):
        further = pull(points, value, gradient)
        its_value, its_gradient = sdf.value_and_gradient(further, codes)
        closer = its_value.abs() < value.abs()
        value = torch.where(closer, its_value, value)
        points = torch.where(closer.unsqueeze(-1), further, points)
        gradient = torch.where(closer.unsqueeze(-1), its_gradient, gradient)
    return points, gradient


def upsample_points(
    sdf: SDF,
    frame: Frame,
    points: NDArray[np.float64],
    rate: int,
    seed: int = 0,
    shape: int = 0,
    pulls: int = 3,
    even: bool = False,
) -> NDArray[np.float64]:
    """Return (rate * n, 3) world points on the surface.

    The first n are the denoised points themselves; the rest are copies perturbed by about the distance between
    neighbours and pulled back, so that they fill the gaps. `even` then spreads all of them along the surface.

    Raises:
        InputError: rate < 1.

    Source: Ma et al. 2023, Sec. 4.2.
    """
    if rate < 1:
        raise InputError(f"rate must be at least 1, got {rate}")
    clean = denoise_points(sdf, frame, points, shape, pulls)
    if len(clean) < 2:
        return np.repeat(clean, rate, axis=0)
    spacing = cKDTree(clean).query(clean, 2)[0][:, 1:]
    gap = np.maximum(spacing, np.median(spacing))
    random = np.random.default_rng(seed)
    copies = [clean + gap * random.standard_normal(clean.shape) for _ in range(rate - 1)]
    dense = np.concatenate([clean, *(denoise_points(sdf, frame, copy, shape, pulls) for copy in copies)])
    return denoise_points(sdf, frame, dense, shape, pulls, even) if even else dense
