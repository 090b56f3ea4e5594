"""A small z-buffer renderer: points as discs, triangles with two lights; numpy only, no display, no GPU."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_KEY_LIGHT = np.array([0.35, 0.65, 0.75]) / np.linalg.norm([0.35, 0.65, 0.75])
_FILL_LIGHT = np.array([-0.7, 0.1, 0.5]) / np.linalg.norm([-0.7, 0.1, 0.5])
BACKGROUND = np.array([1.0, 1.0, 1.0])
_SPLIT_PIXELS = 24


@dataclass(frozen=True)
class Camera:
    """An orthographic camera.

    Attributes:
        rotation: (3, 3) world -> view; view x right, y up, z towards the eye.
        centre: World position shown in the middle.
        extent: World length shown along the shorter image side.
    """

    rotation: NDArray[np.float64]
    centre: NDArray[np.float64]
    extent: float

    @classmethod
    def around(cls, points: NDArray[np.float64], azimuth: float = 35.0, elevation: float = 25.0, up: int = 2) -> "Camera":
        """Look at the points from an angle (degrees); `up` is the world axis that points up."""
        a, e = np.radians(azimuth), np.radians(elevation)
        order = {2: [0, 1, 2], 1: [2, 0, 1], 0: [1, 2, 0]}[up]
        eye = np.zeros(3)
        eye[order] = [np.cos(e) * np.sin(a), -np.cos(e) * np.cos(a), np.sin(e)]
        right = np.zeros(3)
        right[order] = [np.cos(a), np.sin(a), 0]
        rotation = np.stack([right, np.cross(eye, right), eye])
        low, high = np.quantile(points, [0.002, 0.998], axis=0)
        inner = points[((points >= low) & (points <= high)).all(axis=1)]
        view = inner @ rotation.T
        middle = (view.min(axis=0) + view.max(axis=0)) / 2
        return cls(rotation, middle @ rotation, 1.08 * float(np.ptp(view[:, :2], axis=0).max()))

    def project(self, points: NDArray[np.float64], size: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return pixel coordinates (n, 2) of a size x size image and depth (n,), larger nearer."""
        view = (points - self.centre) @ self.rotation.T
        scale = size / self.extent
        return np.stack([size / 2 + scale * view[:, 0], size / 2 - scale * view[:, 1]], axis=1), view[:, 2]


class Canvas:
    """A square image with a depth buffer, drawn twice as large and averaged down.

    Args:
        size: Pixels of the final image's side.
        camera: Shared by everything drawn.
    """

    def __init__(self, size: int, camera: Camera) -> None:
        self.camera, self.size, self._side = camera, size, 2 * size
        self._depth = np.full(self._side**2, -np.inf)
        self._colour = np.tile(BACKGROUND, (self._side**2, 1))

    def points(self, points: NDArray[np.float64], colour: NDArray[np.float64], radius: float = 1.6) -> None:
        """Draw discs; `colour` is (3,) or (n, 3) in 0..1, `radius` in final pixels. Nearer discs are darker at their rim."""
        pixel, depth = self.camera.project(points, self._side)
        colour = np.broadcast_to(colour, (len(points), 3))
        reach = int(np.ceil(2 * radius))
        near = (depth - depth.min()) / max(np.ptp(depth), 1e-12)
        colour = colour * (0.55 + 0.45 * near[:, None]) + 0.25 * (1 - near[:, None])
        for dx in range(-reach, reach + 1):
            for dy in range(-reach, reach + 1):
                distance = np.hypot(dx, dy) / (2 * radius)
                if distance <= 1:
                    shade = 1 - 0.35 * distance**2
                    self._write(np.floor(pixel).astype(int) + (dx, dy), depth, colour * shade)

    def mesh(self, vertices: NDArray[np.float64], faces: NDArray[np.int64], colour: NDArray[np.float64]) -> None:
        """Draw triangles with smooth normals; `colour` is (3,) or per vertex (v, 3)."""
        pixel, depth = self.camera.project(vertices, self._side)
        shaded = np.broadcast_to(colour, (len(vertices), 3)) * _shade(vertices, faces, self.camera.rotation)[:, None]
        shaded = np.clip(shaded, 0, 1)
        corner, z, tint = pixel[faces], depth[faces], shaded[faces]
        span = np.ceil(np.ptp(corner, axis=1).max(axis=1)).astype(int) + 1
        # Triangles of similar size share one sampling pattern: a barycentric grid fine enough to leave no gap.
        for steps in np.unique(np.minimum(2 ** np.ceil(np.log2(np.maximum(span, 1))).astype(int), 512)):
            members = np.flatnonzero(np.minimum(2 ** np.ceil(np.log2(np.maximum(span, 1))).astype(int), 512) == steps)
            count = int(steps) + 1
            u, v = np.meshgrid(np.arange(count + 1) / count, np.arange(count + 1) / count, indexing="ij")
            inside = u + v <= 1 + 1e-9
            weights = np.stack([1 - u[inside] - v[inside], u[inside], v[inside]], axis=1)
            chunk = max(1, 2_000_000 // len(weights))
            for start in range(0, len(members), chunk):
                part = members[start : start + chunk]
                blend = lambda values, part=part, weights=weights: np.einsum("wk,fk...->fw...", weights, values[part])  # noqa: E731
                place, nearer, hue = blend(corner), blend(z), blend(tint)
                self._write(np.floor(place.reshape(-1, 2)).astype(int), nearer.reshape(-1), hue.reshape(-1, 3))

    def image(self) -> NDArray[np.uint8]:
        """Return the picture, (size, size, 3)."""
        big = self._colour.reshape(self._side, self._side, 3)
        small = big.reshape(self.size, 2, self.size, 2, 3).mean(axis=(1, 3))
        return (255 * np.clip(small, 0, 1)).round().astype(np.uint8)

    def _write(self, pixel: NDArray[np.int64], depth: NDArray[np.float64], colour: NDArray[np.float64]) -> None:
        """Keep the nearest sample of every pixel."""
        visible = ((pixel >= 0) & (pixel < self._side)).all(axis=1)
        flat = pixel[visible, 1] * self._side + pixel[visible, 0]
        depth, colour = depth[visible], colour[visible]
        front = depth > self._depth[flat]
        flat, depth, colour = flat[front], depth[front], colour[front]
        order = np.argsort(depth, kind="stable")
        # Later assignments win, so the nearest sample of a pixel must come last.
        self._depth[flat[order]] = depth[order]
        self._colour[flat[order]] = colour[order]


def _shade(vertices: NDArray[np.float64], faces: NDArray[np.int64], rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return brightness per vertex from two lights in view space; the back of a sheet is lit like its front."""
    corner = vertices[faces]
    face_normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal = np.zeros_like(vertices)
    for k in range(3):
        for axis in range(3):
            normal[:, axis] += np.bincount(faces[:, k], weights=face_normal[:, axis], minlength=len(vertices))
    normal = normal @ rotation.T
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    normal *= np.where(normal[:, 2:] < 0, -1, 1)
    key, fill = np.clip(normal @ _KEY_LIGHT, 0, 1), np.clip(normal @ _FILL_LIGHT, 0, 1)
    highlight = np.clip(normal @ (_KEY_LIGHT + [0, 0, 1]) / np.linalg.norm(_KEY_LIGHT + [0, 0, 1]), 0, 1) ** 40
    return 0.28 + 0.62 * key + 0.22 * fill + 0.18 * highlight
