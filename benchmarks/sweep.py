"""A sweep of short fits: workers that share the cores against one run after the other."""

import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.tables import number, span, table
from benchmarks.timing import in_turns, ratio, spread
from n2n.sweeps.status import read_json, read_status
from n2n.sweeps.store import RunInfo, Sweep

TITLE = "Sweep"
TRIAL = {"runs": 2, "rounds": 1, "settings": ["iterations=5", "plan_reuse=5", "datamodule.points=300"]}
_THROUGHPUT, _OVERHEAD = 1.7, 3.0  # what is to be reached: times the serial throughput; seconds a run


def run(runs: int = 24, rounds: int = 3, settings: Sequence[str] = ("debug=default",)) -> dict[str, Any]:
    """Measure.

    Args:
        runs: Of the sweep, which varies the seed.
        rounds: Turns.
        settings: `key=value` settings of every fit.
    """
    ways = [partial(_sweep, runs, [*settings, f"hydra/launcher={launcher}"]) for launcher in ("basic", "joblib")]
    serial, parallel = in_turns(*ways, rounds=rounds)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return {
        "runs": runs,
        "settings": list(settings),
        "cores": cores,
        "serial": _summary(serial),
        "parallel": _summary(parallel),
        "throughput": ratio([one["seconds"] for one in serial], [one["seconds"] for one in parallel]),
    }


def render(result: dict[str, Any]) -> str:
    rows = [
        [name, *(span(result[key][what], " s") for what in ("seconds", "processor", "fit", "beside", "start"))]
        for name, key in (("one after the other", "serial"), (f"{result['cores']} processes", "parallel"))
    ]
    gain, beside = result["throughput"], result["parallel"]["beside"]["median"]
    load = span(result["parallel"]["load"])
    return "\n".join(
        [
            f"{result['runs']} runs of `n2n fit -m {' '.join(result['settings'])}` that differ in their seed, with "
            "`hydra/launcher=basic`, one process with all cores, and with the default, `joblib`. The whole command "
            "counts; a fit is what `summary.json` calls its seconds.",
            "",
            table(
                ["", "whole sweep", "processor time", "one fit", "a worker beside it, per run", "to the first run"],
                rows,
            ),
            "",
            f"Throughput: {span(gain)} times that of one after the other"
            f"{_verdict(gain['median'] >= _THROUGHPUT, f'at least {_THROUGHPUT} on 2 cores')}. A run costs a worker "
            f"{number(beside)} s beside its fit{_verdict(beside < _OVERHEAD, f'less than {_OVERHEAD:g} s')}. "
            f"Processes that wanted to run meanwhile (load): {load}.",
        ]
    )


def launch(folder: Path, arguments: Sequence[str]) -> None:
    """Run `n2n` in a folder.

    Raises:
        RuntimeError: It failed.
    """
    command = [str(Path(sys.executable).parent / "n2n"), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed with code {done.returncode}: {done.stderr.strip()[-600:]}")


def _sweep(runs: int, settings: Sequence[str]) -> dict[str, float]:
    """Run one sweep; return seconds: of all, a fit, a worker beside its fits, until a run began; the load."""
    seeds = ",".join(map(str, range(runs)))
    with tempfile.TemporaryDirectory() as name:
        folder, begin, start, before = Path(name), time.time(), time.perf_counter(), os.times()
        launch(folder, ["fit", "-m", "sweep=bench", f"seed={seeds}", *settings])
        seconds, after = time.perf_counter() - start, os.times()
        processor = sum(after[2:4]) - sum(before[2:4])
        found = Sweep.open(folder / "sweeps/bench").runs
        fits = sum(float(read_json(one.folder / "summary.json")["seconds"]) for one in found)
        workers = defaultdict[int, list[tuple[float, float]]](list)
        for one in found:
            workers[read_status(one.folder)["pid"]].append(_span(one))
        busy = sum(max(end for _, end in spans) - min(first for first, _ in spans) for spans in workers.values())
        return {
            "seconds": seconds,
            "fit": fits / runs,
            "beside": (busy - fits) / runs,
            "start": min(first for spans in workers.values() for first, _ in spans) - begin,
            "processor": processor,
            "load": os.getloadavg()[0],
        }


def _span(run: RunInfo) -> tuple[float, float]:
    """Return when a run began and ended; its status is written last."""
    end = (run.folder / "status.json").stat().st_mtime
    return end - float(run.seconds or 0), end


def _summary(turns: Sequence[dict[str, float]]) -> dict[str, dict[str, float]]:
    return {key: spread([one[key] for one in turns]) for key in turns[0]}


def _verdict(is_reached: bool, wanted: str) -> str:
    return f" (wanted: {wanted})" if is_reached else f" (**wanted: {wanted}**)"
