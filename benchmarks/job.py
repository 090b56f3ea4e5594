"""The whole job, `n2n denoise` and `n2n reconstruct`, in units of a fixed workload; compared with the last release."""

import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.processes import child, n2n
from benchmarks.scene import write_scans
from benchmarks.tables import megabytes, number, span, table
from benchmarks.timing import in_turns, ratio, spread

TITLE = "Whole job"
TRIAL = {"points": 300, "rounds": 1, "repeats": 1, "settings": ["iterations=10"]}
BASELINE = Path(__file__).with_name("baseline.json")
_OUTPUT = {"denoise": "clean.npy", "reconstruct": "mesh.ply"}


def run(
    points: int = 10_000,
    rounds: int = 3,
    repeats: int = 7,
    tasks: Sequence[str] = ("denoise", "reconstruct"),
    settings: Sequence[str] = (),
) -> dict[str, Any]:
    """Measure.

    Args:
        points: Of the cloud.
        rounds: Turns.
        repeats: Of the reference workload.
        tasks: Commands.
        settings: key=value settings of the fit.
    """
    result = {"points": points, "tasks": {}, "baseline": json.loads(BASELINE.read_text())}
    with tempfile.TemporaryDirectory() as folder:
        cloud = write_scans(Path(folder), points)[0]
        for task in tasks:
            command = [task, cloud, "-o", Path(folder) / _OUTPUT[task], "-q", "--device", "cpu", *settings]
            reference, usage = in_turns(
                lambda: child("reference", repeats)["seconds"],
                lambda command=command: n2n(*command),
                rounds=rounds,
            )
            times = [one.seconds for one in usage]
            result["tasks"][task] = {
                "seconds": spread(times),
                "reference": spread(reference),
                "ratio": ratio(times, reference),
                "peak": max(one.peak for one in usage),
            }
    return result


def render(result: dict[str, Any]) -> str:
    baseline = result["baseline"]
    recorded = baseline["ratios"]
    rows = []
    for task, row in result["tasks"].items():
        change = f"{100 * (row['ratio']['median'] / recorded[task] - 1):+.0f} %" if task in recorded else "-"
        rows.append(
            [
                f"`n2n {task}`",
                span(row["seconds"], " s"),
                megabytes(row["peak"]),
                span(row["reference"], " s"),
                span(row["ratio"]),
                number(recorded[task]) if task in recorded else "-",
                change,
            ]
        )
    release = f"release {baseline['release']}" if recorded else "no release recorded"
    header = ["command", "wall", "peak memory", "reference workload", "wall / reference", release, "change"]
    return "\n".join(
        [
            f"Whole processes, start to end, on a scan of {result['points']:,} points. The reference is a fixed "
            "computation (`benchmarks/reference.py`), measured in turns with the command; unlike seconds, their ratio "
            "can be compared between machines.",
            "",
            table(header, rows),
        ]
    )


def record(stored: dict[str, Any], release: str) -> None:
    """Keep the ratios of a stored result as those of a release."""
    ratios = {task: round(row["ratio"]["median"], 3) for task, row in stored["result"]["tasks"].items()}
    baseline = {"release": release, "ratios": ratios, "machine": stored["machine"]}
    BASELINE.write_text(json.dumps(baseline, indent=2) + "\n")
