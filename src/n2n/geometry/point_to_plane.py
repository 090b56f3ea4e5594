"""Distances to a surface of which only samples with normals are known."""

import torch
from jaxtyping import Float
from torch import Tensor

from n2n.shapes import Points, Values

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
    distance = torch.empty(len(points), device=points.device)
    for start in range(0, len(points), _CHUNK):
        part = slice(start, start + _CHUNK)
        reach, index = torch.cdist(points[part], samples).min(dim=1)
        along = ((points[part] - samples[index]) * normals[index]).sum(-1)
        aside = (reach.square() - along.square()).clamp(0, spacing**2)
        distance[part] = (reach.square() - aside).sqrt()
    return distance
