"""One reference, prepared once; any number of predictions compared with it under a protocol."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from n2n.errors import InputError
from n2n.evaluation.frames import FRAMES
from n2n.evaluation.measures import MEASURES, Blank, Pair, Settings
from n2n.evaluation.samples import Samples, draw, take
from n2n.geometry.reference import Reference

if TYPE_CHECKING:
    from n2n.evaluation.protocol import Protocol

# Each role draws with a seed of its own: the true mesh as prediction must not meet its own samples again.
REFERENCE, PREDICTION, RESAMPLE, SPLIT = range(4)


class Measured(NamedTuple):
    """Metric -> raw number, metric -> why there is none, and the samples that were compared (world coordinates)."""

    values: dict[str, float]
    blanks: dict[str, str]
    samples: Samples


class Comparison:
    """A reference in the frame of a protocol.

    Attributes:
        reference: As given.
        truth: The samples predictions are compared with, world coordinates; None where there are none.
        is_mesh: Whether they were drawn from a mesh.

    Raises:
        InputError: There is neither a cloud nor a mesh, or it has no extent.
    """

    def __init__(self, protocol: "Protocol", reference: Reference) -> None:
        self._protocol, self.reference = protocol, reference
        self.has_mesh = reference.vertices is not None and reference.faces is not None
        if reference.points is None and not self.has_mesh:
            raise InputError("the reference is empty; give a clean cloud, a mesh or both")
        use, sampler = protocol.reference["use"], protocol.reference.get("sampler")
        self.is_mesh = self.has_mesh and bool(sampler) and (use == "mesh" or reference.points is None)
        self.truth = self._truth()
        if self.truth is not None:
            outline = reference.vertices if self.is_mesh else reference.points
            self._frame = FRAMES[protocol.frame](outline, self.truth.points)
            self._inside = self.truth.within(self._frame)
        if self.has_mesh and protocol.p2m is not None:
            self._mesh_frame = FRAMES[protocol.p2m["frame"]](reference.vertices, reference.vertices)
            self._vertices = self._mesh_frame.to_unit(reference.vertices)

    def measure(
        self,
        prediction: NDArray[np.float64] | trimesh.Trimesh,
        sampler: str | None = None,
        role: int = PREDICTION,
        count: int | None = None,
    ) -> Measured:
        """Compare one prediction.

        Args:
            prediction: (n, 3) points, taken as they are, or a mesh, which is sampled; world coordinates.
            sampler: Instead of the protocol's.
            role: Which of the seeds a mesh is sampled with.
            count: How many samples, where the protocol leaves that open; None: as many as the clean cloud has points.
        """
        is_mesh = isinstance(prediction, trimesh.Trimesh)
        samples = self._sample(prediction, sampler, role, count) if is_mesh else take(prediction, None, None, 0)
        asked = self._protocol.prediction["samples"] if is_mesh and self.is_mesh else None
        return self._measure(samples, None if self.truth is None else self._inside, asked)

    def split(self) -> tuple[Measured, bool]:
        """Compare points of the clean cloud with others of it.

        Returns:
            The numbers, and whether the cloud is dense enough for both sides to have the protocol's number of points;
            if not, its halves were compared, at half its density, which costs more.
        """
        cloud, wanted = self.reference, self._protocol.reference["samples"]
        order = np.random.default_rng(self._protocol.seed_of(SPLIT)).permutation(len(cloud.points))
        is_dense = wanted is not None and len(order) >= 2 * wanted
        size = wanted if is_dense else len(order) // 2
        whole = take(cloud.points, cloud.normals, None, 0)
        first, second = whole.rows(order[:size]), whole.rows(order[size : 2 * size])
        return self._measure(first, second.within(self._frame), None), is_dense

    def _sample(self, mesh: trimesh.Trimesh, sampler: str | None, role: int, count: int | None) -> Samples:
        """Draw as many points from a mesh as the protocol asks for.

        Raises:
            InputError: The mesh has no area, or the number is that of a clean cloud which was not given.
        """
        spec, points = self._protocol.prediction, self.reference.points
        count = spec["samples"] or count or (len(points) if points is not None else None)
        if count is None:
            raise InputError(
                f"{self._protocol.label} draws as many samples from a predicted mesh as the clean cloud has points; "
                "give a clean cloud as reference, too"
            )
        vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)
        return draw(vertices, faces, count, sampler or spec["sampler"], self._protocol.seed_of(role))

    def _truth(self) -> Samples | None:
        spec, given, seed = self._protocol.reference, self.reference, self._protocol.seed_of(REFERENCE)
        if self.is_mesh:
            return draw(given.vertices, given.faces, spec["samples"], spec["sampler"], seed)
        return None if given.points is None else take(given.points, given.normals, spec["samples"], seed)

    def _measure(self, samples: Samples, reference: Samples | None, asked: int | None) -> Measured:
        protocol, against_mesh = self._protocol, None
        settings = Settings(protocol.threshold, (protocol.p2m or {}).get("min_triangle_area", 0.0), asked)
        if self.has_mesh and protocol.p2m is not None:
            against_mesh = (self._mesh_frame.to_unit(samples.points), self._vertices, self.reference.faces)
        inside = samples if reference is None else samples.within(self._frame)
        pair = Pair(inside, reference, against_mesh, settings)
        values, blanks = {}, {}
        for metric in protocol.metrics:
            try:
                values[metric] = float(MEASURES[metric].find(pair))
            except Blank as reason:
                blanks[metric] = str(reason)
        return Measured(values, blanks, samples)


def crop(mesh: trimesh.Trimesh, cloud: NDArray[np.float64], share: float) -> trimesh.Trimesh:
    """Return the faces whose three vertices lie near a cloud.

    Args:
        mesh: Predicted mesh.
        cloud: (n, 3) input points, same coordinates.
        share: Largest distance, as a share of the longest edge of the cloud's box.

    Source: CAP-UDF, tools/utils.py:16-40: a face goes where the mean of its vertices' distances, infinite beyond the
        limit, is too large; so it goes as soon as one of them is.
    """
    limit = share * float(np.ptp(cloud, axis=0).max())
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)
    near = np.isfinite(cKDTree(cloud).query(vertices, distance_upper_bound=limit)[0])
    return trimesh.Trimesh(vertices, faces[near[faces].all(axis=1)], process=False)
