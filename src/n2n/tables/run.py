"""Measure what a plan lacks: in processes of their own, resumable, past every failure."""

import functools
import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from n2n.tables.plan import Job, Plan, cores
from n2n.tables.store import Store

Told = Callable[[Job, str], None]


def run(plan: Plan, store: Store, workers: int, again: bool = False, told: Told | None = None) -> list[tuple[Job, str]]:
    """Run all jobs that are not done.

    Args:
        plan: What is wanted.
        store: Where results go, each as soon as it is there.
        workers: Processes at a time.
        again: Also what was done by other sources.
        told: Called as told(job, error) after each job; the error is empty where it is done.

    Returns:
        The failures, each with its reason.
    """
    jobs = plan.open(store) + (plan.stale(store) if again else [])
    failures: list[tuple[Job, str]] = []

    def finish(job: Job, record: dict) -> None:
        store.write(job.fit, record)
        error = record.get("error", "")
        if error:
            failures.append((job, error))
        if told:
            told(job, error)

    # A worker that dies takes its pool along and all that waited there; who is left gets a new pool, one job at a time.
    measure = functools.partial(_measure, samples=plan.profile.samples)
    waiting = _pass(measure, jobs, workers, finish)
    for job in waiting:
        for lost in _pass(measure, [job], 1, finish):
            finish(lost, {"status": "failed", "error": "the process was killed, most likely for want of memory"})
    return failures


def _pass(
    measure: Callable[[Job], dict], jobs: list[Job], workers: int, finish: Callable[[Job, dict], None]
) -> list[Job]:
    """Run jobs; return those that were lost because a process died."""
    lost: list[Job] = []
    if not jobs:
        return lost
    with _threads(max(1, cores() // workers)), _pool(workers) as pool:
        running = {pool.submit(measure, job): job for job in jobs}
        try:
            for future in as_completed(running):
                try:
                    finish(running[future], future.result())
                except BrokenProcessPool:
                    lost.append(running[future])
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return lost


def _measure(job: Job, samples: int | None) -> dict:
    # Imported where it runs: the parent process needs no torch.
    from n2n.tables.measure import measure

    return measure(job.fit, job.evaluations, samples)


@contextmanager
def _pool(workers: int):
    # `spawn`: a forked process would share the threads and locks of torch.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        yield pool


@contextmanager
def _threads(count: int):
    """Give each process its share of the cores; numerical libraries read this when they are imported."""
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, str(count)))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name)
            else:
                os.environ[name] = value
