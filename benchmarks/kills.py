"""SIGKILL at random moments during a sweep, then resume: `python -m benchmarks.kills [--kills 20] [--runs 24]`."""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch

from n2n.sweeps.status import FIELD_FILE
from n2n.sweeps.store import RunInfo, Sweep

N2N = Path(sys.executable).parent / "n2n"
# Short fits that leave a checkpoint now and then; how many depends on the machine.
FIT = ("datamodule.points=400", "plan_reuse=5", "iterations=150", "checkpoint_every=30", "logger=none")
_LAUNCHES = 60  # more would mean that nothing gets done


@dataclass
class Observed:
    """What was seen of a sweep that was killed again and again.

    Attributes:
        kills: Moments and targets: `all` its processes, or one `worker`.
        launches: Commands begun, the first one and those that resumed.
        seconds: All together.
        code: Exit code of the last command.
        finished: Per run, when its field was first seen: (modified, in ns; content).
        fitted_twice: Runs whose field was written again after it was there.
        interrupted: Attempts that were killed.
    """

    kills: list[tuple[str, float]] = field(default_factory=list)
    launches: int = 0
    seconds: float = 0.0
    code: int | None = None
    finished: dict[str, tuple[int, bytes]] = field(default_factory=dict)
    fitted_twice: set[str] = field(default_factory=set)
    interrupted: int = 0

    def look(self, sweep: Sweep) -> None:
        """Compare finished runs with what they were."""
        for run in sweep.runs:
            path = run.folder / FIELD_FILE
            if path.exists():
                now = (path.stat().st_mtime_ns, path.read_bytes())
                if self.finished.setdefault(run.hash, now) != now:
                    self.fitted_twice.add(run.hash)


def disturbed(folder: Path, runs: int, kills: int, seed: int, longest: float) -> Observed:
    """Run a sweep in `folder`, kill it at random moments and resume it until it is done.

    Args:
        folder: Where sweeps/ will be.
        runs: Of the sweep.
        kills: Those that came after the last run had ended count as well; see `Observed.kills` for the moments.
        seed: Of moments and targets.
        longest: Seconds to the next kill at most: from a start or the kill before, or once a run is being fitted.
    """
    choose, seen, start = random.Random(seed), Observed(), time.monotonic()
    while seen.launches < _LAUNCHES and seen.code != 0:
        process = _begin(folder, _next(folder) if seen.launches else command(runs, "killed"))
        seen.launches += 1
        while len(seen.kills) < kills:
            # As the processes start, or while they fit: on a busy machine the one may take longer than the other.
            if choose.random() < 0.5:
                _await_work(process, folder / "sweeps/killed")
            if _ends_within(process, choose.uniform(0.0, longest)):
                break
            workers = _workers(process.pid)
            target = choose.choice(["all", "worker"] if workers else ["all"])
            seen.kills.append((target, time.monotonic() - start))
            if target == "worker":
                os.kill(choose.choice(workers), signal.SIGKILL)
            else:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                break
        seen.code = process.wait()
        if (folder / "sweeps/killed/sweep.json").exists():
            seen.look(Sweep.open(folder / "sweeps/killed"))
        else:
            seen.launches = 0  # killed before there was anything to resume
    sweep = Sweep.open(folder / "sweeps/killed")
    seen.look(sweep)
    seen.interrupted = sum(run.attempt for run in sweep.runs) - len(sweep.runs)
    seen.seconds = time.monotonic() - start
    return seen


def undisturbed(folder: Path, runs: int) -> None:
    """Run the same sweep in peace, one run after the other."""
    code = _begin(folder, [*command(runs, "calm"), "hydra/launcher=basic"]).wait()
    if code:
        raise RuntimeError(f"the undisturbed sweep failed with code {code}: {(folder / 'log.txt').read_text()[-500:]}")


def command(runs: int, name: str) -> list[str]:
    """Return the arguments of a sweep over the seed."""
    return ["fit", "-m", f"sweep={name}", f"seed={','.join(map(str, range(runs)))}", *FIT]


def differences(folder: Path) -> list[str]:
    """Return the runs whose fields are not the same, bit for bit, in both sweeps; or that one of them lacks."""
    killed = {run.hash: run for run in Sweep.open(folder / "sweeps/killed").runs}
    calm = {run.hash: run for run in Sweep.open(folder / "sweeps/calm").runs}
    assert killed.keys() == calm.keys()
    return [name for name in calm if not _equal(calm[name], killed[name])]


def report(seen: Observed, runs: Iterable[RunInfo], different: list[str]) -> dict[str, Any]:
    """Return what was seen as plain data."""
    runs = list(runs)
    return {
        "kills": len(seen.kills),
        "of all processes": sum(target == "all" for target, _ in seen.kills),
        "launches": seen.launches,
        "seconds": round(seen.seconds, 1),
        "exit code": seen.code,
        "runs": len(runs),
        "done": sum(run.state == "done" for run in runs),
        "attempts killed": seen.interrupted,
        "fitted again after they were done": len(seen.fitted_twice),
        "different from an undisturbed sweep": len(different),
    }


def _next(folder: Path) -> list[str]:
    """Return what a user would say: `retry` where a run was given up because it was killed thrice, alone too."""
    has_failed = any(run.state == "failed" for run in Sweep.open(folder / "sweeps/killed").runs)
    return ["sweep", "retry" if has_failed else "resume", "killed"]


def _begin(folder: Path, arguments: list[str]) -> subprocess.Popen[bytes]:
    # One thread: with more, sums are taken in varying order. A session of its own: one signal reaches all of it.
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    with (folder / "log.txt").open("ab") as log:
        return subprocess.Popen(
            [str(N2N), *arguments], cwd=folder, stderr=log, stdout=log, env=environment, start_new_session=True
        )


def _await_work(process: subprocess.Popen[bytes], folder: Path) -> None:
    """Return when some run is being fitted, or the command has ended."""
    while process.poll() is None:
        if (folder / "sweep.json").exists() and any(run.state == "running" for run in Sweep.open(folder).runs):
            return
        time.sleep(0.05)


def _ends_within(process: subprocess.Popen[bytes], seconds: float) -> bool:
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        return False
    return True


def _workers(parent: int) -> list[int]:
    """Return the processes that `parent` has started to fit runs."""
    tasks = Path(f"/proc/{parent}/task").glob("*/children")
    children = [int(pid) for task in tasks for pid in task.read_text().split()]
    return [pid for pid in children if b"popen_loky" in _arguments(pid)]


def _arguments(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def _equal(one: RunInfo, other: RunInfo) -> bool:
    paths = [run.folder / FIELD_FILE for run in (one, other)]
    if not all(path.exists() for path in paths):
        return False
    first, second = (torch.load(path, map_location="cpu", weights_only=True) for path in paths)
    weights = [_tensors(state) for state in (first, second)]
    return weights[0].keys() == weights[1].keys() and all(torch.equal(weights[0][k], weights[1][k]) for k in weights[0])


def _tensors(state: Any, name: str = "") -> dict[str, torch.Tensor]:
    """Return every tensor of a nested state."""
    if isinstance(state, torch.Tensor):
        return {name: state}
    items = state.items() if isinstance(state, dict) else enumerate(state) if isinstance(state, list | tuple) else ()
    return {key: value for part, inner in items for key, value in _tensors(inner, f"{name}.{part}").items()}


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.kills", description=__doc__)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--runs", type=int, default=24)
    parser.add_argument("--longest", type=float, default=6.0, help="seconds to a kill at most")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        undisturbed(folder, options.runs)
        seen = disturbed(folder, options.runs, options.kills, options.seed, options.longest)
        found = report(seen, Sweep.open(folder / "sweeps/killed").runs, differences(folder))
        print((folder / "log.txt").read_text(), file=sys.stderr)
    print(json.dumps(found, indent=1))
    sound = found["done"] == options.runs and not seen.fitted_twice and not found["different from an undisturbed sweep"]
    return 0 if sound and seen.code == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
