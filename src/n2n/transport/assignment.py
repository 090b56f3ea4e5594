"""The exact one-to-one matching phi of Eq. 4, leaf by leaf."""

from concurrent.futures import ThreadPoolExecutor
from os import cpu_count

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment

from n2n.shapes import Coupling, LeafIndex, Leaves
from n2n.transport.batched import batched_assignment

# Costs are held for so many pairs at once, so that a plan of millions of points needs no more memory than a small one.
_PAIRS = 2**22
_GPU_PAIRS = 2**26  # below 1 GB; the more leaves in step, the better
_PARALLEL_FROM = 64  # leaves; below that starting threads costs more than it saves
# Points per CPU core. In step, leaves take about 3 ms * k however few they are: the time in which a core solves that
# many points one leaf after the other. An estimate, from 10 k turns of 300 us; not yet measured on a GPU.
_BATCHED_FROM = 150_000


def matching_cost(source: Leaves, target: Leaves, p: int) -> Coupling:
    """Return |s_i - t_j|^p for all pairs of each leaf, (b, k, k)."""
    return torch.cdist(source, target, compute_mode="donot_use_mm_for_euclid_dist").pow(p)


@torch.no_grad()
def exact_assignment(source: Leaves, target: Leaves, p: int = 1) -> LeafIndex:
    """Match every source point to its own target so that the summed cost |s - t|^p is smallest.

    Leaves are solved one by one by scipy in threads. On an NVIDIA GPU they are solved in step on the GPU if they are
    more than the threads would be done with sooner. Apple's GPUs have no float64: what they hold is solved by scipy.

    Args:
        source, target: b leaves of k points each, on the same device.
        p: Exponent of the cost, 1 or 2.

    Returns:
        phi, (b, k): source i of a leaf is matched to target phi[i] of the same leaf.

    Source: Ma et al. 2023, Eq. 4.

    >>> a = torch.tensor([[[0.0, 0, 0], [1, 0, 0]]])
    >>> exact_assignment(a, a.flip(1)).tolist()
    [[1, 0]]
    """
    count, k, _ = source.shape
    solve, leaves = _in_threads, max(1, _PAIRS // k**2)
    together = min(count, _GPU_PAIRS // k**2)
    if source.is_cuda and together * k >= _BATCHED_FROM * (cpu_count() or 1):
        solve, leaves = batched_assignment, together
    # Filled in place: parts allocated in between would keep the memory of the costs from being used again.
    phi = torch.empty(count, k, dtype=torch.int64, device=source.device)
    for s, t, part in zip(source.split(leaves), target.split(leaves), phi.split(leaves), strict=True):
        part.copy_(solve(matching_cost(s, t, p)))
    return phi


def _in_threads(cost: Coupling) -> LeafIndex:
    """Solve leaf by leaf on the CPU; scipy lets other threads run while it works."""
    costs = cost.cpu().numpy()
    workers = cpu_count() or 1
    if workers == 1 or len(costs) < _PARALLEL_FROM:
        columns = _one_by_one(costs)
    else:
        # Some leaves for each call, as handing over a single one costs a fifth of its solution; several calls for
        # each thread, so that none waits long for the last.
        groups = np.array_split(costs, min(len(costs), 4 * workers))
        with ThreadPoolExecutor(workers) as pool:
            columns = np.concatenate(list(pool.map(_one_by_one, groups)))
    return torch.as_tensor(columns, device=cost.device)


def _one_by_one(costs: np.ndarray) -> np.ndarray:
    return np.array([linear_sum_assignment(cost)[1] for cost in costs], dtype=np.int64)
