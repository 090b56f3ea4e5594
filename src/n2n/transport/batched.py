"""Exact assignment of all leaves at once, in plain torch: for GPUs, where a loop over leaves is slow."""

import torch
from torch import Tensor

from n2n.shapes import Coupling, LeafIndex

_PEEK_EVERY = 16  # turns; looking whether all is done makes the CPU wait for the GPU


@torch.no_grad()
def batched_assignment(cost: Coupling) -> LeafIndex:
    """Assign rows to columns, one to one, so that the summed cost of each leaf is smallest.

    Shortest augmenting paths, the method of `scipy.optimize.linear_sum_assignment`, with all leaves in step: in one
    turn every leaf settles one more column of its search, or moves one edge of the path it found into the matching.
    Exact for costs of any scale and for ties: the sum of a leaf exceeds the smallest only by what float64 rounds off
    in adding its costs. At most k^2 turns whatever the costs, 10 to 20 k for random leaves; a turn is some forty small
    operations over (b, k). Memory: a float64 copy of `cost`.

    Args:
        cost: Finite costs in any unit, on a device that has float64.

    Returns:
        Column of each row, (b, k).

    Raises:
        ValueError: A cost is infinite or not a number.

    Source: Jonker and Volgenant 1987; Crouse 2016, On implementing 2D rectangular assignment algorithms. An auction
        (Bertsekas 1988) was tried: up to 10 times as many turns where costs tie, and exact for rounded costs only.

    >>> batched_assignment(torch.tensor([[[1.0, 2.0], [0.0, 4.0]]])).tolist()
    [[1, 0]]
    """
    if not cost.isfinite().all():
        raise ValueError("costs must be finite")
    count, k, _ = cost.shape
    cost = cost.to(torch.float64, copy=True)
    cost -= cost.amin(dim=2, keepdim=True)
    cost -= cost.amin(dim=1, keepdim=True)
    leaf = torch.arange(count, device=cost.device)
    column_of, row_of = _first_claims(cost)
    price = torch.zeros_like(cost[:, 0])  # of the columns: what a row has is the cheapest it could have, price deducted
    row = _first(column_of < 0)  # where the search of the leaf is,
    column = torch.zeros_like(row)  # by which column it came there (any, where it starts),
    length = torch.zeros_like(price[:, 0])  # and how long the path was
    distance = torch.full_like(price, torch.inf)  # of the columns from the start of the search
    via = torch.zeros_like(row_of)  # the row before each column
    settled = torch.zeros_like(row_of, dtype=torch.bool)
    moving = torch.zeros_like(row, dtype=torch.bool)  # the search is over, its path is being moved into the matching
    for turn in range(k * k):
        if turn % _PEEK_EVERY == 0 and (column_of >= 0).all():
            break
        # Search: on from `row`, to the nearest column not yet settled. In leaves that are moving or done the outcome is
        # ignored (`row` may be -1), and `via` stays as it was on the path, as all of its columns are settled.
        reduced = cost[leaf, row] - price
        reach = reduced + (length - _at(reduced, column))[:, None]
        nearer = (reach < distance) & ~settled
        distance = reach.where(nearer, distance)
        via = row[:, None].where(nearer, via)
        ahead = distance.masked_fill(settled, torch.inf)
        length = ahead.amin(dim=1)
        tied = ahead == length[:, None]
        # An unmatched column among equals ends the search.
        column = column.where(moving, (tied.int() + (tied & (row_of < 0))).argmax(dim=1))
        settled = settled.scatter(1, column[:, None], True)
        row = _at(row_of, column)
        found = (row < 0) & ~moving
        price += (distance - length[:, None]).where(settled & found[:, None], 0)
        moving |= found
        # Move: give the column to the row before it on the path, and go on with the column that row had.
        giver = _at(via, column)
        left = _at(column_of, giver)
        row_of = row_of.scatter(1, column[:, None], giver[:, None]).where(moving[:, None], row_of)
        column_of = column_of.scatter(1, giver[:, None], column[:, None]).where(moving[:, None], column_of)
        column = left.clamp_min(0).where(moving, column)
        # The row without a column was the start of the path: search from the next such row.
        start = moving & (left < 0)
        moving &= ~start
        row = _first(column_of < 0).where(start, row)
        length = length.masked_fill(start, 0)
        distance = distance.masked_fill(start[:, None], torch.inf)
        settled &= ~start[:, None]
    return column_of


def _first_claims(cost: Tensor) -> tuple[Tensor, Tensor]:
    """Give every column to the last of the rows it is cheapest for; return column of row and row of column, or -1."""
    wish = cost.argmin(dim=2)
    asking = torch.arange(wish.shape[1], device=cost.device).expand_as(wish)
    row_of = torch.full_like(wish, -1).scatter_reduce(1, wish, asking, "amax")
    return wish.where(row_of.gather(1, wish) == asking, -1), row_of


def _first(mask: Tensor) -> Tensor:
    return mask.int().argmax(dim=1)


def _at(values: Tensor, index: Tensor) -> Tensor:
    return values.gather(1, index[:, None]).squeeze(1)
