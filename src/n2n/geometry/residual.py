"""How far noisy points are off the zero set of a field: the noise, once there is a field."""

from collections.abc import Callable

import torch
from torch.nn import functional

from n2n.geometry.pull import pull
from n2n.shapes import Points, Values

_PULLS = 4
_SAME = 0.5  # of the room; a foot found again is not farther from the first one


@torch.no_grad()
def residual_noise(evaluate: Callable[[Points], tuple[Values, Points]], points: Points, room: float) -> float:
    """Return the root mean square distance of points from the zero set, of those that have room on their side.

    Between two sheets closer than the noise, points are measured from the nearer one and seem to be less noisy than
    they are. Points outside of a thin wall are not: from a position as far off as `room` one comes back to their foot.

    Args:
        evaluate: (m, 3) positions -> f there (m,), and its gradient (m, 3).
        points: Noisy points (n, 3).
        room: Distance from the surface that must be free, unit coordinates; about twice the noise.

    Returns:
        The distance, NaN where no point has room.
    """
    foot = points
    for _ in range(_PULLS):
        foot = pull(foot, *evaluate(foot))
    normal = functional.normalize(evaluate(foot)[1], dim=-1)
    height = ((points - foot) * normal).sum(dim=-1)
    back = foot + room * height.sign()[:, None] * normal
    for _ in range(_PULLS // 2):
        back = pull(back, *evaluate(back))
    free = (back - foot).norm(dim=-1) < _SAME * room
    return float(height[free].square().mean().sqrt())
