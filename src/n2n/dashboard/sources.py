"""From what the user names to runs: run folders, sweeps, folders of runs, results of `n2n tables`."""

from collections.abc import Sequence
from pathlib import Path

from n2n.dashboard.records import is_results, read_records
from n2n.dashboard.run import Run, fill_from_folder, is_there
from n2n.errors import InputError, N2NError
from n2n.sweeps.store import STATES, SWEEPS, RunInfo, Sweep

RUNS = Path("runs")
_MARKS = ("config.yaml", "status.json")  # any of them makes a folder a run
_DAMAGE = (N2NError, OSError, ValueError, TypeError, AttributeError)  # what a damaged status or sweep.json raises


def read_runs(names: Sequence[str] = ()) -> list[Run]:
    """Return the runs that were named, each once, in order; damaged ones say so themselves.

    Args:
        names: Paths, or names in sweeps/ and runs/; empty: everything in both.

    Raises:
        InputError: A name is nowhere, or a folder holds no runs.
    """
    if not names:
        found = [run for folder in (SWEEPS, RUNS) if folder.is_dir() for run in _children(folder)]
    else:
        found = [run for name in names for run in _named(name)]
    return list({run.folder.resolve(): run for run in found}.values())


def _named(name: str) -> list[Run]:
    candidates = [Path(name), SWEEPS / name, RUNS / name]
    folder = next((path for path in candidates if path.is_dir()), None)
    if folder is None:
        raise InputError(
            f"{name}: there is no such run or sweep, neither here nor in runs/ or sweeps/; see `ls runs sweeps`"
        )
    runs = _read(folder)
    if not runs and not _is_empty(folder):
        raise InputError(
            f"{folder}: holds no runs; give a run folder (config.yaml), a sweep (sweep.json), a folder of those, or a "
            "results folder of n2n tables"
        )
    return runs


def _read(folder: Path) -> list[Run]:
    """Return the runs of a folder of any kind."""
    if is_there(folder / "sweep.json"):
        return _sweep(folder)
    if _is_run(folder):
        return [_run(folder)]
    if is_results(folder):
        return read_records(folder)
    return _children(folder)


def _children(folder: Path) -> list[Run]:
    runs: list[Run] = []
    for child in _folders(folder):
        if is_there(child / "sweep.json"):
            runs += _sweep(child)
        elif _is_run(child):
            runs.append(_run(child))
        elif is_results(child):
            runs += read_records(child)
    return runs


def _sweep(folder: Path) -> list[Run]:
    try:
        return [_from(info, folder.name) for info in Sweep.open(folder).runs]
    except _DAMAGE as error:
        # What is there can be shown without the list of what is still to come.
        found = [_run(path, folder.name) for path in _folders(folder / "runs")]
        for run in found:
            run.problems.append(str(error))
        return found


def _run(folder: Path, sweep: str = "") -> Run:
    try:
        return _from(RunInfo.read(folder), sweep)
    except _DAMAGE as error:
        run = Run(folder.resolve().name, folder, sweep, state="failed", error="the run's status cannot be read")
        run.problems.append(f"status.json: {error}")
        return fill_from_folder(run)


def _from(info: RunInfo, sweep: str) -> Run:
    known = info.state in STATES
    run = Run(
        id=info.folder.resolve().name,
        folder=info.folder,
        sweep=sweep,
        state=info.state if known else "failed",
        error=" ".join(str(info.error or "").split()),
        seconds=info.seconds if isinstance(info.seconds, int | float) else None,
        attempt=info.attempt if isinstance(info.attempt, int) else 0,
        swept={str(key): str(value) for key, value in info.settings.items()},
        heartbeat=info.heartbeat,
    )
    if not known:
        run.problems.append(f"status.json: unknown state {info.state!r}")
    return fill_from_folder(run)


def _is_run(folder: Path) -> bool:
    return any(is_there(folder / mark) for mark in _MARKS)


def _folders(folder: Path) -> list[Path]:
    """Return the folders in a folder, sorted; none where it is missing.

    Raises:
        InputError: It may not be read.
    """
    try:
        return sorted(path for path in folder.iterdir() if path.is_dir())
    except FileNotFoundError:
        return []
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror}); name the runs one by one") from error


def _is_empty(folder: Path) -> bool:
    return not any(folder.iterdir())
