"""What is known of the true surface of a shape."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Reference:
    """A clean cloud, a mesh, or both; world coordinates, float64.

    Attributes:
        points: Clean points, (m, 3).
        normals: Unit normals of `points`, (m, 3); their orientation may be wrong.
        vertices, faces: Mesh, (v, 3) and (f, 3) int64.
    """

    points: NDArray[np.float64] | None = None
    normals: NDArray[np.float64] | None = None
    vertices: NDArray[np.float64] | None = None
    faces: NDArray[np.int64] | None = None
