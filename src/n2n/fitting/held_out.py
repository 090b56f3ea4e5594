"""Points kept out of a fit, each with a line along which it measures the surface."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from n2n.fitting.prepare import Shape
from n2n.geometry.frame import Frame
from n2n.geometry.local_fit import project_to_quadric

_MAX_POINTS = 10_000
_WIDTH = 7.0  # noise deviations from the middle of a patch to its rim: a wide one knows its normal well
_NEIGHBOURS = 24, 384


@dataclass
class HeldOut:
    """Points that no fit has seen.

    Attributes:
        points: (n, 3) world coordinates.
        directions: (n, 3) unit vectors: the normal that the kept points around suggest, whatever surface is fitted to
            them. Along the way to the nearest point of that surface a bumpy one would seem close to everything.
        noise: Deviation of the points' noise, measured before the fit, world units.
    """

    points: NDArray[np.float64]
    directions: NDArray[np.float64]
    noise: float

    @classmethod
    def of(cls, points: NDArray[np.float64], frame: Frame, shape: Shape) -> "HeldOut":
        """Find the directions.

        Args:
            points: (n, 3) world coordinates; of more than 10 000 some are taken.
            frame: World <-> unit map.
            shape: The points that were kept, measured.
        """
        kept, chosen = shape.sample, shape.chosen
        noise = chosen.noise * frame.scale
        some = points[:: max(1, math.ceil(len(points) / _MAX_POINTS))]
        if not len(some):
            return cls(some, some, noise)
        # Points within a disk of this width.
        wanted = math.pi * (_WIDTH * chosen.noise) ** 2 * len(kept) / chosen.area
        neighbours = int(np.clip(wanted, *_NEIGHBOURS))
        return cls(some, project_to_quadric(cKDTree(kept), frame.to_unit(some), neighbours)[1], noise)
