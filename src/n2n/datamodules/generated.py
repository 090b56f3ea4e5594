"""Noisy scans of analytic shapes: data with a known truth and no download."""

from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray

from n2n.datamodules.benchmark import BenchmarkDataModule, check_count
from n2n.errors import InputError
from n2n.geometry.checks import MIN_POINTS
from n2n.geometry.isosurface import extract, voxel_size
from n2n.geometry.noise import check_model
from n2n.geometry.reference import Reference
from n2n.geometry.shapes import SHAPES, sample_surface, scan, surface_normals
from n2n.registry import suggest

_RESOLUTION = 96
_MARGIN = 0.02  # of the longest side of the box
_POLISH = 2


class GeneratedDataModule(BenchmarkDataModule):
    """Scans of a shape whose distance is known in closed form; each scan has its own points.

    The truth holds the clean points of the first scan, row by row, their normals, and a mesh.

    Args:
        shape: bracket | sphere | torus.
        points: Points per observation.
        noise: Standard deviation of the noise relative to the shape's bounding radius.
        noise_model: A name of `NOISE_MODELS`.
        observations: Independent scans; None makes as many as are used.
        seed: Of points and noise.
        num_observations: N; None uses all.
    """

    def __init__(
        self,
        shape: str = "bracket",
        points: int = 10_000,
        noise: float = 0.01,
        noise_model: str = "gaussian",
        observations: int | None = None,
        seed: int = 0,
        num_observations: int | None = None,
    ) -> None:
        if shape not in SHAPES:
            raise InputError(f"unknown shape {shape!r}.{suggest(str(shape), list(SHAPES))}")
        check_count("points", points, MIN_POINTS)
        check_count("observations", observations)
        check_model(noise_model, noise)
        count = num_observations or observations or 1
        clean = sample_surface(shape, points, seed)
        reference = Reference(clean, surface_normals(shape, clean), *_mesh(shape))
        super().__init__(
            shape,
            [scan(shape, points, noise, seed + k, noise_model) for k in range(count)],
            reference,
            f"generated {shape}, {points} points; {noise_model} noise {noise:g} of the radius, seed {seed}",
            num_observations,
        )

    @classmethod
    def names(cls, root: str | None = None) -> list[str]:
        return list(SHAPES)

    @classmethod
    def missing(cls, root: str | None = None) -> str | None:
        return None


@lru_cache
def _mesh(shape: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices and faces of the shape; away from sharp edges exact but for the flatness of the triangles."""
    distance, lower, upper = SHAPES[shape]
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    margin = _MARGIN * (upper - lower).max()
    lower, upper = lower - margin, upper + margin
    surface = extract(
        lambda p: torch.as_tensor(distance(p.numpy())), lower, upper, voxel_size(lower, upper, _RESOLUTION),
        polish=_POLISH,
    )  # fmt: skip
    return surface.vertices, surface.faces
