"""Plane cuts through a field, a mesh and a cloud."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from n2n.report.figures.style import FAINT, INK

_MARGIN = 0.08  # of the longer side


@dataclass(frozen=True)
class Slice:
    """A window of a plane across one axis.

    Attributes:
        axis: The plane's normal, 0 to 2.
        level: Where the plane cuts that axis.
        low, high: Corners of the window, (2,) each, in the two other axes.
    """

    axis: int
    level: float
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @classmethod
    def through(cls, points: NDArray[np.float64], axis: int) -> "Slice":
        """Cut the middle of the box of points, with a margin around them."""
        low, high = points.min(axis=0), points.max(axis=0)
        inside = _others(axis)
        margin = _MARGIN * (high - low)[inside].max()
        return cls(axis, float(low[axis] + high[axis]) / 2, low[inside] - margin, high[inside] + margin)

    @property
    def aspect(self) -> float:
        """Width / height."""
        width, height = self.high - self.low
        return float(width / height)

    def around(self, centre: NDArray[np.float64], half: float) -> "Slice":
        """Return a square window of the same plane."""
        return Slice(self.axis, self.level, centre - half, centre + half)

    def flat(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the plane's coordinates (n, 2) of points."""
        return points[:, _others(self.axis)]

    def near(self, points: NDArray[np.float64], reach: float) -> NDArray[np.bool_]:
        """Tell which points (n,) lie within `reach` of the plane."""
        return np.abs(points[:, self.axis] - self.level) <= reach

    def values(self, field: Any, resolution: int) -> tuple[NDArray, NDArray, NDArray[np.float64]]:
        """Return x (w,), y (h,) and the signed distances (h, w) of a `Field`; `resolution` samples the longer side."""
        extent = self.high - self.low
        width, height = np.maximum(2, np.round(resolution * extent / extent.max())).astype(int)
        x, y = np.linspace(self.low[0], self.high[0], width), np.linspace(self.low[1], self.high[1], height)
        points = np.empty((height * width, 3))
        points[:, self.axis] = self.level
        points[:, _others(self.axis)] = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return x, y, field.sdf_at(points).reshape(height, width)

    def cut(self, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the line segments (s, 2, 2) where a mesh crosses the plane."""
        # A corner in the plane itself counts as above it, so every crossed face is crossed by two edges.
        height = vertices[:, self.axis] - self.level
        above = height >= 0
        crossed = faces[above[faces].any(axis=1) & ~above[faces].all(axis=1)]
        ends = []
        for a, b in ((0, 1), (1, 2), (2, 0)):
            first, second = crossed[:, a], crossed[:, b]
            across = above[first] != above[second]
            rise = np.where(across, height[first] - height[second], 1.0)
            share = np.where(across, height[first] / rise, np.nan)[:, None]
            ends.append(self.flat(vertices[first]) * (1 - share) + self.flat(vertices[second]) * share)
        both = np.stack(ends, axis=1)
        return both[np.isfinite(both).all(axis=2)].reshape(-1, 2, 2)

    def prepare(self, axes: Axes) -> None:
        """Show this window and nothing around it."""
        axes.set(
            xlim=(self.low[0], self.high[0]), ylim=(self.low[1], self.high[1]), aspect="equal", xticks=[], yticks=[]
        )
        for spine in axes.spines.values():
            spine.set(color="#d5d9df", linewidth=0.8)


def draw_zero(axes: Axes, x: NDArray, y: NDArray, values: NDArray[np.float64], width: float = 2.0) -> None:
    """Draw the zero level set, if the window meets it."""
    if values.min() < 0 < values.max():
        axes.contour(x, y, values, levels=[0.0], colors=[INK], linewidths=width, zorder=3)


def draw_truth(axes: Axes, segments: NDArray[np.float64]) -> None:
    """Draw the true section as a thin line."""
    lines = LineCollection(segments, colors=FAINT, linewidths=1.0, zorder=2.5)
    axes.add_collection(lines)


def _others(axis: int) -> list[int]:
    return [k for k in range(3) if k != axis]
