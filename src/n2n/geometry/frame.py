"""The map between world coordinates (what the user has) and unit coordinates (what the field sees)."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from n2n.errors import InputError


@dataclass(frozen=True)
class Frame:
    """A uniform scaling and a shift: unit = (world - centre) / scale.

    Attributes:
        centre: World position of the unit origin, float64 so that UTM-sized offsets keep their millimetres.
        scale: World length of one unit, > 0.
    """

    centre: tuple[float, float, float]
    scale: float

    @classmethod
    def fit(cls, clouds: list[NDArray[np.float64]]) -> "Frame":
        """Centre the bounding box of all clouds and scale the farthest point to radius 1.

        >>> Frame.fit([np.array([[10.0, 0, 0], [14.0, 0, 0]])])
        Frame(centre=(12.0, 0.0, 0.0), scale=2.0)
        """
        lower = np.min([cloud.min(axis=0) for cloud in clouds], axis=0)
        upper = np.max([cloud.max(axis=0) for cloud in clouds], axis=0)
        centre = (lower + upper) / 2
        radius = max(float(np.linalg.norm(cloud - centre, axis=1).max()) for cloud in clouds)
        if not np.isfinite(radius) or radius <= 0:
            raise InputError("the cloud has no extent: all points are equal or not finite; give a cloud of a surface")
        return cls(tuple(float(c) for c in centre), radius)

    def to_unit(self, world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map (n, 3) world positions to unit coordinates."""
        return (np.asarray(world, np.float64) - self.centre) / self.scale

    def to_world(self, unit: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map (n, 3) unit positions to world coordinates, in float64."""
        return np.asarray(unit, np.float64) * self.scale + self.centre

    def state(self) -> dict:
        """Return plain numbers for a checkpoint; `Frame(**state)` restores the frame."""
        return asdict(self)
