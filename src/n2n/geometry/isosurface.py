"""The zero level set as a triangle mesh, evaluated coarse to fine near the surface only.

Grid positions are integers: corner (i, j, k) lies at lower + voxel * (i, j, k). Cells of size s = 2^level are kept and
split while they may hold the surface; on the finest level marching cubes runs brick by brick over the kept cells, and
the vertices of neighbouring bricks are joined by the grid edge they lie on.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from skimage.measure import marching_cubes
from torch import Tensor

from n2n.errors import SurfaceError

_COARSE_CELLS = 48
_STEEPEST = 2.0  # |grad f| up to which no surface is missed; learned fields are distances only approximately
_BRICK = 32
_CHUNK = 1 << 18
_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_BITS = 21
_CLEARANCE = 1e-4  # voxels; single precision inside a brick resolves 4e-6


@dataclass(frozen=True)
class IsoSurface:
    """A level set.

    Attributes:
        vertices: (v, 3) float64, coordinates of the field.
        faces: (f, 3) int64, counter-clockwise seen from outside (where f is positive).
        evaluations: Field evaluations spent.
        dense_evaluations: What the full grid would have cost.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    evaluations: int
    dense_evaluations: int


def extract(
    field: Callable[[Tensor], Tensor], lower: NDArray[np.float64], upper: NDArray[np.float64], voxel: float
) -> IsoSurface:
    """Extract {f = 0} inside a box; where it leaves the box the mesh is open.

    Args:
        field: (n, 3) float64 positions -> (n,) values, inside negative.
        lower, upper: Corners of the box.
        voxel: Edge of a finest cell, > 0.

    Raises:
        SurfaceError: No zero level set, or NaN values; the message gives the range of f and the likely cause.

    Source: Lewiner et al. 2003 for the cells' triangles (scikit-image).
    """
    lower, upper = np.asarray(lower, float), np.asarray(upper, float)
    cells = np.maximum(np.ceil((upper - lower) / voxel - 1e-9).astype(np.int64), 1)
    levels = max(0, int(np.ceil(np.log2(cells.max() / _COARSE_CELLS))))
    sampler = _Sampler(field, lower, voxel)

    size = 2**levels
    active = np.stack(np.meshgrid(*(np.arange(0, n, size) for n in cells), indexing="ij"), -1).reshape(-1, 3)
    while True:
        values = sampler.at_corners(active, size)
        if size == 2**levels:
            sampler.require_surface(values)
        if size == 1:
            break
        near = np.abs(values).min(axis=1) <= _STEEPEST * 0.5 * np.sqrt(3) * size * voxel
        active = active[near | _changes_sign(values)]
        size //= 2
        active = (active[:, None] + size * _CORNERS).reshape(-1, 3)
        active = active[(active < cells).all(axis=1)]
    active, values = _close(sampler, active, values, cells)
    if not len(active):
        sampler.require_surface(values)
        raise SurfaceError("the field changes sign only outside the box; enlarge the box")
    vertices, faces = _march(active, values)
    return IsoSurface(lower + voxel * vertices, faces, sampler.count, int(np.prod(cells + 1)))


class _Sampler:
    """Evaluate the field at grid corners, each corner of a set of cells once, and remember its range."""

    def __init__(self, field: Callable[[Tensor], Tensor], lower: NDArray[np.float64], voxel: float) -> None:
        self.field, self.lower, self.voxel = field, lower, voxel
        self.count, self.minimum, self.maximum, self.broken = 0, np.inf, -np.inf, 0

    def at_corners(self, cells: NDArray[np.int64], size: int) -> NDArray[np.float64]:
        """Return f at the eight corners of cells given by their lowest corner, (m, 8)."""
        keys, inverse = np.unique(_key(cells[:, None] + size * _CORNERS), return_inverse=True)
        values = np.empty(len(keys))
        for start in range(0, len(keys), _CHUNK):
            positions = self.lower + self.voxel * _unkey(keys[start : start + _CHUNK])
            values[start : start + _CHUNK] = self.field(torch.as_tensor(positions)).double().cpu().numpy()
        self.count += len(keys)
        self.broken += int(np.isnan(values).sum())
        if self.broken:
            raise SurfaceError(
                f"the field is NaN at {self.broken} of {self.count} positions: the fit diverged; "
                "lower optimizer.lr or use recipe=fast"
            )
        if len(values):
            self.minimum, self.maximum = min(self.minimum, values.min()), max(self.maximum, values.max())
        # Values closer to zero would put the vertices of several edges on one corner.
        nearest = _CLEARANCE * self.voxel
        values = np.where(np.abs(values) < nearest, np.where(values < 0, -nearest, nearest), values)
        return values[inverse.reshape(-1, 8)]

    def require_surface(self, values: NDArray[np.float64]) -> None:
        """Explain a level set that cannot exist; a thin one between coarse corners is still possible near zero."""
        if self.minimum < 0 < self.maximum or (len(values) and np.abs(values).min() <= 4 * self.voxel):
            return
        sign, side = ("positive", "outside") if self.minimum > 0 else ("negative", "inside")
        raise SurfaceError(
            f"the field is {sign} everywhere in the box (f from {self.minimum:.3g} to {self.maximum:.3g}), so all of it "
            f"is {side} and there is no surface: the fit has not converged or its sign collapsed; "
            "fit longer (iterations=...) or use recipe=fast"
        )


def _key(corner: NDArray[np.int64]) -> NDArray[np.int64]:
    return (corner[..., 0] << 2 * _BITS) | (corner[..., 1] << _BITS) | corner[..., 2]


def _unkey(key: NDArray[np.int64]) -> NDArray[np.int64]:
    mask = (1 << _BITS) - 1
    return np.stack([key >> 2 * _BITS, (key >> _BITS) & mask, key & mask], axis=-1)


def _changes_sign(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    return (values.min(axis=1) < 0) & (values.max(axis=1) > 0)


def _close(
    sampler: _Sampler, cells: NDArray[np.int64], values: NDArray[np.float64], limit: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Keep the cells with a sign change and add neighbours the surface runs on into, until none is missing.

    Where the field is steeper than assumed the coarse levels may have dropped such a neighbour, which would tear a hole.
    """
    known = _key(cells)
    crossing = _changes_sign(values)
    kept_cells, kept_values = [cells[crossing]], [values[crossing]]
    while len(kept_cells[-1]):
        cells, values = kept_cells[-1], kept_values[-1]
        neighbours = []
        for axis in range(3):
            for side in (0, 1):
                face = values[:, _CORNERS[:, axis] == side]
                step = np.zeros(3, np.int64)
                step[axis] = 2 * side - 1
                neighbours.append(cells[_changes_sign(face)] + step)
        fresh = np.unique(np.concatenate(neighbours), axis=0)
        fresh = fresh[((fresh >= 0) & (fresh < limit)).all(axis=1)]
        fresh = fresh[~np.isin(_key(fresh), known)]
        if not len(fresh):
            break
        known = np.concatenate([known, _key(fresh)])
        fresh_values = sampler.at_corners(fresh, 1)
        crossing = _changes_sign(fresh_values)
        kept_cells.append(fresh[crossing])
        kept_values.append(fresh_values[crossing])
    return np.concatenate(kept_cells), np.concatenate(kept_values)


def _march(cells: NDArray[np.int64], values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangulate cells (m, 3) with corner values (m, 8); vertices in grid units."""
    brick = _key(cells // _BRICK)
    order = np.argsort(brick, kind="stable")
    starts = np.flatnonzero(np.diff(brick[order], prepend=-1))
    all_vertices, all_faces, offset = [], [], 0
    for members in np.split(order, starts[1:]):
        origin = cells[members[0]] // _BRICK * _BRICK
        local = cells[members] - origin
        volume = np.full((_BRICK + 1,) * 3, np.nan)
        mask = np.zeros(volume.shape, bool)
        corner = local[:, None] + _CORNERS
        volume[corner[..., 0], corner[..., 1], corner[..., 2]] = values[members]
        # scikit-image reads the mask at a cell's highest corner.
        mask[local[:, 0] + 1, local[:, 1] + 1, local[:, 2] + 1] = True
        vertices, faces, _, _ = marching_cubes(volume, 0.0, mask=mask, gradient_direction="descent")
        all_vertices.append(vertices.astype(np.float64) + origin)
        all_faces.append(faces.astype(np.int64) + offset)
        offset += len(vertices)
    return _weld(np.concatenate(all_vertices), np.concatenate(all_faces))


def _weld(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Join vertices that lie on the same grid edge: copies made by neighbouring bricks agree to rounding only."""
    corner = np.floor(vertices + 1e-5).astype(np.int64)
    fractional = np.abs(vertices - corner) > 2e-5
    axis = np.where(fractional.sum(axis=1) == 1, fractional.argmax(axis=1), 3)
    # Vertices inside a cell (ambiguous cases) belong to one brick only and stay as they are.
    key = np.where(axis < 3, 3 * _key(corner) + axis, -1 - np.arange(len(vertices)))
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    return vertices[first], inverse[faces]
