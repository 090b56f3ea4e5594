"""One fit measured: data in, numbers out. Runs in a process of its own."""

import dataclasses
import datetime
import os
import platform
import time
from collections.abc import Mapping, Set
from typing import Any

import numpy as np

from n2n.compose import compose, config_hash
from n2n.errors import ConfigError, N2NError
from n2n.evaluation.protocol import Protocol, load_protocol
from n2n.evaluation.provenance import provenance
from n2n.fitting.fit import fit as fit_data
from n2n.geometry.reference import Reference
from n2n.registry import BASELINES, DATAMODULES
from n2n.tables.memory import peak, reset_peak
from n2n.tables.spec import Fit
from n2n.tables.store import deciding, protocol_hash, sources
from n2n.tasks.field import Field


def measure(fit: Fit, evaluations: Mapping[str, Set[str]], samples: int | None = None) -> dict[str, Any]:
    """Run a fit and its evaluations.

    Args:
        fit: What to run.
        evaluations: `task/protocol` and the floors wanted with it, e.g. `{"denoise/sbp": {"oracle"}}`.
        samples: At most this many samples a side, whatever a protocol says.

    Returns:
        Plain data: settings, where and when, cost, results. A failure is a record, too: status `failed` and the error.
    """
    start = time.perf_counter()
    record: dict[str, Any] = {**fit.described(), "made": _made()}
    try:
        record |= _run(fit, evaluations, samples)
        record["status"] = "done"
    except N2NError as error:
        record |= fit.failed(str(error))
    except Exception as error:  # one bad shape never loses the others' results
        record |= fit.failed(" ".join(f"{type(error).__name__}: {error}".split()))
    record["cost"] = {**record.get("cost", {}), "seconds": round(time.perf_counter() - start, 2)}
    return record


def _run(fit: Fit, evaluations: Mapping[str, Set[str]], samples: int | None) -> dict[str, Any]:
    shape = fit.shape.replace("'", r"\'")
    config = compose([f"datamodule={fit.datamodule}", f"datamodule.shape='{shape}'", *fit.settings])
    data = DATAMODULES.build(config["datamodule"], num_observations=config["num_observations"])
    if not hasattr(data, "reference"):
        raise ConfigError(f"datamodule {fit.datamodule!r} knows no true surface; tables need a benchmark datamodule")
    truth: Reference = data.reference or Reference()
    made = {"source": data.source}
    made["config"] = config_hash({**config, "device": None, "data": data.fingerprint()})
    wanted = {evaluation: floors for evaluation, floors in sorted(evaluations.items()) if evaluation}
    results = {}
    if truth.points is None and truth.vertices is None:
        blank = {"values": {}, "floors": {}, "blanks": {}, "blank": f"no ground truth of {fit.shape} is present"}
        results = {evaluation: {**_asked(evaluation, floors), **blank} for evaluation, floors in wanted.items()}
        if "" not in evaluations:
            return {**made, "results": results}
    reset_peak()
    start = time.perf_counter()
    if fit.method == "n2n":
        result = fit_data(data, config)
        method: Any = Field.of(result)
        about = {key: method.report[key] for key in ("iterations", "points", "observations", "noise", "outliers")}
    else:
        method, about = BASELINES.build(fit.method), {}
    seconds = time.perf_counter() - start
    for evaluation in [name for name in wanted if name not in results]:
        results[evaluation] = _evaluate(method, data.noisy, truth, evaluation, wanted[evaluation], samples)
    return {
        **made,
        "fit": about,
        "cost": {"minutes": seconds / 60, "memory": peak() / 2**30},
        "results": results,
    }


def _evaluate(
    method: Any, noisy: np.ndarray, truth: Reference, evaluation: str, floors: Set[str], samples: int | None
) -> dict[str, Any]:
    task, protocol = evaluation.split("/")
    prediction, seconds = _predict(method, task, noisy)
    scored = _protocol(protocol, floors, samples).evaluate(prediction, truth, noisy)
    return {
        **_asked(evaluation, floors),
        "values": _short(scored.values),
        "floors": {name: _short(values) for name, values in scored.floors.items()},
        "blanks": {**scored.blanks, **scored.floor_blanks},
        "seconds": round(seconds, 2),
    }


def _asked(evaluation: str, floors: Set[str]) -> dict[str, Any]:
    return {"definition": protocol_hash(evaluation.split("/")[1]), "asked": sorted(floors)}


def _protocol(name: str, floors: Set[str], samples: int | None) -> Protocol:
    """Return a protocol that measures only the floors wanted: to draw a large cloud anew can take longer than a fit."""
    protocol = load_protocol(name)
    sides = {side: dict(getattr(protocol, side)) for side in ("reference", "prediction")}
    for side in sides.values():
        if samples is not None and side["samples"] is not None:
            side["samples"] = min(side["samples"], samples)
    kept = {floor: arguments for floor, arguments in protocol.floors.items() if floor in floors}
    return dataclasses.replace(protocol, floors=kept, **sides)


def _predict(method: Any, task: str, noisy: np.ndarray) -> tuple[Any, float]:
    """Return what a method makes of the noisy points, and the seconds it took."""
    if not hasattr(method, task):
        raise ConfigError(f"{type(method).__name__} cannot {task}")
    start = time.perf_counter()
    if isinstance(method, Field):
        prediction = method.reconstruct() if task == "reconstruct" else getattr(method, task)(noisy)
    else:
        prediction = getattr(method, task)(noisy)
    return prediction, time.perf_counter() - start


def _short(values: dict[str, Any]) -> dict[str, Any]:
    """Round to six digits: what is below is not reproducible between machines."""
    return {key: float(f"{value:.6g}") if isinstance(value, float) else value for key, value in values.items()}


def _made() -> dict[str, Any]:
    """Return with which sources, when and where."""
    import torch

    gpu = torch.cuda.get_device_name() if torch.cuda.is_available() else None
    origin = provenance(tuple(map(str, deciding())))
    return {
        "n2n": origin["n2n"],
        "commit": f"{origin['commit'][:7]}{'+' if origin['modified'] else ''}" if origin["commit"] else "unknown",
        "sources": sources(),
        "torch": torch.__version__,
        "machine": f"{platform.machine()}, {os.cpu_count()} cores" + (f", {gpu}" if gpu else ""),
        "date": datetime.datetime.now().astimezone().isoformat(timespec="seconds"),
    }
