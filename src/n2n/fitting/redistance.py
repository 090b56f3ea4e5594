"""After the fit: the field becomes a distance, and its zero set stays where it is.

The loss of Eq. 5 decides where the zero set lies; how steep the field is there, it leaves to a compromise with the
prior. |f| of a fitted field is 10 to 30 % too small near the surface. Once the zero set is known, so are all distances
to it: the field is fitted to these, which is a plain regression.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import point_cloud_utils as pcu
import torch
import trimesh
from numpy.typing import NDArray
from torch import Tensor

from n2n.architectures.base import SDF
from n2n.errors import SurfaceError
from n2n.geometry.isosurface import extract
from n2n.geometry.pull import pull

_RATE = 0.15  # of the fit's learning rate: a correction
_BATCH = 8192
_ON_SURFACE, _NEAR, _FAR = 20_000, 40_000, 20_000
_BAND = 0.12  # unit coordinates
_STAY = 10.0  # weight of the zero set against the distances
_BLUR = 0.5  # voxels; errors of closer points count as much as if they were that far away
_PULLS = 3
Box = tuple[Sequence[float], Sequence[float]]


def redistance(field: SDF, boxes: Sequence[Box], voxel: float, rate: float, steps: int, seed: int = 0) -> None:
    """Fit a field, in place, to the signed distance to its own zero set.

    A shape without a zero set is left as it is.

    Args:
        field: Its zero set is extracted first; signs stay as they are.
        boxes: Lowest and highest corner of the box of each shape (condition), unit coordinates.
        voxel: Length of the finest detail of the field, unit coordinates.
        rate: Learning rate of the fit that made the field.
        steps: Optimiser steps.
        seed: Seed of everything random.
    """
    device = next(field.parameters()).device
    shapes = []
    for condition, box in enumerate(boxes):
        sampled = _sample(field, condition, box, voxel, seed)
        if sampled is not None:
            shapes.append((condition, *sampled))
    if not shapes:
        return
    generator = torch.Generator().manual_seed(seed)
    optimizer = torch.optim.Adam(field.parameters(), lr=rate * _RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    for step in range(steps * len(shapes)):
        condition, surface, points, distance = shapes[step % len(shapes)]
        some = torch.randint(len(points), (_BATCH,), generator=generator).to(device)
        still = torch.randint(len(surface), (_BATCH,), generator=generator).to(device)
        asked = torch.cat([points[some], surface[still]])
        optimizer.zero_grad()
        with field.shared():
            value = field(asked, torch.full((len(asked),), condition, dtype=torch.long, device=device))
            error = (value[:_BATCH] - distance[some]) / distance[some].abs().clamp_min(_BLUR * voxel)
            drift = value[_BATCH:] / (_BLUR * voxel)
            (error.square().mean() + _STAY * drift.square().mean()).backward()
        optimizer.step()
        if step % len(shapes) == len(shapes) - 1:
            schedule.step()


def _sample(field: SDF, condition: int, box: Box, voxel: float, seed: int) -> tuple[Tensor, Tensor, Tensor] | None:
    """Return points of the zero set (s, 3), points around it (m, 3) and their signed distances to it (m,)."""
    device = next(field.parameters()).device
    lower, upper = (np.asarray(corner, float) for corner in box)

    def at(function: Callable[..., Any]) -> Callable[[Tensor], Any]:
        def ask(points: Tensor) -> Any:
            codes = torch.full((len(points),), condition, dtype=torch.long, device=device)
            return function(points.to(device, torch.float32), codes)

        return ask

    with torch.no_grad(), field.shared():
        try:
            found = extract(at(field), lower, upper, voxel / 2)
        except SurfaceError:
            return None
        mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
        generator = np.random.default_rng(seed)
        samples, _ = trimesh.sample.sample_surface(mesh, _ON_SURFACE + _NEAR, seed=seed)
        near = samples[_ON_SURFACE:] + generator.uniform(0, _BAND, (_NEAR, 1)) * _directions(generator, _NEAR)
        points = np.concatenate([near, generator.uniform(lower, upper, (_FAR, 3))]).clip(lower, upper)
        distance, _, _ = pcu.closest_points_on_mesh(points, found.vertices, found.faces)
        surface = torch.as_tensor(samples[:_ON_SURFACE], dtype=torch.float32, device=device)
        for _ in range(_PULLS):
            surface = pull(surface, *at(field.value_and_gradient)(surface))
        asked = torch.as_tensor(points, dtype=torch.float32, device=device)
        sign = torch.cat([at(field)(part) for part in asked.split(_BATCH)]).sign()
    return surface, asked, sign * torch.as_tensor(distance, dtype=torch.float32, device=device)


def _directions(generator: np.random.Generator, count: int) -> NDArray[np.float64]:
    vectors = generator.standard_normal((count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
