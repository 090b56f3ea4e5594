"""Runs handed to one of Hydra's launchers, past workers that die."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from hydra._internal.callbacks import Callbacks
from hydra.core.global_hydra import GlobalHydra
from hydra.core.plugins import Plugins
from hydra.types import HydraContext
from omegaconf import OmegaConf, open_dict, read_write

from n2n.errors import ConfigError, N2NError
from n2n.sweeps.attempt import give_up, message
from n2n.sweeps.grid import Grid, Job
from n2n.sweeps.store import RunInfo, Sweep

Task = Callable[[Any], Any]
_JOBLIB = "JoblibLauncher"
_TRIES = 2  # beside others; then alone, to see whether it is this run that kills its process
_STARTS = 5  # of workers that all die before they begin anything
_KILLED = "its process was killed each time, alone as well; most likely for want of memory"
_NO_WORKERS = (
    "the workers die before they begin a run; `n2n doctor` says whether the installation is sound, and "
    "hydra/launcher=serial fits one run after the other without them"
)


def launch(grid: Grid, sweep: Sweep, jobs: Sequence[Job], task: Task) -> None:
    """Run jobs with the launcher that the configuration names; returns once all have ended or failed.

    A worker that is killed takes those beside it along. Each goes on from its checkpoint; one that was killed twice is
    tried alone, and fails if that is killed too.

    Args:
        grid: The composed sweep.
        sweep: Where its runs are.
        jobs: Those wanted.
        task: Called in a worker with a job's composed configuration.

    Raises:
        ConfigError: The launcher is not there or cannot use its settings.
        OutputError: The folder cannot be written.
    """
    killed: Counter[str] = Counter()
    first = {job.hash: _info(sweep, job).attempt for job in jobs}
    waiting, fruitless = list(jobs), 0
    while waiting:
        batch = [job for job in waiting if killed[job.hash] < _TRIES] or waiting[:1]
        before = {job.hash: _info(sweep, job).attempt for job in batch}
        try:
            _launch(grid, batch, task)
        except BrokenProcessPool:
            begun = [job for job in batch if _info(sweep, job).attempt > before[job.hash]]
            fruitless = 0 if begun else fruitless + 1
            if fruitless == _STARTS:
                raise ConfigError(_NO_WORKERS) from None
            for job in begun:
                if _info(sweep, job).state == "stale":
                    killed[job.hash] += 1
                    if killed[job.hash] > _TRIES:
                        give_up(sweep.run_dir(job.hash), job.settings, _KILLED)
            waiting = [job for job in waiting if not _has_ended(_info(sweep, job), first[job.hash])]
        else:
            waiting = [job for job in waiting if job not in batch]


def _has_ended(run: RunInfo, attempts: int) -> bool:
    return run.state in ("done", "failed") and run.attempt > attempts


def optimise(grid: Grid, task: Task) -> None:
    """Let an optimising sweeper choose runs until it has had enough.

    Raises:
        ConfigError: The sweeper is not there or cannot use its settings.
    """
    for left in reversed(range(_TRIES + 1)):
        try:
            with _hydra(grid):
                sweeper = Plugins.instance().instantiate_sweeper(
                    config=grid.master, hydra_context=_context(grid), task_function=task
                )
                sweeper.sweep(arguments=grid.arguments)
            return
        except BrokenProcessPool:
            # It knows what it has tried, and what was lost.
            if not left:
                raise ConfigError(f"workers were killed {_TRIES + 1} times; most likely for want of memory") from None


def is_joblib(grid: Grid) -> bool:
    """Return whether the launcher is the one for processes on this machine."""
    return str(grid.master.hydra.launcher._target_).endswith(_JOBLIB)


def set_processes(grid: Grid, cores: int, runs: int) -> tuple[int, int]:
    """Choose processes, and threads for each, for the launcher joblib.

    Args:
        grid: Its configuration is changed; `hydra.launcher.n_jobs` that the user gave is kept.
        cores: To be shared.
        runs: There are.

    Returns:
        Processes; threads of each.
    """
    launcher = grid.master.hydra.launcher
    processes = int(launcher.n_jobs) if int(launcher.n_jobs) > 0 else max(1, min(cores, runs))
    with read_write(grid.master), open_dict(grid.master):
        launcher.n_jobs = processes
        launcher.batch_size = "1"  # joblib would put short runs together, and one failure would take all of them
    return processes, max(1, cores // processes)


def _launch(grid: Grid, jobs: Sequence[Job], task: Task) -> None:
    with _hydra(grid):
        launcher = Plugins.instance().instantiate_launcher(
            hydra_context=_context(grid), task_function=task, config=grid.master
        )
        launcher.launch([job.overrides for job in jobs], initial_job_idx=0)


@contextmanager
def _hydra(grid: Grid) -> Iterator[None]:
    try:
        yield
    except (BrokenProcessPool, N2NError):
        raise
    except Exception as error:
        name = OmegaConf.select(grid.master, "hydra.runtime.choices.hydra/launcher")
        raise ConfigError(f"hydra/launcher={name}: {message(error)}") from error
    finally:
        GlobalHydra.instance().clear()


def _context(grid: Grid) -> HydraContext:
    return HydraContext(config_loader=grid.loader, callbacks=Callbacks(grid.master))


def _info(sweep: Sweep, job: Job) -> RunInfo:
    return RunInfo.read(sweep.run_dir(job.hash), job.settings)
