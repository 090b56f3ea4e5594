"""How time and memory of `n2n denoise` grow with points and with observations."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.processes import n2n
from benchmarks.scene import write_scans
from benchmarks.tables import megabytes, number, table

TITLE = "Scaling"
TRIAL = {"points": [300], "observations": [2], "each": 300, "settings": ["iterations=10"]}


def run(
    points: Sequence[int] = (5_000, 10_000, 50_000, 200_000, 1_000_000),
    observations: Sequence[int] = (1, 10, 50, 200),
    each: int = 10_000,
    settings: Sequence[str] = (),
) -> dict[str, Any]:
    """Measure.

    Args:
        points: Sizes of a single cloud.
        observations: Numbers of clouds.
        each: Points of each of these.
        settings: key=value settings of the fit.
    """
    with tempfile.TemporaryDirectory() as folder:
        return {
            "each": each,
            "points": [_row(Path(folder), count, 1, settings) for count in points],
            "observations": [_row(Path(folder), each, count, settings) for count in observations],
        }


def render(result: dict[str, Any]) -> str:
    def rows(name: str, column: str) -> list[list[str]]:
        return [[f"{row[column]:,}", f"{number(row['seconds'])} s", megabytes(row["peak"])] for row in result[name]]

    return "\n".join(
        [
            "`n2n denoise`, one run each: wall time of the whole process and its peak memory.",
            "",
            table(["points", "wall", "peak memory"], rows("points", "points")),
            "",
            table([f"observations of {result['each']:,}", "wall", "peak memory"], rows("observations", "observations")),
        ]
    )


def _row(folder: Path, points: int, observations: int, settings: Sequence[str]) -> dict[str, Any]:
    clouds = write_scans(folder, points, observations)
    usage = n2n("denoise", *clouds, "-o", folder / "clean.npy", "-q", "--device", "cpu", *settings)
    return {"points": points, "observations": observations, "seconds": usage.seconds, "peak": usage.peak}
