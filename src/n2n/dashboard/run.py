"""A run as a dashboard sees it: read from its folder, whatever is missing or damaged there."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from n2n.dashboard.curves import Curve, read_curves

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_HIDDEN = ("logger", "device", "hydra")


@dataclass
class Run:
    """One fit.

    Attributes:
        id: Name of its folder; together with `sweep` it is unique.
        folder: Where it is.
        sweep: The sweep it belongs to, or the folder that holds it.
        state: pending, running, stale, done or failed.
        error: Why it failed, in one line.
        seconds: It took, where it ended.
        attempt: How often it was started.
        started: ISO time.
        heartbeat: Seconds since its last sign of life, where it runs.
        swept: What the sweep varies, by key.
        config: As composed, by dotted key; what was chosen by itself is in `effective`.
        effective: As used.
        values: Raw results by name: `validation`, `denoise/sbp/cd_sum2`, last values of what was logged.
        floors: Raw results of what a perfect method, or none at all, would reach, by `task/protocol/floor/metric`.
        curves: What was logged.
        problems: What could not be read.
        note: Where a number of `n2n tables` comes from.
    """

    id: str
    folder: Path
    sweep: str = ""
    state: str = "pending"
    error: str = ""
    seconds: float | None = None
    attempt: int = 0
    started: str = ""
    heartbeat: float | None = None
    swept: dict[str, str] = field(default_factory=dict)
    config: dict[str, Any] = field(default_factory=dict)
    effective: dict[str, Any] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)
    floors: dict[str, float] = field(default_factory=dict)
    curves: dict[str, Curve] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    note: str = ""

    @property
    def shape(self) -> str:
        """What was fitted: the data's own name, or those of the files."""
        paths = self.config.get("datamodule.paths")
        if isinstance(paths, list) and paths:
            first = paths[0] if isinstance(paths[0], str) else str(paths[0])
            return Path(first).name + (f" +{len(paths) - 1}" if len(paths) > 1 else "")
        return str(self.swept.get("datamodule.shape") or self.config.get("datamodule.shape") or "")


def fill_from_folder(run: Run) -> Run:
    """Add what the run's folder holds: settings, results, curves; what cannot be read becomes one of its problems."""
    config = _mapping(run.folder / "config.yaml", run.problems, lambda text: yaml.load(text, _LOADER))
    summary = _mapping(run.folder / "summary.json", run.problems, json.loads)
    evaluation = _mapping(run.folder / "evaluation.json", run.problems, json.loads)
    run.started = str(_mapping(run.folder / "status.json", run.problems, json.loads).get("started") or "")
    run.config = flatten({key: value for key, value in config.items() if key not in _HIDDEN})
    used = summary.pop("config", None)
    run.effective = effective(run.config, used if isinstance(used, dict) else {}, summary)
    run.curves = read_curves(run.folder, run.problems)
    run.values = {name: last(curve) for name, curve in run.curves.items()}
    run.values.update(numbers(summary))
    if run.seconds is None:
        run.seconds = run.values.get("seconds")
    values, run.floors = evaluation_values(evaluation, run.problems)
    run.values.update(values)
    return run


def effective(config: dict[str, Any], used: dict[str, Any], summary: dict[str, Any]) -> dict[str, Any]:
    """Return the settings as used: what the fit chose by itself stands in its summary."""
    chosen = {key: value for key, value in flatten(used).items() if not key.startswith(_HIDDEN)}
    result = {**config, **{key: value for key, value in chosen.items() if config.get(key) is None}}
    observations = summary.get("observations")
    if result.get("num_observations") is None and isinstance(observations, list) and observations:
        result["num_observations"] = observations[0]
    regulariser = result.get("regulariser.name", result.get("regulariser"))
    if result.get("regulariser_weight") is None and regulariser == "none":
        result["regulariser_weight"] = 0
    return result


def evaluation_values(evaluation: dict[str, Any], problems: list[str]) -> tuple[dict[str, float], dict[str, float]]:
    """Return (values, floors) of an evaluation.json, by `task/protocol/metric` and `task/protocol/floor/metric`."""
    values = numbers({"validation": evaluation.get("validation")})
    floors: dict[str, float] = {}
    try:
        for name, result in (evaluation.get("evaluations") or {}).items():
            values.update({f"{name}/{key}": value for key, value in numbers(result.get("values") or {}).items()})
            for floor, found in (result.get("floors") or {}).items():
                floors.update({f"{name}/{floor}/{key}": value for key, value in numbers(found).items()})
    except AttributeError:
        problems.append("evaluation.json: is not an evaluation")
    return values, floors


def numbers(values: dict[str, Any]) -> dict[str, float]:
    """Return the finite numbers of a mapping; a list of one number counts as that number."""
    found = {}
    for key, value in values.items():
        single = value[0] if isinstance(value, list) and len(value) == 1 else value
        if isinstance(single, int | float) and not isinstance(single, bool) and np.isfinite(single):
            found[str(key)] = float(single)
    return found


def flatten(tree: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return a nested mapping as one of dotted keys.

    >>> flatten({"a": 1, "b": {"c": [1, 2], "d": {}}})
    {'a': 1, 'b.c': [1, 2]}
    """
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        flat.update(flatten(value, f"{prefix}{key}.") if isinstance(value, dict) else {f"{prefix}{key}": value})
    return flat


def is_there(path: Path) -> bool:
    """Tell whether a file or folder is there for us; one in a folder that we may not enter is not."""
    try:
        return path.exists()
    except OSError:
        return False


def last(curve: Curve) -> float:
    """Return the last value of a curve."""
    return float(curve[1][-1])


def _mapping(path: Path, problems: list[str], parse: Any) -> dict[str, Any]:
    """Return what a file holds; nothing where it is missing, a problem where it is damaged."""
    try:
        content = parse(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, yaml.YAMLError, RecursionError) as error:
        problems.append(f"{path.name}: cannot be read ({' '.join(str(error).split())})")
        return {}
    if not isinstance(content, dict):
        problems.append(f"{path.name}: holds no settings or results")
        return {}
    return content
