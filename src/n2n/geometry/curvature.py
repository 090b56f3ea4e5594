"""Mean curvature of a field's level sets, and what it does to noisy points."""

from collections.abc import Callable

import torch
from torch.nn import functional

from n2n.shapes import Points, Values


def curvature(gradient: Callable[[Points], Points], points: Points, step: float) -> Values:
    """Return the sum of the principal curvatures of the level set through each point, (n,), 1 / unit.

    It is the divergence of the unit normal, from central differences: 2 / r on a sphere of radius r, 1 / r on a
    cylinder; positive where the inside bulges out.

    Args:
        gradient: (m, 3) positions -> grad f there, (m, 3), of any length.
        points: (n, 3).
        step: Distance of the differences: bends shorter than that are averaged over.
    """
    total = points.new_zeros(len(points))
    for axis, offset in enumerate(step * torch.eye(3, dtype=points.dtype, device=points.device)):
        ahead, behind = (functional.normalize(gradient(points + sign * offset), dim=-1)[:, axis] for sign in (1, -1))
        total += (ahead - behind) / (2 * step)
    return total


def noise_shift(curvature: Values, noise: float) -> Values:
    """Return how far outwards of a curved surface its noisy points lie on average, (n,), at most one deviation.

    Noise of deviation sigma in all directions moves a point of a sphere of radius r to a mean distance of
    r + sigma^2 / r from the centre: half of sigma^2 times the sum of the principal curvatures, to second order.
    """
    return (0.5 * noise**2 * curvature).clamp(-noise, noise)
