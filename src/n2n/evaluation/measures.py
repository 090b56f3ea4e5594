"""The numbers a protocol may report: each a formula and a function of one comparison."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from n2n.evaluation.samples import Samples
from n2n.metrics.chamfer import chamfer_of
from n2n.metrics.fscore import fscore
from n2n.metrics.nearest import nearest
from n2n.metrics.point_mesh import PointMesh, point_to_mesh


class Blank(Exception):
    """A number that does not exist for what was given; the text says why."""


@dataclass(frozen=True)
class Settings:
    """What the formulas depend on besides the points.

    Attributes:
        threshold: Of the F-score, in the frame.
        min_triangle_area: Of P2M, in its frame.
        asked: Samples asked for on each side, which the sum over samples is divided by; None where points were given.
    """

    threshold: float | None = None
    min_triangle_area: float = 0.0
    asked: int | None = None


@dataclass
class Pair:
    """A prediction and what it is compared with.

    Attributes:
        prediction: In the protocol's frame.
        reference: In the protocol's frame; None where no reference for samples was given.
        against_mesh: Prediction's points, mesh vertices and faces in the frame of P2M; None without a mesh.
        settings: Thresholds.
    """

    prediction: Samples
    reference: Samples | None
    against_mesh: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]] | None
    settings: Settings

    @cached_property
    def neighbours(self) -> list[tuple[NDArray[np.float64], NDArray[np.int64]]]:
        """Distance and index of the nearest point, prediction -> reference (n,) and back (m,): searched for once."""
        if self.reference is None:
            raise Blank("no clean cloud given")
        ours, theirs = self.prediction.points, self.reference.points
        return [nearest(ours, theirs), nearest(theirs, ours)]

    @property
    def distances(self) -> list[NDArray[np.float64]]:
        """Distances prediction -> reference (n,) and reference -> prediction (m,)."""
        return [distance for distance, _ in self.neighbours]

    @cached_property
    def point_mesh(self) -> PointMesh:
        """Both parts of the distance between points and mesh."""
        if self.against_mesh is None:
            raise Blank("no mesh given")
        return point_to_mesh(*self.against_mesh, min_triangle_area=self.settings.min_triangle_area)

    def normals(self, inflated: bool) -> float:
        """Agreement of normals at nearest points: `n2n.metrics.normals`, with the search that is there already."""
        if self.reference is None or self.reference.normals is None:
            raise Blank("the reference has no normals")
        if self.prediction.normals is None:
            raise Blank("the prediction is points, without normals")
        ours, theirs = self.prediction.normals, self.reference.normals
        if count := sum(int((~normals.any(axis=1)).sum()) for normals in (ours, theirs)):
            raise Blank(f"{count:,} normals have no direction")
        (_, forth), (_, back) = self.neighbours
        products = ours * theirs[forth], theirs * ours[back]
        cosines = [np.abs(part).sum(axis=1) if inflated else np.abs(part.sum(axis=1)) for part in products]
        return float(sum(part.mean() for part in cosines) / 2)

    def score(self, which: str) -> float:
        """F-score, precision or recall."""
        return float(getattr(fscore(*self.distances, self.settings.threshold), which))


class Measure(NamedTuple):
    """What a number means and how it is found.

    Attributes:
        formula: With X the prediction, Y the reference, d the distance to the nearest point of the other.
        unit: Of the raw number, in the frame.
        better: low or high.
        find: The function.
    """

    formula: str
    unit: str
    better: str
    find: Callable[[Pair], float]


def _chamfer(power: int, combine: str) -> Callable[[Pair], float]:
    return lambda pair: chamfer_of(*pair.distances, power, combine)


def _sums(pair: Pair) -> float:
    if pair.settings.asked is None:
        raise Blank("only for samples of two meshes")
    return float(sum(distance.sum() for distance in pair.distances) / pair.settings.asked)


MEASURES = {
    "cd_sum2": Measure("mean_X d^2 + mean_Y d^2", "length^2", "low", _chamfer(2, "sum")),
    "cd_mean2": Measure("(mean_X d^2 + mean_Y d^2) / 2", "length^2", "low", _chamfer(2, "mean")),
    "cd_sum1": Measure("mean_X d + mean_Y d", "length", "low", _chamfer(1, "sum")),
    "cd_mean1": Measure("(mean_X d + mean_Y d) / 2", "length", "low", _chamfer(1, "mean")),
    "cd_p2s": Measure("(sum_X d + sum_Y d) / samples asked for", "length", "low", _sums),
    "hausdorff": Measure(
        "max(max_X d, max_Y d)", "length", "low", lambda pair: float(max(part.max() for part in pair.distances))
    ),
    "p2m": Measure(
        "mean_X dist(x, mesh)^2 + mean_faces dist(face, X)^2", "length^2", "low", lambda pair: pair.point_mesh.total
    ),
    "p2m_forward": Measure("mean_X dist(x, mesh)^2", "length^2", "low", lambda pair: pair.point_mesh.forward),
    "p2m_backward": Measure("mean_faces dist(face, X)^2", "length^2", "low", lambda pair: pair.point_mesh.backward),
    "nc": Measure(
        "mean of both directions' |n . n'| at nearest points", "1", "high", lambda pair: pair.normals(inflated=False)
    ),
    "nc_inflated": Measure(
        "mean of both directions' sum_k |n_k n'_k| at nearest points", "1", "high", lambda pair: pair.normals(True)
    ),
    "fscore": Measure("2 P R / (P + R)", "1", "high", lambda pair: pair.score("fscore")),
    "precision": Measure("P: share of X with d <= threshold", "1", "high", lambda pair: pair.score("precision")),
    "recall": Measure("R: share of Y with d <= threshold", "1", "high", lambda pair: pair.score("recall")),
}
