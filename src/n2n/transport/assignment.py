"""The exact one-to-one matching phi of Eq. 4, leaf by leaf."""

from concurrent.futures import ThreadPoolExecutor
from os import cpu_count

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment

from n2n.shapes import LeafIndex, Leaves

_PARALLEL_FROM = 64  # leaves; below that starting threads costs more than it saves


def matching_cost(source: Leaves, target: Leaves, p: int) -> torch.Tensor:
    """Return |s_i - t_j|^p for all pairs of each leaf, (b, k, k)."""
    return torch.cdist(source, target, compute_mode="donot_use_mm_for_euclid_dist").pow(p)


@torch.no_grad()
def exact_assignment(source: Leaves, target: Leaves, p: int = 1) -> LeafIndex:
    """Match every source point to its own target so that the summed cost |s - t|^p is smallest.

    Args:
        source, target: b leaves of k points each.
        p: Exponent of the cost, 1 or 2.

    Returns:
        phi, (b, k): source i of a leaf is matched to target phi[i] of the same leaf.

    Source: Ma et al. 2023, Eq. 4.

    >>> a = torch.tensor([[[0.0, 0, 0], [1, 0, 0]]])
    >>> exact_assignment(a, a.flip(1)).tolist()
    [[1, 0]]
    """
    costs = matching_cost(source, target, p).cpu().numpy()
    if len(costs) < _PARALLEL_FROM:
        columns = [linear_sum_assignment(cost)[1] for cost in costs]
    else:
        with ThreadPoolExecutor(cpu_count()) as pool:
            columns = list(pool.map(lambda cost: linear_sum_assignment(cost)[1], costs))
    return torch.as_tensor(np.stack(columns), device=source.device)
