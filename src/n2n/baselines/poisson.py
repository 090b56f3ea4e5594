"""Screened Poisson surface reconstruction by PyMeshLab, which bundles the authors' code."""

import numpy as np
import trimesh
from numpy.typing import NDArray

from n2n.baselines.optional import optional
from n2n.errors import ConfigError, InputError

_DEPTHS = (2, 14)


class ScreenedPoisson:
    """Screened Poisson: normals are fitted to planes and oriented by propagation, then a surface to points and normals.

    Args:
        depth: Of the octree, 2 to 14; 8 is the authors' default.
        neighbours: Points a normal is fitted to, and its orientation passed on to.
        point_weight: How much the surface must pass through the points; 4 is the authors' default, 0 is unscreened.

    Raises:
        ConfigError: PyMeshLab is not installed, or an argument is out of range.

    Source: Kazhdan and Hoppe 2013; Hoppe et al. 1992 for the orientation.
    """

    def __init__(self, depth: int = 8, neighbours: int = 30, point_weight: int | float = 4) -> None:
        if not _DEPTHS[0] <= depth <= _DEPTHS[1]:
            raise ConfigError(f"depth={depth} is out of range; give {_DEPTHS[0]} to {_DEPTHS[1]}")
        if neighbours < 3:
            raise ConfigError(f"neighbours={neighbours} is out of range; a plane needs 3 or more")
        if not 0 <= point_weight < float("inf"):
            raise ConfigError(f"point_weight={point_weight} is out of range; give 0 or more")
        self.depth, self.neighbours, self.point_weight = depth, neighbours, float(point_weight)
        self._meshlab = optional("pymeshlab", "poisson", "screened Poisson")

    def reconstruct(self, points: NDArray[np.float64]) -> trimesh.Trimesh:
        """Return the surface of points (n, 3) as a mesh whose faces point outwards.

        Raises:
            InputError: The cloud has no more points than a neighbourhood, or no surface comes out of it.
        """
        points = np.asarray(points, np.float64)
        if len(points) <= self.neighbours:
            raise InputError(
                f"the cloud has {len(points)} points; {self.neighbours} neighbours need more, or give fewer"
            )
        # The solver computes in single precision: coordinates of a map would lose their millimetres.
        centre = (points.min(axis=0) + points.max(axis=0)) / 2
        work = self._meshlab.MeshSet(verbose=False)
        work.add_mesh(self._meshlab.Mesh(vertex_matrix=points - centre))
        work.compute_normal_for_point_clouds(k=self.neighbours)
        # With more than one thread two runs differ.
        work.generate_surface_reconstruction_screened_poisson(
            depth=self.depth,
            pointweight=self.point_weight,
            threads=1,
        )
        result = work.current_mesh()
        vertices, faces = result.vertex_matrix(), result.face_matrix()
        if not len(faces):
            raise InputError("screened Poisson found no surface in this cloud; its normals contradict each other")
        mesh = trimesh.Trimesh(vertices + centre, faces, process=False)
        # The orientation of the first normal is a guess, and with it that of all others.
        if mesh.volume < 0:
            mesh.invert()
        return mesh
