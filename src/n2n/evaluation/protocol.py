"""Protocols: frame, samples, metrics and thresholds of a published comparison; their settings are in conf/protocol/."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from n2n.errors import ConfigError, InputError
from n2n.evaluation.comparison import Comparison, crop
from n2n.evaluation.evaluation import Evaluation
from n2n.evaluation.floors import FLOORS, measure_floors
from n2n.evaluation.frames import FRAMES
from n2n.evaluation.measures import MEASURES
from n2n.evaluation.options import load_option
from n2n.evaluation.placement import check_overlap, misplaced
from n2n.evaluation.samples import SAMPLERS
from n2n.geometry.reference import Reference
from n2n.registry import PROTOCOLS, suggest

CROPPED = "_cropped"
_OF_THE_MESH = {
    "components": ("connected pieces of the predicted mesh", "low"),
    "watertight": ("1 where every edge of the predicted mesh belongs to two faces, else 0", "high"),
}


@dataclass
class Protocol:
    """How predictions are compared with a reference, to the letter of a publication.

    Args:
        title: One line.
        frame: Coordinates of the numbers: sphere, cube, deviation or world; see `n2n.evaluation.frames`.
        reference: `use` (points or mesh), `samples` (how many; null: all points) and `sampler` of a mesh (uniform,
            even or poisson; left out where a mesh cannot stand for the clean cloud).
        prediction: `sampler` and `samples` of a predicted mesh; null: as many as the clean cloud has points.
            Predicted points are taken as they are.
        metrics: Metric -> factor of the printed number; see `n2n.evaluation.measures`.
        floors: Floor (oracle, resample, do_nothing) -> its arguments.
        p2m: `frame` of the mesh and `min_triangle_area`; null where no P2M is measured.
        threshold: Of the F-score, in the frame.
        crop: Share of the input's longest edge beyond which faces are cut off; every metric is then measured twice.
        seed: Of all samples.
        sources: Repositories and files the above is taken from.
        label: Name for messages and results.
    """

    title: str
    frame: str
    reference: Mapping[str, Any]
    prediction: Mapping[str, Any]
    metrics: Mapping[str, int | float]
    floors: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    p2m: Mapping[str, Any] | None = None
    threshold: int | float | None = None
    crop: int | float | None = None
    seed: int = 0
    sources: Sequence[str] = ()
    label: str = "protocol"

    def __post_init__(self) -> None:
        _known("frame", self.frame, FRAMES)
        _known("reference.use", self.reference.get("use"), ("points", "mesh"))
        for side in ("reference", "prediction"):
            spec = getattr(self, side)
            for key in spec:
                _known(side, key, ("use", "sampler", "samples") if side == "reference" else ("sampler", "samples"))
            if "samples" not in spec:
                raise ConfigError(f"protocol {self.label!r} needs {side}.samples; give a number or null for all")
            if spec.get("sampler") is not None or side == "prediction":
                _known(f"{side}.sampler", spec.get("sampler"), SAMPLERS)
        if self.reference.get("sampler") and self.reference["samples"] is None:
            raise ConfigError(f"protocol {self.label!r} needs reference.samples; a mesh has no number of its own")
        for metric in self.metrics:
            _known("metrics", metric, MEASURES)
        for name, arguments in self.floors.items():
            _known("floors", name, FLOORS)
            if "sampler" in arguments:
                _known(f"floors.{name}.sampler", arguments["sampler"], SAMPLERS)
        if self.threshold is None and {"fscore", "precision", "recall"} & set(self.metrics):
            raise ConfigError(f"protocol {self.label!r} reports an F-score and needs its threshold")
        if any(metric.startswith("p2m") for metric in self.metrics):
            if self.p2m is None:
                raise ConfigError(f"protocol {self.label!r} reports P2M and needs p2m: frame, min_triangle_area")
            _known("p2m.frame", self.p2m.get("frame"), FRAMES)

    def evaluate(
        self,
        prediction: NDArray[np.float64] | trimesh.Trimesh,
        reference: Reference,
        noisy: NDArray[np.float64] | None = None,
    ) -> Evaluation:
        """Compare a prediction with a reference.

        Args:
            prediction: (n, 3) points, which are taken as samples as they are, or a mesh, which is sampled; world
                coordinates. The number of points need not be the reference's.
            reference: Clean cloud, mesh or both, world coordinates.
            noisy: (m, 3) what the prediction was made from, for the floors and the crop.

        Returns:
            Raw numbers; what cannot be measured is blank with a reason.

        Raises:
            InputError: Something is empty, not finite, without area, or lies wholly beside the reference.
        """
        given = _points_of(prediction, reference, noisy)
        for name, points in given.items():
            _check(name, points)
        comparison = Comparison(self, reference)
        for name, points in given.items():
            check_overlap(name, np.asarray(points), reference)
        measured = comparison.measure(prediction)
        result = Evaluation(self.label, measured.values, measured.blanks)
        result.definitions = {metric: self._definition(metric) for metric in self.metrics}
        result.samples["prediction"] = _described(measured.samples)
        if comparison.truth is not None:
            result.samples["reference"] = _described(comparison.truth)
        self._remark(result, comparison, isinstance(prediction, trimesh.Trimesh))
        sampled = {"prediction": measured.samples.points, "noisy cloud": noisy, "reference cloud": reference.points}
        remarks = (misplaced(name, cloud, reference) for name, cloud in sampled.items() if cloud is not None)
        result.notes += filter(None, remarks)
        if self.crop is not None:
            self._measure_cropped(result, comparison, prediction, noisy)
        if isinstance(prediction, trimesh.Trimesh):
            result.values |= {"components": float(prediction.body_count), "watertight": float(prediction.is_watertight)}
            for metric, (formula, better) in _OF_THE_MESH.items():
                result.definitions[metric] = {"formula": formula, "unit": "1", "factor": 1.0, "better": better}
        measure_floors(result, self.floors, comparison, noisy, len(measured.samples.points))
        return result

    def seed_of(self, role: int) -> int:
        """Return the seed of one of the parts that are drawn."""
        return int(np.random.default_rng([self.seed, role]).integers(2**31))

    def settings(self) -> dict[str, Any]:
        """Return everything that defines the numbers as plain values."""
        return asdict(self)

    def _definition(self, metric: str, cropped: bool = False) -> dict[str, Any]:
        measure = MEASURES[metric]
        frame = self.p2m["frame"] if metric.startswith("p2m") else self.frame
        facts = {
            "formula": measure.formula,
            "unit": measure.unit,
            "factor": float(self.metrics[metric]),
            "better": measure.better,
            "frame": f"{frame} of the mesh" if metric.startswith("p2m") else frame,
        }
        if metric in ("fscore", "precision", "recall"):
            facts["threshold"] = self.threshold
        if metric in ("p2m", "p2m_forward", "p2m_backward"):
            facts["min_triangle_area"] = self.p2m.get("min_triangle_area", 0.0)
        if cropped:
            facts["crop"] = self.crop
        return facts

    def _measure_cropped(
        self,
        result: Evaluation,
        comparison: Comparison,
        prediction: NDArray[np.float64] | trimesh.Trimesh,
        noisy: NDArray[np.float64] | None,
    ) -> None:
        names = {metric: metric + CROPPED for metric in self.metrics}
        result.definitions |= {name: self._definition(metric, True) for metric, name in names.items()}
        reason = None
        if not isinstance(prediction, trimesh.Trimesh):
            reason = "only a mesh is cropped"
        elif noisy is None:
            reason = "no input cloud given"
        else:
            near = crop(prediction, noisy, self.crop)
            if not len(near.faces):
                reason = f"no face lies within {self.crop} of the input"
        if reason:
            result.blanks |= dict.fromkeys(names.values(), reason)
            return
        measured = comparison.measure(near)
        result.values |= {names[metric]: value for metric, value in measured.values.items()}
        result.blanks |= {names[metric]: reason for metric, reason in measured.blanks.items()}
        result.notes.append(f"the crop keeps {len(near.faces):,} of {len(prediction.faces):,} faces")

    def _remark(self, result: Evaluation, comparison: Comparison, is_mesh: bool) -> None:
        if self.reference["use"] == "mesh" and not comparison.is_mesh:
            result.notes.append(f"{self.label} samples the true mesh; none was given, so the clean cloud stands for it")
        wanted, truth = self.reference["samples"], comparison.truth
        if wanted is not None and truth is not None and not comparison.is_mesh and len(truth.points) < wanted:
            result.notes.append(
                f"{self.label} compares with {wanted:,} points; the reference has only {len(truth.points):,}"
            )
        if is_mesh and self.prediction["samples"] is None:
            result.notes.append(f"{self.label} compares points; the predicted mesh was sampled uniformly")
        if not is_mesh and self.prediction["samples"] is not None:
            result.notes.append(f"{self.label} samples a predicted mesh; predicted points were taken as they are")


def load_protocol(name: str) -> Protocol:
    """Build the protocol that conf/protocol/NAME.yaml, or a plugin's option of that name, describes.

    Raises:
        ConfigError: No such protocol (with the nearest known one), or a setting it does not know.
    """
    return PROTOCOLS.build(load_option("protocol", name), label=name)


def _known(key: str, value: Any, known: Any) -> None:
    if value not in known:
        raise ConfigError(f"protocol setting {key}={value} is not known.{suggest(str(value), list(known))}")


def _points_of(prediction: Any, reference: Reference, noisy: Any) -> dict[str, Any]:
    points = prediction.vertices if isinstance(prediction, trimesh.Trimesh) else prediction
    given = {
        "prediction": points,
        "reference cloud": reference.points,
        "reference mesh": reference.vertices,
        "noisy cloud": noisy,
    }
    return {name: array for name, array in given.items() if array is not None}


def _check(name: str, points: Any) -> None:
    array = np.asarray(points)
    if array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise InputError(f"the {name} has shape {array.shape}; give at least one point, (n, 3)")
    if count := np.count_nonzero(~np.isfinite(array).all(axis=1)):
        raise InputError(f"the {name} holds {count:,} rows that are NaN or infinite; take them out first")


def _described(samples: Any) -> dict[str, Any]:
    return {"points": len(samples.points), "normals": samples.normals is not None, "origin": samples.origin}
