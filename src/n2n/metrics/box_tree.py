"""A tree of boxes around points or triangles, searched for many queries at once.

Depth first, in blocks of pairs (query, node): numpy does the work, memory stays bounded, and what one block finds
shortens the search of the next. Nothing is approximated: a node is left out only if its box is farther away than an
item already found.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_PAIRS = 1 << 15  # per block: its arrays stay in the cache


class BoxTree:
    """Boxes of items, halved along their longest side twice per level.

    Args:
        lower, upper: Corners of the items' boxes, (3, n) each.
    """

    def __init__(self, lower: Array, upper: Array) -> None:
        count = lower.shape[1]
        inner = next(depth for depth in range(32) if 4 ** (depth + 1) >= count)
        leaf = -(-count // 4**inner)  # one to four items
        self.depth, self.branches = inner + 1, [4] * inner + [leaf]
        order = _halved((lower + upper) / 2, 2 * inner, leaf)
        there = order < count
        self.items = np.where(there, order, 0)
        # Places without an item are boxes nothing is near to.
        self.lower = [np.where(there, lower[:, self.items], np.inf)]
        self.upper = [np.where(there, upper[:, self.items], -np.inf)]
        for branches in reversed(self.branches):
            self.lower.insert(0, np.minimum.reduce(_split(self.lower[0], branches)))
            self.upper.insert(0, np.maximum.reduce(_split(self.upper[0], branches)))

    def nearest(
        self, lower: Array, upper: Array, first: Index, squared: Callable[[Index, Index], Array]
    ) -> tuple[Array, Index]:
        """Find the nearest item of every query.

        Args:
            lower, upper: Corners of the queries' boxes, (3, m) each.
            first: An item for every query to begin with, (m,); the nearer, the faster.
            squared: Maps indices of queries and of items, (k,) each, to their squared distances (k,).

        Returns:
            Squared distances (m,) and items (m,).
        """
        query = np.arange(lower.shape[1])
        distance, item = _in_parts(squared, query, first), first.copy()
        stack = [(0, query, np.zeros(len(query), np.int64))]
        while stack:
            level, query, node = stack.pop()
            if len(query) > _PAIRS:
                for start in range(0, len(query), _PAIRS):
                    stack.append((level, query[start : start + _PAIRS], node[start : start + _PAIRS]))
                continue
            if level == self.depth:
                found = self.items[node]
                _keep_nearest(query, found, squared(query, found), distance, item)
                continue
            gap = self._gap(level, node, lower[:, query], upper[:, query])
            row, child = np.nonzero(gap < distance[query][:, None])
            if len(row):
                stack.append((level + 1, query[row], self.branches[level] * node[row] + child))
        return distance, item

    def _gap(self, level: int, node: Index, lower: Array, upper: Array) -> Array:
        """Return the squared distances (k, branches) of queries' boxes (3, k) to the children of their nodes."""
        branches = self.branches[level]
        total = np.zeros((len(node), branches))
        for axis in range(3):
            gap = self.lower[level + 1][axis].reshape(-1, branches)[node] - upper[axis][:, None]
            np.maximum(gap, lower[axis][:, None] - self.upper[level + 1][axis].reshape(-1, branches)[node], out=gap)
            np.maximum(gap, 0, out=gap)
            gap *= gap
            total += gap
        return total


def _in_parts(squared: Callable[[Index, Index], Array], query: Index, item: Index) -> Array:
    parts = range(0, len(query), _PAIRS)
    return np.concatenate([squared(query[start : start + _PAIRS], item[start : start + _PAIRS]) for start in parts])


def _split(values: Array, size: int) -> Array:
    """Return (3, n) values as (size, 3, n / size), groups of neighbours: minima over the first axis are quick."""
    return np.ascontiguousarray(values.reshape(3, -1, size).transpose(2, 0, 1))


def _halved(centres: Array, levels: int, leaf: int) -> Index:
    """Return an order of (3, n) centres in which every half, quarter ... is compact; indices >= n fill it up."""
    size = leaf * 2**levels
    # NaN, which partitions put last, stands for nothing.
    centres = np.concatenate([centres, np.full((3, size - centres.shape[1]), np.nan)], axis=1)
    order = np.arange(size)
    for level in range(levels):
        width = size >> level
        groups = _split(centres[:, order], width)
        axis = (np.fmax.reduce(groups) - np.fmin.reduce(groups)).argmax(axis=0)
        order = order.reshape(-1, width)
        half = np.argpartition(centres[axis[:, None], order], width // 2, axis=1)
        order = np.take_along_axis(order, half, axis=1).ravel()
    return order


def _keep_nearest(query: Index, found: Index, squared: Array, distance: Array, item: Index) -> None:
    """Update distances and items by pairs whose queries ascend."""
    if not len(query):
        return
    start = np.flatnonzero(np.diff(query, prepend=-1))
    smallest = np.minimum.reduceat(squared, start)
    size = np.diff(start, append=len(query))
    place = np.where(squared == np.repeat(smallest, size), np.arange(len(query)), len(query))
    place, who = np.minimum.reduceat(place, start), query[start]
    closer = smallest < distance[who]
    distance[who[closer]], item[who[closer]] = smallest[closer], found[place[closer]]
