"""Which subsets of two clouds are matched with each other."""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from n2n.shapes import LeafIndex, Points

_AXIS_JITTER = 0.3  # relative; neighbouring leaves get different borders every time


class GlobalPairing:
    """The paper's batches: B random queries against B random targets, matched as one leaf.

    Args:
        batch_size: B, >= 1; fewer where a cloud has fewer points.

    Source: Ma et al. 2023, Sec. 3, More Details.
    """

    def __init__(self, batch_size: int) -> None:
        self.batch_size = batch_size

    def __call__(
        self, queries: Points, targets: Float[Tensor, "m 3"], generator: torch.Generator, same: bool = False
    ) -> tuple[LeafIndex, LeafIndex]:
        """Draw the subsets, always independently; see `StratifiedPairing.__call__`."""
        size = min(self.batch_size, len(queries), len(targets))
        first = _draw(len(queries), size, generator, queries.device)
        return first[None], _draw(len(targets), size, generator, targets.device)[None]


class StratifiedPairing:
    """Balanced median cuts that split queries and targets alike into small leaves.

    Both clouds are halved at their own median along the same axis, again and again, so a leaf holds as many queries as
    targets from the same part of the surface. Matching inside the leaves is still one-to-one between the two draws, but
    its cost is a sum of small assignments and its variance that of the local spacing, not of the whole shape.

    Args:
        batch_size: Points drawn from each cloud, rounded down to a multiple of the number of leaves 2^d.
        leaf_size: Least points per leaf and side, >= 1; leaves hold fewer than twice as many.
    """

    def __init__(self, batch_size: int, leaf_size: int = 64) -> None:
        if leaf_size < 1:
            raise ValueError(f"leaf_size must be at least 1, got {leaf_size}")
        self.batch_size, self.leaf_size = batch_size, leaf_size

    def __call__(
        self, queries: Points, targets: Float[Tensor, "m 3"], generator: torch.Generator, same: bool = False
    ) -> tuple[LeafIndex, LeafIndex]:
        """Draw subsets and split them.

        Args:
            queries, targets: The two clouds, unit coordinates; the counts may differ.
            generator: CPU generator; equal states give equal draws.
            same: Query k was made from target k (one noisy cloud, N = 1): draw the same rows of both and cut once, so
                that a leaf holds exactly the targets its queries came from.

        Returns:
            Indices into queries and targets, (leaves, points per leaf) each.
        """
        size = min(self.batch_size, len(queries), len(targets))
        depth = max(0, int(math.log2(size / self.leaf_size)))
        # Leaves grow to less than twice their size rather than leave points out: every point carries information.
        size = (size >> depth) << depth
        second = _draw(len(targets), size, generator, targets.device)[None]
        first = second if same else _draw(len(queries), size, generator, queries.device)[None]
        for _ in range(depth):
            spread = targets[second].std(dim=1)
            jitter = torch.randn(spread.shape, generator=generator).to(spread)
            axis = (spread * (1 + _AXIS_JITTER * jitter)).argmax(dim=1)
            second = _halve(targets, second, axis)
            first = second if same else _halve(queries, first, axis)
        return first, second


def _draw(count: int, size: int, generator: torch.Generator, device: torch.device) -> Tensor:
    return torch.randperm(count, generator=generator)[:size].to(device)


def _halve(points: Points, index: LeafIndex, axis: Tensor) -> Tensor:
    """Split every node (row) at the median of its own axis: (b, k) -> (2b, k / 2)."""
    coordinate = points[index].gather(2, axis[:, None, None].expand(-1, index.shape[1], 1)).squeeze(2)
    ordered = index.gather(1, coordinate.argsort(dim=1, stable=True))
    return ordered.reshape(-1, index.shape[1] // 2)
