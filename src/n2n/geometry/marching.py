"""Marching cubes over a list of cells: topology from scikit-image, vertex positions in double precision."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from skimage.measure import marching_cubes

from n2n.geometry.sparse_grid import CORNERS, SparseGrid, key

_BRICK = 8  # cells along a brick's side
_TILE = 16  # bricks along a tile's side; coordinates up to 144 leave single precision 8e-6
# Corner values handed to scikit-image keep to this range around the median: crossings lie 1e-3 or more from corners, so
# the edge of each can be read off. Their true place is computed afterwards.
_RANGE = (0.02, 19.0)
_NEAR_CORNER = 2e-4
_CLEARANCE = 1e-4  # of an edge: vertices of several edges do not meet in one corner


def march(
    grid: SparseGrid, cells: NDArray[np.int64], values: NDArray[np.float64], polish: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangulate unit cells that the surface crosses.

    Args:
        grid: Gives the values at the ends of grid edges.
        cells: (m, 3) lowest corners.
        values: (m, 8) corner values, in the order of `CORNERS`.
        polish: Steps of false position that move each vertex along its grid edge onto the zero set.

    Returns:
        (v, 3) vertices in voxels, each once, and (f, 3) faces, counter-clockwise seen from the positive side.

    Source: Lewiner et al. 2003 (scikit-image).
    """
    values = _tame(values)
    vertices, faces, offset = [], [], 0
    bricks, member = np.unique(key(cells // _BRICK), return_inverse=True)
    order = np.argsort(member, kind="stable")
    first = np.searchsorted(member[order], np.arange(0, len(bricks) + _TILE**3, _TILE**3))
    for start, stop in pairwise(first):
        chosen = order[start:stop]
        part, triangles = _march_tile(cells[chosen], values[chosen], member[chosen] - member[chosen[0]])
        vertices.append(part)
        faces.append(triangles + offset)
        offset += len(part)
    return _weld(grid, np.concatenate(vertices), np.concatenate(faces), polish)


def _tame(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Limit the ratio between corner values, the same way in every cell, signs kept."""
    size = np.abs(values)
    typical = np.median(size[size > 0])
    return np.copysign(np.clip(size / typical, *_RANGE), np.where(values < 0, -1, 1)).astype(np.float32)


def _march_tile(
    cells: NDArray[np.int64], values: NDArray[np.float32], brick: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Run marching cubes once over many small bricks packed into one volume; vertices in voxels."""
    stride = _BRICK + 1
    side = int(np.ceil((brick.max() + 1) ** (1 / 3)))
    packed = np.stack(np.unravel_index(np.arange(side**3), (side,) * 3), axis=-1) * stride
    origin = np.zeros((side**3, 3), np.int64)
    origin[brick] = cells // _BRICK * _BRICK
    local = cells % _BRICK + packed[brick]

    volume = np.ones((side * stride,) * 3, np.float32)
    mask = np.zeros(volume.shape, bool)
    corner = local[:, None] + CORNERS
    volume[corner[..., 0], corner[..., 1], corner[..., 2]] = values
    # scikit-image reads the mask at a cell's highest corner.
    mask[local[:, 0] + 1, local[:, 1] + 1, local[:, 2] + 1] = True
    vertices, faces, _, _ = marching_cubes(volume, 0.0, mask=mask, gradient_direction="descent")
    at = np.floor(vertices + _NEAR_CORNER).astype(np.int64) // stride
    at = np.ravel_multi_index(tuple(at.T), (side,) * 3)
    return vertices.astype(np.float64) - packed[at] + origin[at], faces.astype(np.int64)


def _weld(
    grid: SparseGrid, vertices: NDArray[np.float64], faces: NDArray[np.int64], polish: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Join the copies of a vertex that neighbouring bricks made, and put it where the field is zero on its edge."""
    corner = np.floor(vertices + _NEAR_CORNER).astype(np.int64)
    moving = vertices - corner > _NEAR_CORNER
    # Ambiguous cells may hold a vertex in their middle; it has no copies.
    on_edge = moving.sum(axis=1) == 1
    axis = moving.argmax(axis=1)
    edge = np.where(on_edge, (key(corner) << 2) | axis, -1 - np.arange(len(vertices)))
    _, first, inverse = np.unique(edge, return_index=True, return_inverse=True)
    vertices, corner, axis, on_edge = vertices[first], corner[first], axis[first], on_edge[first]

    direction = np.eye(3, dtype=np.int64)[axis[on_edge]]
    vertices[on_edge] = corner[on_edge] + _crossing(grid, corner[on_edge], direction, polish)[:, None] * direction
    return vertices, inverse[faces]


def _crossing(
    grid: SparseGrid, corner: NDArray[np.int64], direction: NDArray[np.int64], polish: int
) -> NDArray[np.float64]:
    """Return where between the ends of grid edges the field is zero, 0 to 1: linear, then false position."""
    low, high = np.zeros(len(corner)), np.ones(len(corner))
    at_low, at_high = grid.at(corner), grid.at(corner + direction)
    for _ in range(polish):
        middle = low + (high - low) * at_low / (at_low - at_high)
        value = grid.evaluate(corner + middle[:, None] * direction)
        left = (value < 0) == (at_low < 0)
        low, at_low = np.where(left, middle, low), np.where(left, value, at_low)
        high, at_high = np.where(left, high, middle), np.where(left, at_high, value)
    return np.clip(low + (high - low) * at_low / (at_low - at_high), _CLEARANCE, 1 - _CLEARANCE)
