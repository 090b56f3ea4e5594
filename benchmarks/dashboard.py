"""The dashboard of a large sweep: how long its page takes to build, and how large it is."""

import csv
import json
import random
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.processes import n2n
from benchmarks.tables import megabytes, span, table
from benchmarks.timing import spread
from n2n.cli.job import fit_job
from n2n.compose import compose
from n2n.dashboard.page import MEDIA_MEGABYTES

TITLE = "Dashboard"
_SETTINGS = ("iterations=40", "media=true", "evaluate=[denoise/sbp]")
TRIAL = {"runs": 3, "rows": 20, "rounds": 1, "overrides": ["iterations=10", "datamodule.points=300", "media=false"]}


def run(runs: int = 200, rows: int = 1000, rounds: int = 3, overrides: Sequence[str] = _SETTINGS) -> dict[str, Any]:
    """Measure.

    Args:
        runs: Of the sweep: copies of one real run, each with its own seed and noise of its curves.
        rows: Of every run's log.
        rounds: How often each page is built.
        overrides: Settings of the fit that is copied.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sweep = _sweep(fit_job(compose(overrides), folder / "original"), folder / "sweeps" / "many", runs, rows)
        pages = [_page(sweep, folder / "page.html", room, rounds) for room in (0, MEDIA_MEGABYTES)]
    return {"runs": runs, "rows": rows, "rounds": rounds, "pages": pages}


def render(result: dict[str, Any]) -> str:
    rows = [
        [
            "none" if not page["room"] else f"{page['room']:g} MB (the default)",
            span(page["seconds"], " s"),
            megabytes(page["bytes"]),
            page["pictures"],
            page["scenes"],
        ]
        for page in result["pages"]
    ]
    return "\n".join(
        [
            f"`n2n dashboard` of a sweep of {result['runs']} runs: one real run, copied, with a log of "
            f"{result['rows']:,} lines each, pictures and meshes. The whole command, {result['rounds']} times each.",
            "",
            table(["room for media", "time", "page", "pictures in it", "3D views in it"], rows),
        ]
    )


def _page(sweep: Path, page: Path, room: int, rounds: int) -> dict[str, Any]:
    seconds = [n2n("dashboard", sweep, "-o", page, "--media", room).seconds for _ in range(rounds)]
    data = json.loads(page.read_text().split('id="data">')[1].split("</script>")[0])
    return {
        "room": room,
        "seconds": spread(seconds),
        "bytes": page.stat().st_size,
        "pictures": sum("picture" in one for one in data["runs"]),
        "scenes": sum("scene" in one for one in data["runs"]),
    }


def _sweep(original: Path, sweep: Path, runs: int, rows: int) -> Path:
    """Copy a run into a sweep, with a longer log that differs from run to run."""
    config = (original / "config.yaml").read_text()
    with (original / "metrics.csv").open(newline="") as file:
        *_, last = csv.DictReader(file)
    for seed in range(runs):
        folder = sweep / "runs" / f"{seed:010x}"
        shutil.copytree(original, folder)
        (folder / "config.yaml").write_text(config.replace("seed: 0", f"seed: {seed}", 1))
        draw = random.Random(seed)
        with (folder / "metrics.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(last)
            for step in range(rows):
                writer.writerow(
                    step if name == "step" else float(value or 0) * draw.uniform(0.5, 2) for name, value in last.items()
                )
        status = {"state": "done", "attempt": 1, "settings": [f"seed={seed}"], "started": "2026-01-01T00:00:00"}
        (folder / "status.json").write_text(json.dumps({**status, "seconds": draw.uniform(5, 50)}))
    axes = {"seed": [str(seed) for seed in range(runs)]}
    record = {"name": sweep.name, "command": [], "created": "2026-01-01T00:00:00", "axes": axes}
    planned = {f"{seed:010x}": {"settings": [f"seed={seed}"]} for seed in range(runs)}
    (sweep / "sweep.json").write_text(json.dumps({**record, "runs": planned}))
    return sweep
