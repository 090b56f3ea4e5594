"""Reconstruction: the zero level set of a fitted field as a mesh in world coordinates."""

from typing import Any

import numpy as np
import torch
import trimesh

from n2n.architectures.base import SDF
from n2n.errors import ConfigError
from n2n.geometry.components import drop_small_components
from n2n.geometry.frame import Frame
from n2n.geometry.isosurface import extract, voxel_size

_MARGIN = 1.05
_SPECK = 0.01  # of the largest component's area


def reconstruct_surface(
    sdf: SDF,
    frame: Frame,
    config: dict[str, Any],
    resolution: int = 256,
    edge: float | None = None,
    shape: int = 0,
    keep_all: bool = False,
) -> trimesh.Trimesh:
    """Extract the zero level set; see `Field.reconstruct` for the arguments.

    Source: Ma et al. 2023, Sec. 4.3. Differs: iso-level exactly 0 and coarse-to-fine evaluation.
    """
    lower, upper = field_box(config)
    if edge is not None:
        if not edge > 0:
            raise ConfigError(f"the edge length must be positive, got {edge}")
        voxel = edge / frame.scale
    else:
        if not 8 <= resolution <= 2048:
            raise ConfigError(f"resolution={resolution} is out of range; give 8 to 2048 voxels along the longest side")
        voxel = voxel_size(lower, upper, resolution)
    device = next(sdf.parameters()).device

    def evaluate(points: torch.Tensor) -> torch.Tensor:
        codes = torch.full((len(points),), shape, dtype=torch.long, device=device)
        return sdf(points.to(device, torch.float32), codes)

    with torch.no_grad(), sdf.shared():
        surface = extract(evaluate, lower, upper, voxel, polish=1)
    vertices, faces = surface.vertices, surface.faces
    if not keep_all:
        vertices, faces = drop_small_components(vertices, faces, _SPECK)
    return trimesh.Trimesh(frame.to_world(vertices), faces, process=False)


def field_box(config: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return the box that holds the surface: the grid's own, or the unit ball's for a network."""
    architecture = config["architecture"]
    if architecture.get("lower") is not None and architecture.get("upper") is not None:
        return np.array(architecture["lower"], float), np.array(architecture["upper"], float)
    return np.full(3, -_MARGIN), np.full(3, _MARGIN)
