"""`n2n fit -m`: a sweep, made, extended or resumed."""

import os
import shlex
from collections.abc import Sequence

from n2n.cli.console import say
from n2n.cli.sweep_job import SweepJob
from n2n.cli.sweep_progress import watching
from n2n.compose import config_hash
from n2n.errors import ConfigError
from n2n.sweeps.command import check_jobs, is_about_launcher, take_name
from n2n.sweeps.data import Fingerprints
from n2n.sweeps.grid import Grid, Job, make_grid
from n2n.sweeps.launch import is_joblib, launch, optimise, set_processes
from n2n.sweeps.launchers import check_installed, told_threads
from n2n.sweeps.store import STATES, SWEEPS, Sweep
from n2n.sweeps.watch import Watch

_DONE, _NOT_DONE = 0, 2


class OtherRunsError(ConfigError):
    """The command of a sweep means other runs than when it was given."""


def run_multirun(
    settings: list[str], flags: list[str], states: Sequence[str] = STATES, resumed: Sweep | None = None
) -> int:
    """Fit every run of a command line that is not done.

    Args:
        settings: `key=value`, some with several values; sweep=NAME names the folder in sweeps/.
        flags: Hydra's own.
        states: Of the runs to fit. Those that are done are fitted again where their data have changed since.
        resumed: The sweep whose command this is; None where it is new or extended by it.

    Returns:
        Exit code: 0 where all runs of the sweep are done, else 2.

    Raises:
        ConfigError: Something is wrong with the command line; nothing was begun.
    """
    name, settings = take_name(settings)
    name = name or config_hash({"command": sorted(text for text in settings if not is_about_launcher(text))})
    grid = make_grid(settings, flags, resumed.folder if resumed else SWEEPS / name)
    if grid.jobs is None:
        check_jobs(settings, flags)
    check_installed(grid.master.hydra)
    threads = told_threads()
    sweep = _same(resumed, grid) if resumed else _plan(name, settings, flags, grid)
    jobs = None if grid.jobs is None else _wanted(sweep, grid.jobs, states)
    if jobs == []:
        return _report(grid, sweep)
    task = _task(grid, sweep, len(jobs) if jobs else None, threads)
    try:
        with watching(Watch(sweep, [job.hash for job in jobs] if jobs else None)):
            if jobs:
                launch(grid, sweep, jobs, task)
            else:
                optimise(grid, task)
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(f"`n2n sweep resume {shlex.quote(name)}` goes on where it stopped") from stop
    return _report(grid, sweep)


def _plan(name: str, settings: list[str], flags: list[str], grid: Grid) -> Sweep:
    if not grid.axes:
        raise ConfigError("-m, but no setting has several values; write them as key=a,b, or leave -m out")
    rest = [flag for flag in flags if flag not in ("-m", "--multirun")]
    planned = {job.hash: job.settings for job in grid.jobs or []}
    sweep = Sweep.plan(name, ["-m", f"sweep={name}", *rest, *settings], grid.axes, planned)
    say(f"sweep: {sweep.folder}, {len(sweep.planned) or 'several'} runs; `n2n sweep status {name}` looks in")
    return sweep


def _same(sweep: Sweep, grid: Grid) -> Sweep:
    """Return the sweep, after a check that its command still means the same runs."""
    if any(job.hash not in sweep.planned for job in grid.jobs or []):
        raise OtherRunsError(
            f"{sweep.folder}: its command means other runs than when it was made: the defaults in conf/ or n2n itself "
            f"have changed. To fit those, give the command again: n2n fit {shlex.join(sweep.command)}"
        )
    return sweep


def _wanted(sweep: Sweep, jobs: list[Job], states: Sequence[str]) -> list[Job]:
    """Return the jobs to fit."""
    runs, prints = {run.hash: run for run in sweep.runs}, Fingerprints()
    done = [job for job in jobs if runs[job.hash].state == "done"]
    found = {job.hash: prints.of(job.config) for job in done}
    # Data that cannot be read, on a disk that is away for instance, have not changed.
    changed = {name for name, data in found.items() if data is not None and data != runs[name].data}
    open_states = [state for state in states if state != "done"]
    wanted = [job for job in jobs if job.hash in changed or runs[job.hash].state in open_states]
    if len(wanted) < len(jobs):
        say(f"sweep: {len(wanted)} of {len(jobs)} runs to fit")
    if changed:
        say(f"sweep: the data of {len(changed)} finished runs have changed; they are fitted again")
    return wanted


def _task(grid: Grid, sweep: Sweep, runs: int | None, told: int | None) -> SweepJob:
    """Return what workers are to do, each with its share of this machine."""
    threads, parent = None, None
    if is_joblib(grid):
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        processes, share = set_processes(grid, cores, runs or cores)
        # Whoever says how many threads is obeyed.
        threads, parent = told or share, os.getpid()
        say(f"sweep: {processes} at a time, threads of each: {threads}")
    planned = None if grid.jobs is None else {" ".join(job.settings): job.hash for job in grid.jobs}
    return SweepJob(sweep.folder.absolute(), tuple(grid.axes), planned, threads, parent)


def _report(grid: Grid, sweep: Sweep) -> int:
    """Sum up; list every failure; say what to do next."""
    runs, name = sweep.runs, shlex.quote(sweep.name)
    failed = [run for run in runs if run.state == "failed"]
    elsewhere = sum(run.state == "running" for run in runs)
    rest = sum(run.state in ("pending", "stale") for run in runs)
    parts = [f"{sum(run.state == 'done' for run in runs)} of {len(runs)} done"]
    parts += [f"{len(failed)} failed"] if failed else []
    parts += [f"{elsewhere} running in other processes"] if elsewhere else []
    parts += [f"{rest} not done"] if rest else []
    say(f"sweep {sweep.name}: {', '.join(parts)}")
    for run in failed:
        say(f"  failed: {run.label}: {run.error}")
    # An optimiser does not try again what has failed.
    can_retry = failed and grid.jobs is not None
    verb = "retry" if can_retry else "resume" if rest else "status" if elsewhere else "results"
    say(f"next: n2n sweep {verb} {name}")
    return _NOT_DONE if failed or rest or elsewhere else _DONE
