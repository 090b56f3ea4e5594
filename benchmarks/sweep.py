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
# Way -> launcher, threads of a fit; None for as many as there are cores.
_WAYS = {"serial": ("serial", "1"), "threads": ("serial", None), "parallel": ("joblib", None)}
_THROUGHPUT, _OVERHEAD = 1.7, 3.0  # what is to be reached: times the serial throughput; seconds a run


def run(runs: int = 24, rounds: int = 1, settings: Sequence[str] = ()) -> dict[str, Any]:
    """Measure.

    Args:
        runs: Of the sweep, which varies the seed.
        rounds: Turns.
        settings: `key=value` settings of every fit.
    """
    ways = [partial(_sweep, runs, [*settings, f"hydra/launcher={name}"], threads) for name, threads in _WAYS.values()]
    measured = dict(zip(_WAYS, in_turns(*ways, rounds=rounds), strict=True))
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    seconds = {way: [one["seconds"] for one in turns] for way, turns in measured.items()}
    return {
        "runs": runs,
        "settings": list(settings),
        "cores": cores,
        "ways": {way: _summary(turns) for way, turns in measured.items()},
        "throughput": {way: ratio(seconds[way], seconds["parallel"]) for way in ("serial", "threads")},
    }


def render(result: dict[str, Any]) -> str:
    names = {
        "serial": "one after the other, one core each",
        "threads": "one after the other, all cores each",
        "parallel": f"{result['cores']} processes, one core each",
    }
    told = ("seconds", "processor", "fit", "beside", "start")
    rows = [[name, *(span(result["ways"][way][what], " s") for what in told)] for way, name in names.items()]
    gain, beside = result["throughput"]["serial"], result["ways"]["parallel"]["beside"]["median"]
    load = span(result["ways"]["parallel"]["load"])
    return "\n".join(
        [
            f"{result['runs']} runs of `{' '.join(['n2n fit -m', *result['settings']])}` that differ in their seed, "
            "with `hydra/launcher=serial` and with the default, `joblib`. The whole command counts; a fit is what "
            "`summary.json` calls its seconds.",
            "",
            table(
                ["", "whole sweep", "processor time", "one fit", "a worker beside it, per run", "to the first run"],
                rows,
            ),
            "",
            f"Throughput: {span(gain)} times that of the same fits one after the other"
            f"{_verdict(gain['median'] >= _THROUGHPUT, f'at least {_THROUGHPUT} on 2 cores')}; "
            f"{span(result['throughput']['threads'])} times that of fits that take all cores each. A run costs a "
            f"worker {number(beside)} s beside its fit{_verdict(beside < _OVERHEAD, f'less than {_OVERHEAD:g} s')}. "
            f"Processes that wanted to run meanwhile (load): {load}.",
        ]
    )


def launch(folder: Path, arguments: Sequence[str], threads: str | None = None) -> None:
    """Run `n2n` in a folder, with so many threads if that is said.

    Raises:
        RuntimeError: It failed.
    """
    command = [str(Path(sys.executable).parent / "n2n"), *arguments]
    rest = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}
    environment = {**rest, "OMP_NUM_THREADS": threads} if threads else rest
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed with code {done.returncode}: {done.stderr.strip()[-600:]}")


def _sweep(runs: int, settings: Sequence[str], threads: str | None) -> dict[str, float]:
    """Run one sweep; return seconds: of all, a fit, a worker beside its fits, until a run began; the load."""
    seeds = ",".join(map(str, range(runs)))
    with tempfile.TemporaryDirectory() as name:
        folder, begin, start, before = Path(name), time.time(), time.perf_counter(), os.times()
        launch(folder, ["fit", "-m", "sweep=bench", f"seed={seeds}", *settings], threads)
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
