"""What numbers are to be held against: a perfect method and an idle one, measured like the prediction."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from n2n.evaluation.comparison import RESAMPLE, Comparison
from n2n.evaluation.evaluation import Evaluation
from n2n.evaluation.measures import Blank
from n2n.metrics.point_mesh import closest_on_mesh

_Noisy = NDArray[np.float64] | None


def _oracle(comparison: Comparison, noisy: _Noisy, **_: Any) -> dict[str, float]:
    """Every noisy point moved to the nearest point of the true mesh."""
    if noisy is None:
        raise Blank("no noisy points given")
    if not comparison.has_mesh:
        raise Blank("no mesh given")
    truth = comparison.reference
    return comparison.measure(closest_on_mesh(noisy, truth.vertices, truth.faces)).values


def _resample(comparison: Comparison, sampler: str | None = None, count: int = 0, **_: Any) -> dict[str, float]:
    """The true mesh as prediction: sampled anew, with another seed."""
    if not comparison.has_mesh:
        raise Blank("no mesh given")
    mesh = trimesh.Trimesh(comparison.reference.vertices, comparison.reference.faces, process=False)
    return comparison.measure(mesh, sampler, RESAMPLE, count).values


def _split(comparison: Comparison, notes: list[str], **_: Any) -> dict[str, float]:
    """Points of the clean cloud against others of it, where no mesh can be sampled."""
    if comparison.has_mesh:
        return {}
    measured, is_dense = comparison.split()
    if not is_dense:
        notes.append("split: halves of the clean cloud, at half its density; the floor is lower")
    return measured.values


def _do_nothing(comparison: Comparison, noisy: _Noisy, **_: Any) -> dict[str, float]:
    """The noisy points as prediction."""
    if noisy is None:
        raise Blank("no noisy points given")
    return comparison.measure(noisy).values


FLOORS: dict[str, Callable[..., dict[str, float]]] = {
    "oracle": _oracle,
    "resample": _resample,
    "split": _split,
    "do_nothing": _do_nothing,
}


def measure_floors(
    result: Evaluation, floors: Mapping[str, Mapping[str, Any]], comparison: Comparison, noisy: _Noisy, count: int
) -> None:
    """Add floors to an evaluation, or why they do not exist.

    Args:
        result: Gets `floors`, `floor_blanks` and notes.
        floors: Floor -> arguments, from the protocol.
        comparison: The prepared reference.
        noisy: (m, 3) what the prediction was made from, if known.
        count: Points of the prediction, for floors that are sampled and compared as points.
    """
    for name, arguments in floors.items():
        try:
            if values := FLOORS[name](comparison, noisy=noisy, count=count, notes=result.notes, **arguments):
                result.floors[name] = values
        except Blank as reason:
            result.floor_blanks[name] = str(reason)
