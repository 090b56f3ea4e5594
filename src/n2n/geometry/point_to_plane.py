"""Distances to a surface of which only samples with normals are known."""

import torch
from jaxtyping import Float
from scipy.spatial import cKDTree
from torch import Tensor

from n2n.shapes import Index, Points, Values

_CHUNK = 4096


def point_to_plane(
    points: Points, samples: Float[Tensor, "m 3"], normals: Float[Tensor, "m 3"], spacing: float
) -> Values:
    """Return the unsigned distance of points to a surface known by samples and normals.

    The nearest sample is not the nearest point of the surface: that is up to a spacing aside. The distance to the
    sample alone is too large between samples, and would press the field into every gap of the cloud.

    Args:
        points: (n, 3) positions, unit coordinates.
        samples: (m, 3) points of the surface.
        normals: (m, 3) unit normals there, of either sign.
        spacing: How far aside of a sample its tangent plane is believed, >= 0.

    Returns:
        (n,) distances, unit coordinates, >= 0.
    """
    index = _nearest(points, samples)
    offset = points - samples[index]
    reach = offset.square().sum(-1)
    along = (offset * normals[index]).sum(-1)
    aside = (reach - along.square()).clamp(0, spacing**2)
    return (reach - aside).clamp(min=0).sqrt()


def _nearest(points: Points, samples: Float[Tensor, "m 3"]) -> Index:
    """Return the nearest sample of each point, (n,): by a tree on the CPU, by all distances on a GPU."""
    if points.device.type == "cpu":
        return torch.as_tensor(cKDTree(samples.numpy()).query(points.numpy(), workers=-1)[1], dtype=torch.long)
    return torch.cat([torch.cdist(part, samples).argmin(dim=1) for part in points.split(_CHUNK)])
