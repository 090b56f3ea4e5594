"""A field on the corners of a grid of which only a thin band is ever looked at.

Corner (i, j, k) lies at lower + voxel * (i, j, k). A cell is named by its lowest corner and its size in voxels.
"""

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from n2n.errors import SurfaceError

# Corner offsets of a cell, and of the 27 corners its eight children share.
CORNERS = np.stack(np.meshgrid(*[(0, 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
_BLOCK = np.stack(np.meshgrid(*[(0, 1, 2)] * 3, indexing="ij"), -1).reshape(-1, 3)
_CHILD_CORNERS = (CORNERS[:, None] + CORNERS) @ (9, 3, 1)

_BITS = 20  # an edge key, corner and axis, fits in 62 bits
# The paper's network keeps 512 activations a point: 128 MB a layer.
_CHUNK = 1 << 16


class SparseGrid:
    """Evaluate a field at grid corners, each corner once.

    Args:
        field: (n, 3) float64 positions -> (n,) values.
        lower: Position of corner (0, 0, 0).
        voxel: Distance of neighbouring corners.
        cells: (3,) cells along each axis; no corner beyond is evaluated.
        iso: Subtracted from every value.
    """

    def __init__(
        self,
        field: Callable[[Tensor], Tensor],
        lower: NDArray[np.float64],
        voxel: float,
        cells: NDArray[np.int64],
        iso: float = 0.0,
    ) -> None:
        self.lower, self.voxel, self.cells = lower, voxel, cells
        self.evaluations = 0
        self._field, self._iso = field, iso
        self._keys = np.empty(0, np.int64)
        self._values = np.empty(0)

    def at(self, corners: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return values at corners (..., 3), moved into the grid first; shape (...)."""
        keys = key(np.minimum(corners, self.cells))
        fresh = _distinct(keys)
        if len(self._keys):
            place = np.minimum(np.searchsorted(self._keys, fresh), len(self._keys) - 1)
            fresh = fresh[self._keys[place] != fresh]
        if len(fresh):
            values = self.evaluate(unkey(fresh))
            self._keys = np.concatenate([self._keys, fresh])
            order = np.argsort(self._keys, kind="stable")
            self._keys, self._values = self._keys[order], np.concatenate([self._values, values])[order]
        return self._values[np.searchsorted(self._keys, keys)]

    def evaluate(self, positions: NDArray[np.number]) -> NDArray[np.float64]:
        """Return values at positions (n, 3) in voxels, which need not be corners.

        Raises:
            SurfaceError: A value is NaN or infinite.
        """
        values = np.empty(len(positions))
        with torch.no_grad():
            for start in range(0, len(positions), _CHUNK):
                part = torch.as_tensor(self.world(positions[start : start + _CHUNK]))
                values[start : start + _CHUNK] = self._field(part).cpu().double().numpy()
        self.evaluations += len(positions)
        broken = ~np.isfinite(values)
        if broken.any():
            raise SurfaceError(
                f"the field is NaN or infinite at {broken.sum()} of {len(values)} positions, "
                f"the first at {triple(self.world(positions[broken.argmax()]))}: the fit diverged; "
                "lower optimizer.lr or use recipe=fast"
            )
        return values - self._iso

    def world(self, positions: NDArray[np.number]) -> NDArray[np.float64]:
        """Voxels -> coordinates of the field."""
        return self.lower + self.voxel * positions

    def extremes(self) -> tuple[float, NDArray[np.float64], float, NDArray[np.float64]]:
        """Return the smallest value seen at a corner and its position, then the largest."""
        low, high = int(self._values.argmin()), int(self._values.argmax())
        where = self.world(unkey(self._keys[[low, high]]))
        return float(self._values[low]), where[0], float(self._values[high]), where[1]

    def coarse(self, size: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return all cells of a size, (m, 3), and their corner values, (m, 8)."""
        cells = np.stack(np.meshgrid(*(np.arange(0, n, size) for n in self.cells), indexing="ij"), -1).reshape(-1, 3)
        return cells, self.at(cells[:, None] + size * CORNERS)

    def split(self, cells: NDArray[np.int64], half: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the children, of size `half`, of cells, and their corner values."""
        block = self.at(cells[:, None] + half * _BLOCK)
        children = (cells[:, None] + half * CORNERS).reshape(-1, 3)
        inside = (children < self.cells).all(axis=1)
        return children[inside], block[:, _CHILD_CORNERS].reshape(-1, 8)[inside]


def key(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Name each corner (..., 3) by one integer that sorts like (i, j, k)."""
    return (corners[..., 0] << 2 * _BITS) | (corners[..., 1] << _BITS) | corners[..., 2]


def unkey(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """Inverse of `key`."""
    mask = (1 << _BITS) - 1
    return np.stack([keys >> 2 * _BITS, (keys >> _BITS) & mask, keys & mask], axis=-1)


def _distinct(keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return sorted keys without repetitions: `np.unique` is four times slower on keys in nearly sorted runs."""
    keys = np.sort(keys, axis=None)
    return keys[np.flatnonzero(np.diff(keys, prepend=-1))]


def changes_sign(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which rows hold a negative and a non-negative value: zero counts as outside."""
    negative = values < 0
    return negative.any(axis=1) & ~negative.all(axis=1)


def triple(position: NDArray[np.float64], digits: int = 3) -> str:
    """Write a position for a message."""
    return "(" + ", ".join(f"{x:.{digits}g}" for x in position) + ")"
