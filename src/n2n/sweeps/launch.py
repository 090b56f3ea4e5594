"""Runs handed to one of Hydra's launchers, past workers that die."""

import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from typing import Any

from hydra._internal.callbacks import Callbacks
from hydra.core.global_hydra import GlobalHydra
from hydra.core.plugins import Plugins
from hydra.types import HydraContext
from joblib import Parallel, delayed
from joblib.externals.loky import get_reusable_executor
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


def is_joblib(master: Any) -> bool:
    """Return whether the launcher of a composed configuration is the one for processes on this machine."""
    return str(master.hydra.launcher._target_).endswith(_JOBLIB)


def share_cores(master: Any, cores: int, runs: int) -> tuple[int, int]:
    """Return how many processes the launcher joblib is to have, and threads for each.

    Args:
        master: The composed configuration; `hydra.launcher.n_jobs` that the user gave counts.
        cores: To be shared.
        runs: There are.
    """
    asked = int(master.hydra.launcher.n_jobs)
    processes = asked if asked > 0 else max(1, min(cores, runs))
    return processes, max(1, cores // processes)


def set_processes(master: Any, processes: int) -> None:
    """Tell the launcher joblib, in the composed configuration."""
    launcher = master.hydra.launcher
    with read_write(master), open_dict(master):
        launcher.n_jobs = processes
        launcher.batch_size = "1"  # joblib would put short runs together, and one failure would take all of them


def start_workers(master: Any, processes: int, work: Callable[[], object]) -> threading.Thread:
    """Start joblib's processes, and do something in each; returns at once.

    joblib keeps its processes, and the launcher finds them. So they import what runs need while others compose.

    Args:
        master: The composed configuration.
        processes: That the launcher will be told to have.
        work: Called in each process; a function of a module.

    Returns:
        What is joined before the launcher starts.
    """
    options = {key: value for key, value in master.hydra.launcher.items() if key != "_target_"}
    options |= {"n_jobs": processes, "backend": "loky", "batch_size": 1}  # as the launcher will have them

    def start() -> None:
        # A process that cannot start fails the launch as well, which knows what to do about it.
        with suppress(Exception):
            Parallel(**options)([delayed(work)()] * processes)

    thread = threading.Thread(target=start, name="n2n-start-workers", daemon=True)
    thread.start()
    return thread


def end_workers() -> None:
    """End joblib's processes, which have nothing to do; joblib itself would take two seconds to."""
    get_reusable_executor(reuse=True).shutdown(kill_workers=True)


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
