"""What is seen at each pixel of a picture of spheres and triangles: numpy only, no display, no GPU.

First every pixel finds the nearest thing that covers it, then normal and colour are computed once a pixel.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_CHUNK = 2_000_000
_DEPTH_BITS = 30


@dataclass
class Seen:
    """Per-pixel surface.

    Attributes:
        covered: (h, w) bool.
        depth: (h, w), pixels, larger nearer; -inf where nothing is.
        normal: (h, w, 3), view coordinates, unit length.
        colour: (h, w, 3), 0 to 1.
    """

    covered: NDArray[np.bool_]
    depth: NDArray[np.float32]
    normal: NDArray[np.float32]
    colour: NDArray[np.float32]

    @classmethod
    def nothing(cls, shape: tuple[int, int]) -> "Seen":
        """Return an empty picture."""
        normal = np.zeros((*shape, 3), np.float32)
        return cls(np.zeros(shape, bool), np.full(shape, -np.inf, np.float32), normal, np.zeros_like(normal))

    def add_triangles(
        self, corners: NDArray[np.float64], normals: NDArray[np.float64], colours: NDArray[np.float64], faces: NDArray
    ) -> None:
        """Draw triangles; what faces away is lit as if it faced the eye.

        Args:
            corners: (v, 3) pixel column, row and depth.
            normals: (v, 3) view coordinates.
            colours: (v, 3).
            faces: (f, 3).
        """
        pixel, face = nearest_triangle(corners, faces, self.covered.shape)
        weights = _barycentric(corners[faces[face], :2], *_centre(pixel, self.covered.shape))
        blend = lambda values: np.einsum("nk,nkc->nc", weights, values[faces[face]])  # noqa: E731
        normal = blend(normals)
        normal = normal * np.where(normal[:, 2:] < 0, -1, 1)
        self._keep(pixel, blend(corners[:, 2:])[:, 0], normal, blend(colours))

    def add_spheres(self, centres: NDArray[np.float64], colours: NDArray[np.float64], radius: float) -> None:
        """Draw spheres: `centres` (n, 3) pixel column, row and depth, `colours` (n, 3), `radius` in pixels."""
        pixel, sphere = nearest_sphere(centres, radius, self.covered.shape)
        column, row = _centre(pixel, self.covered.shape)
        across = np.stack([column, row], axis=1) - centres[sphere, :2]
        towards = np.sqrt(np.maximum(radius**2 - (across**2).sum(axis=1), 0))
        normal = np.column_stack([across[:, 0], -across[:, 1], towards])
        self._keep(pixel, centres[sphere, 2] + towards, normal, colours[sphere])

    def _keep(self, pixel: NDArray, depth: NDArray, normal: NDArray, colour: NDArray) -> None:
        front = depth > self.depth.reshape(-1)[pixel]
        pixel = pixel[front]
        normal = normal[front] / np.maximum(np.linalg.norm(normal[front], axis=1, keepdims=True), 1e-12)
        self.covered.reshape(-1)[pixel] = True
        self.depth.reshape(-1)[pixel] = depth[front]
        self.normal.reshape(-1, 3)[pixel] = normal
        self.colour.reshape(-1, 3)[pixel] = colour[front]


def nearest_triangle(
    corners: NDArray[np.float64], faces: NDArray[np.int64], shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the covered pixels (flat) and the face seen at each.

    Args:
        corners: (v, 3) pixel column, row and depth.
        faces: (f, 3).
        shape: (height, width).
    """
    best = np.full(shape[0] * shape[1], -1, np.int64)
    place, depth = corners[faces, :2], corners[faces, 2]
    limit = np.array([shape[1], shape[0]])
    low = np.clip(np.ceil(place.min(axis=1) - 0.5).astype(np.int64), 0, limit)
    high = np.clip(np.floor(place.max(axis=1) - 0.5).astype(np.int64) + 1, 0, limit)
    span = np.maximum(high - low, 0)
    # A triangle that covers no pixel centre of its bounding box is not seen.
    drawn = np.flatnonzero(span.prod(axis=1))
    if not len(drawn):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    ends = np.cumsum(span[drawn].prod(axis=1))
    for part in np.split(drawn, np.searchsorted(ends, np.arange(_CHUNK, ends[-1], _CHUNK))):
        count = span[part].prod(axis=1)
        owner = np.repeat(part, count)
        step = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
        column = low[owner, 0] + step % span[owner, 0]
        row = low[owner, 1] + step // span[owner, 0]
        weights = _barycentric(place[owner], column + 0.5, row + 0.5)
        inside = (weights >= 0).all(axis=1)
        owner, weights = owner[inside], weights[inside]
        _compete(best, row[inside] * shape[1] + column[inside], (weights * depth[owner]).sum(axis=1), owner, depth)
    return _winners(best)


def nearest_sphere(
    centres: NDArray[np.float64], radius: float, shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the covered pixels (flat) and the sphere seen at each; arguments as in `Seen.add_spheres`."""
    best = np.full(shape[0] * shape[1], -1, np.int64)
    everyone = np.arange(len(centres))
    reach = int(np.ceil(radius))
    bounds = np.array([centres[:, 2].min() - radius, centres[:, 2].max() + radius]) if len(centres) else np.zeros(2)
    for dx in range(-reach, reach + 1):
        for dy in range(-reach, reach + 1):
            cell = np.floor(centres[:, :2]).astype(np.int64) + (dx, dy)
            squared = ((cell + 0.5 - centres[:, :2]) ** 2).sum(axis=1)
            drawn = (squared <= radius**2) & ((cell >= 0) & (cell < (shape[1], shape[0]))).all(axis=1)
            depth = centres[drawn, 2] + np.sqrt(radius**2 - squared[drawn])
            _compete(best, cell[drawn, 1] * shape[1] + cell[drawn, 0], depth, everyone[drawn], bounds)
    return _winners(best)


def _compete(best: NDArray, pixel: NDArray, depth: NDArray, owner: NDArray, bounds: NDArray) -> None:
    """Let candidates compete for their pixels: the key is the depth, then the owner."""
    low, high = bounds.min(), bounds.max()
    level = ((depth - low) / max(high - low, 1e-12) * (2**_DEPTH_BITS - 1)).astype(np.int64)
    np.maximum.at(best, pixel, np.clip(level, 0, 2**_DEPTH_BITS - 1) << 32 | owner)


def _winners(best: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    pixel = np.flatnonzero(best >= 0)
    return pixel, best[pixel] & 0xFFFFFFFF


def _centre(pixel: NDArray[np.int64], shape: tuple[int, int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return pixel % shape[1] + 0.5, pixel // shape[1] + 0.5


def _barycentric(place: NDArray, column: NDArray, row: NDArray) -> NDArray[np.float64]:
    """Return weights (n, 3) of positions in triangles `place` (n, 3, 2); -1 for triangles seen edge-on."""
    (ax, ay), (bx, by), (cx, cy) = (place[:, k].T for k in range(3))
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    flat = np.abs(area) < 1e-12
    safe = np.where(flat, 1.0, area)
    second = ((column - ax) * (cy - ay) - (cx - ax) * (row - ay)) / safe
    third = ((bx - ax) * (row - ay) - (column - ax) * (by - ay)) / safe
    weights = np.stack([1 - second - third, second, third], axis=1)
    weights[flat] = -1
    return weights
