"""The workers of a plan, started through one of Hydra's launchers: on this machine, a cluster, or anywhere."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from n2n.sweeps.launchers import start, told_threads
from n2n.tables.plan import Job, Plan, cores
from n2n.tables.run import run
from n2n.tables.shared import failed_since, now, open_jobs
from n2n.tables.store import Store

_WORKERS = ".workers"  # in the results folder: the launcher's logs
_ON_THIS_MACHINE = ("local", "joblib")


@dataclass(frozen=True)
class Worker:
    """One of several processes that measure a plan together; travels to its machine as a pickle.

    Attributes:
        plan: What is wanted.
        results: Folder of results, absolute.
        again: Also what was done by other sources.
        since: When the workers were started, by the clock of the folder.
        home: Folder in which the command was given; paths of data may be relative to it.
    """

    plan: Plan
    results: Path
    again: bool
    since: float
    home: Path

    def __call__(self) -> None:
        """Measure until nothing is left that nobody is at."""
        os.chdir(self.home)
        run(self.plan, Store(self.results), 1, self.again, _tell, self.since, told_threads())


def launch(
    plan: Plan, store: Store, workers: int, launcher: str, settings: Sequence[str] = (), again: bool = False
) -> list[tuple[Job, str]]:
    """Measure what is open with workers that a launcher starts, a fit at a time each; return once all have ended.

    Args:
        plan: What is wanted.
        store: Where results go; a folder that all workers see under this path.
        workers: How many; no more than there are fits.
        launcher: An option of conf/hydra/launcher, e.g. slurm_gpu.
        settings: Of the launcher, e.g. hydra.launcher.partition=gpu.
        again: Also what was done by other sources.

    Returns:
        The failures, each with its reason.

    Raises:
        ConfigError: The launcher is not there or cannot use its settings.
    """
    jobs = open_jobs(plan, store, again)
    if not jobs:
        return []
    since, workers = now(store), min(workers, len(jobs))
    told = told_threads()  # what is wrong with it is said here, not by every worker
    if launcher in _ON_THIS_MACHINE and told is None:
        os.environ["OMP_NUM_THREADS"] = str(max(1, cores() // workers))
    worker = Worker(plan, store.folder.absolute(), again, since, Path.cwd())
    start(launcher, settings, worker.results / _WORKERS, workers, worker)
    return [(job, error) for job in jobs if (error := failed_since(job.fit, store, since))]


def _tell(job: Job, error: str) -> None:
    """Say in the worker's log how it goes."""
    print(f"{'failed' if error else 'done'}: {job.fit.datamodule} {job.fit.shape} {error}".rstrip(), flush=True)
