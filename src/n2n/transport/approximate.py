"""The soft multi-scale matching used by the released code in place of a one-to-one map."""

import torch

from n2n.shapes import Coupling, Leaves
from n2n.transport.assignment import matching_cost


@torch.no_grad()
def approximate_plan(source: Leaves, target: Leaves) -> Coupling:
    """Hand out mass from narrow to wide kernels exp(-4^j |s - t|^2), j = 7 ... -1, then whatever is left evenly.

    Args:
        source, target: b leaves of k points each, with mass 1 / k per point.

    Returns:
        Plan (b, k, k) with row and column sums of at most 1 / k.

    Source: the `approxmatch` operator of Fan et al. 2017 (Point Set Generation Network), used by the script released
        with Ma et al. 2023. The kernel widths are absolute: they assume coordinates of unit size.
    """
    squared = matching_cost(source, target, 2)
    count = squared.shape[-1]
    tiny = 1e-9
    supply = torch.ones_like(squared[:, :, :1])
    demand = torch.ones_like(squared[:, :1, :])
    plan = torch.zeros_like(squared)
    for level in [-(4.0**j) for j in range(7, -2, -1)] + [0.0]:
        kernel = (level * squared).exp() * demand
        share = kernel * (supply / (kernel.sum(dim=2, keepdim=True) + tiny))
        received = share.sum(dim=1, keepdim=True)
        share = share * (demand / (received + tiny)).clamp_max(1)
        plan += share
        supply = (supply - share.sum(dim=2, keepdim=True)).clamp_min(0)
        demand = (demand - share.sum(dim=1, keepdim=True)).clamp_min(0)
    return plan / count
