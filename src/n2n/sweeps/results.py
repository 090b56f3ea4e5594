"""The results of a sweep as rows: what was varied, then what came out."""

import csv
import io
import json
from pathlib import Path
from typing import Any

from n2n.formats.atomic import atomic_path, check_writable
from n2n.sweeps.status import read_json
from n2n.sweeps.store import RunInfo, Sweep

WRITES = (".csv", ".json")
_REPORTED = ("iterations", "noise", "spacing")


def rows(sweep: Sweep) -> list[dict[str, Any]]:
    """Return one row a run: hash, state, settings, seconds, iterations, noise, spacing, validation, evaluations, error.

    Noise and spacing are in the scan's units; of a run with several shapes each has its own column. Values of
    evaluations are raw, as `evaluation.json` holds them. All rows have the same keys, None where there is no value.
    """
    found = [_row(run, list(sweep.axes)) for run in sweep.runs]
    keys = dict.fromkeys(key for row in found for key in row if key != "error")
    return [{key: row.get(key) for key in [*keys, "error"]} for row in found]


def as_csv(table: list[dict[str, Any]]) -> str:
    """Return rows as CSV with a header; empty where there is no value."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(table[0]) if table else [], lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    return text.getvalue()


def write(table: list[dict[str, Any]], path: Path) -> None:
    """Write rows to a .csv or .json file.

    Raises:
        OutputError: Another ending, or it cannot be written.
    """
    check_writable(path, WRITES)
    text = as_csv(table) if path.suffix.lower() == ".csv" else json.dumps(table, indent=1) + "\n"
    with atomic_path(path) as temporary:
        temporary.write_text(text)


def _row(run: RunInfo, axes: list[str]) -> dict[str, Any]:
    keys = dict.fromkeys([*axes, *run.settings])
    row: dict[str, Any] = {"run": run.hash, "state": run.state, **{key: run.settings.get(key) for key in keys}}
    row["seconds"] = run.seconds
    if run.state == "done":
        summary, evaluation = read_json(run.folder / "summary.json"), read_json(run.folder / "evaluation.json")
        for key in _REPORTED:
            row |= _columns(key, summary.get(key))
        row["validation"] = evaluation.get("validation")
        for name, one in evaluation.get("evaluations", {}).items():
            row |= {f"{name}/{key}": value for key, value in one["values"].items()}
    return {**row, "error": run.error}


def _columns(key: str, value: Any) -> dict[str, Any]:
    """Return one column, or one for each shape of several."""
    if not isinstance(value, list):
        return {key: value}
    if len(value) == 1:
        return {key: value[0]}
    return {f"{key}[{shape}]": one for shape, one in enumerate(value)}
