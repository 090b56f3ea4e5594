"""The distance L between denoised queries and targets (Eq. 4), behind one interface.

`match` finds the plan without gradients; calling the distance measures it, differentiably in the moved points. A plan
may be kept for several optimiser steps.
"""

from typing import Any

import torch
from torch import Tensor

from n2n.shapes import Coupling, LeafIndex, Leaves
from n2n.transport.approximate import approximate_plan
from n2n.transport.assignment import exact_assignment
from n2n.transport.sinkhorn import sinkhorn_plan


def power_norm(difference: Tensor, p: int) -> Tensor:
    """Return |d|^p over the last axis; the gradient at d = 0 is zero, not NaN."""
    squared = difference.square().sum(-1)
    if p == 2:
        return squared
    positive = squared > 0
    return squared.where(positive, 1.0).sqrt() * positive


def _exponent(p: int) -> int:
    if p not in (1, 2):
        raise ValueError(f"p must be 1 or 2, got {p}")
    return p


class EMD:
    """Earth mover's distance: mean |g - phi(g)|^p under the best one-to-one map.

    Args:
        p: 1 (Eq. 4 as printed) or 2 (as in the proof of Theorem 1).

    Source: Ma et al. 2023, Eq. 4. Differs: the mean is taken where the paper prints a sum.
    """

    def __init__(self, p: int = 1) -> None:
        self.p = _exponent(p)

    def match(self, moved: Leaves, target: Leaves) -> LeafIndex:
        """Return phi, (b, k)."""
        return exact_assignment(moved.detach(), target, self.p)

    def __call__(self, moved: Leaves, target: Leaves, plan: LeafIndex | None = None) -> Tensor:
        """Return the mean matched distance, unit^p."""
        plan = self.match(moved, target) if plan is None else plan
        matched = target.gather(1, plan[..., None].expand(-1, -1, 3))
        return power_norm(moved - matched, self.p).mean()


class Chamfer:
    """Chamfer distance, the ablation: mean of both directions' nearest-neighbour distances. Not one-to-one.

    Args:
        p: Exponent of the distances, 1 or 2.
    """

    def __init__(self, p: int = 1) -> None:
        self.p = _exponent(p)

    @torch.no_grad()
    def match(self, moved: Leaves, target: Leaves) -> tuple[LeafIndex, LeafIndex]:
        """Return the nearest target of every moved point and the nearest moved point of every target."""
        distance = torch.cdist(moved.detach(), target)
        return distance.argmin(dim=2), distance.argmin(dim=1)

    def __call__(self, moved: Leaves, target: Leaves, plan: tuple[LeafIndex, LeafIndex] | None = None) -> Tensor:
        """Return 0.5 * (mean to target + mean from target), unit^p."""
        to_target, to_moved = self.match(moved, target) if plan is None else plan
        forth = moved - target.gather(1, to_target[..., None].expand(-1, -1, 3))
        back = target - moved.gather(1, to_moved[..., None].expand(-1, -1, 3))
        return 0.5 * (power_norm(forth, self.p).mean() + power_norm(back, self.p).mean())


class _SoftDistance:
    """Mean cost of a soft plan (b, k, k) that is held fixed while the points move."""

    p: int = 1

    def match(self, moved: Leaves, target: Leaves) -> Coupling:
        raise NotImplementedError

    def __call__(self, moved: Leaves, target: Leaves, plan: Coupling | None = None) -> Tensor:
        """Return sum_ij plan_ij |g_i - t_j|^p, averaged over the leaves."""
        plan = self.match(moved, target) if plan is None else plan
        cost: Any = power_norm(moved[:, :, None] - target[:, None], self.p)
        return (plan * cost).sum(dim=(1, 2)).mean()


class Sinkhorn(_SoftDistance):
    """Entropic EMD.

    Args:
        epsilon: Blur relative to the mean cost.
        iterations: Scaling iterations.
        p: Exponent of the cost.
    """

    def __init__(self, epsilon: float = 0.01, iterations: int = 100, p: int = 1) -> None:
        self.epsilon, self.iterations, self.p = epsilon, iterations, _exponent(p)

    def match(self, moved: Leaves, target: Leaves) -> Coupling:
        return sinkhorn_plan(moved.detach(), target, self.epsilon, self.iterations, self.p)


class Approximate(_SoftDistance):
    """The released code's distance: soft multi-scale matching.

    Args:
        p: Exponent of the cost; the released code uses 1.
    """

    def __init__(self, p: int = 1) -> None:
        self.p = _exponent(p)

    def match(self, moved: Leaves, target: Leaves) -> Coupling:
        return approximate_plan(moved.detach(), target)
