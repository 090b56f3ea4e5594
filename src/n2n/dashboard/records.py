"""Results of `n2n tables` as runs: settings and numbers, without curves and pictures."""

import json
from pathlib import Path
from typing import Any

import yaml

from n2n.dashboard.run import Run, effective, evaluation_values, numbers


def is_results(folder: Path) -> bool:
    """Tell whether a folder holds results of `n2n tables`: DATAMODULE/SHAPE-ID.json."""
    return next(_files(folder), None) is not None


def read_records(folder: Path) -> list[Run]:
    """Return one run for each result; damaged files become failed runs that say so."""
    return [_read(path, folder) for path in sorted(_files(folder))]


def _files(folder: Path) -> Any:
    return (path for path in folder.glob("*/*-*.json") if len(path.stem.rpartition("-")[2]) == 12)


def _read(path: Path, folder: Path) -> Run:
    run = Run(id=path.stem, folder=path, sweep=folder.name, state="failed")
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        run.state = "failed" if record["status"] == "failed" else "done"
        run.error = str(record.get("error") or "")
        settings = dict(text.split("=", 1) for text in record["settings"])
        run.config = {
            "method": record["method"],
            "datamodule.name": record["datamodule"],
            "datamodule.shape": record["shape"],
            **{key: yaml.safe_load(value) for key, value in settings.items()},
        }
        run.effective = effective(run.config, {}, record.get("fit") or {})
        fit, cost, made = (record.get(key) or {} for key in ("fit", "cost", "made"))
        run.effective.setdefault("iterations", fit.get("iterations"))
        run.values, run.floors = evaluation_values({"evaluations": record.get("results")}, run.problems)
        run.values |= numbers(fit) | numbers(cost)
        run.seconds = run.values.get("seconds")
        run.started = str(made.get("date") or "")
        run.note = ", ".join(f"{key} {made[key]}" for key in ("n2n", "commit", "machine") if key in made)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, yaml.YAMLError) as error:
        run.state, run.error = "failed", run.error or "the result cannot be read"
        run.problems.append(f"{path.name}: is not a result of n2n tables ({type(error).__name__}: {error})")
    return run
