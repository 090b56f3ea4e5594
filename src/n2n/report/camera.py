"""Where pictures are taken from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_MARGIN = 1.10
_SLIMMEST = 0.55  # short side of a picture / long side


@dataclass(frozen=True)
class Camera:
    """An orthographic camera.

    Attributes:
        rotation: (3, 3) world -> view; view x right, y up, z towards the eye.
        centre: World position shown in the middle.
        extent: (width, height) shown, world units.
        up: (3,) world direction that points up.
        ground: Height along `up` of the plane that catches shadows.
    """

    rotation: NDArray[np.float64]
    centre: NDArray[np.float64]
    extent: tuple[float, float]
    up: NDArray[np.float64]
    ground: float

    @classmethod
    def around(
        cls, points: NDArray[np.float64], azimuth: float = 35.0, elevation: float = 25.0, up: int = 2
    ) -> "Camera":
        """Frame points tightly.

        Args:
            points: (n, 3); a few outliers do not widen the view.
            azimuth, elevation: Degrees.
            up: World axis that points up.
        """
        a, e = np.radians(azimuth), np.radians(elevation)
        axes = {2: [0, 1, 2], 1: [2, 0, 1], 0: [1, 2, 0]}[up]
        eye, right = np.zeros(3), np.zeros(3)
        eye[axes] = np.cos(e) * np.sin(a), -np.cos(e) * np.cos(a), np.sin(e)
        right[axes] = np.cos(a), np.sin(a), 0
        rotation = np.stack([right, np.cross(eye, right), eye])
        low, high = np.quantile(points, [0.002, 0.998], axis=0)
        slack = 0.02 * np.linalg.norm(high - low)
        inner = points[((points >= low - slack) & (points <= high + slack)).all(axis=1)]
        view = inner @ rotation.T
        low, high = view.min(axis=0), view.max(axis=0)
        size = (high - low)[:2]
        width, height = np.maximum(size, max(_SLIMMEST * size.max(), 1e-9)) * _MARGIN
        ground = float(inner[:, up].min())
        return cls(rotation, (low + high) / 2 @ rotation, (float(width), float(height)), np.eye(3)[up], ground)

    def shape(self, size: int) -> tuple[int, int]:
        """Return (height, width) in pixels of a picture whose longer side has `size`."""
        width, height = self.extent
        scale = size / max(width, height)
        return max(1, round(scale * height)), max(1, round(scale * width))

    def project(self, points: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.float64]:
        """Return (n, 3): pixel column, pixel row and depth in pixels, larger nearer."""
        view = (points - self.centre) @ self.rotation.T
        scale = shape[1] / self.extent[0]
        return scale * view * [1, -1, 1] + [shape[1] / 2, shape[0] / 2, 0]

    def on_ground(self, points: NDArray[np.float64], light: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return where the shadow of points falls; `light` (3,) points to the light, view coordinates."""
        direction = light @ self.rotation
        height = points @ self.up - self.ground
        return points - (height / (direction @ self.up))[:, None] * direction
