"""The numbers of a finished fit: what was measured of it, and evaluations against the truth."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from n2n.evaluation.protocol import load_protocol
from n2n.evaluation.runs import noisy_points, predict
from n2n.tasks.field import Field
from n2n.tracking import names


def check_evaluations(wanted: Sequence[str]) -> None:
    """Raise ConfigError for protocols that do not exist."""
    for evaluation in wanted:
        load_protocol(evaluation.partition("/")[2])


def evaluate(field: Field, data: Any, wanted: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Evaluate a field against the truth of its data.

    Args:
        field: Of one shape.
        data: The datamodule it was fitted to.
        wanted: `task/protocol` each.

    Returns:
        By `task/protocol` raw values, floors and the reasons of what could not be measured; empty without a truth.
    """
    reference = getattr(data, "reference", None)
    if reference is None or (reference.points is None and reference.vertices is None):
        return {}
    noisy, predictions, results = noisy_points(data), {}, {}
    for evaluation in wanted:
        task, _, protocol = evaluation.partition("/")
        if task not in predictions:
            predictions[task] = predict(field, noisy, task)
        scored = load_protocol(protocol).evaluate(predictions[task], reference, noisy)
        results[evaluation] = {
            "values": scored.values,
            "floors": scored.floors,
            "blanks": {**scored.blanks, **scored.floor_blanks},
        }
    return results


def results(field: Field, evaluations: dict[str, dict[str, Any]], seconds: float) -> dict[str, float]:
    """Return everything that is logged once, after the fit, under its name."""
    report, voxel = field.report, field.config["architecture"].get("voxel")
    values = {
        names.NOISE: float(np.mean(report["noise"])),
        names.SPACING: float(np.mean(report["spacing"])),
        names.SECONDS: seconds,
    }
    if voxel:
        values[names.VOXEL] = voxel * float(np.mean([frame.scale for frame in field.frames]))
    values |= {name: report[name] for name in (names.VALIDATION, names.VALIDATION_RELATIVE) if name in report}
    for evaluation, result in evaluations.items():
        values |= {names.evaluation(*evaluation.split("/"), metric): v for metric, v in result["values"].items()}
    return values
