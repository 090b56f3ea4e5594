"""Entropic optimal transport: a soft matching that is smooth in the points."""

import math

import torch

from n2n.shapes import Coupling, Leaves
from n2n.transport.assignment import matching_cost


@torch.no_grad()
def sinkhorn_plan(source: Leaves, target: Leaves, epsilon: float = 0.01, iterations: int = 100, p: int = 1) -> Coupling:
    """Return the entropic transport plan of each leaf, computed in the log domain.

    Args:
        source, target: b leaves of k points each, with mass 1 / k per point.
        epsilon: Entropic blur relative to the mean cost of the leaf, > 0; smaller is closer to the exact matching
            and needs more iterations.
        iterations: Pairs of row and column scalings.
        p: Exponent of the cost |s - t|^p.

    Returns:
        Plan (b, k, k); columns sum to 1 / k exactly, rows up to convergence.

    Source: Peyre and Cuturi 2019, Computational Optimal Transport, Sec. 4.4.
    """
    cost = matching_cost(source, target, p)
    blur = epsilon * cost.mean(dim=(1, 2), keepdim=True).clamp_min(torch.finfo(cost.dtype).tiny)
    kernel = -cost / blur
    mass = -math.log(cost.shape[-1])
    column = torch.zeros_like(kernel[:, :1, :])
    for _ in range(iterations):
        row = mass - torch.logsumexp(kernel + column, dim=2, keepdim=True)
        column = mass - torch.logsumexp(kernel + row, dim=1, keepdim=True)
    return (kernel + row + column).exp()
