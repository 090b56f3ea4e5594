"""Measure what a plan lacks: in processes of their own, beside other machines, resumable, past every failure."""

import functools
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from n2n.tables.plan import Job, Plan, cores
from n2n.tables.shared import ELSEWHERE, MINE, Share, open_jobs
from n2n.tables.store import Store

Record = dict[str, Any]
Told = Callable[[Job, str], None]


def run(
    plan: Plan,
    store: Store,
    workers: int,
    again: bool = False,
    told: Told | None = None,
    since: float | None = None,
    threads: int | None = None,
) -> list[tuple[Job, str]]:
    """Run all jobs that are neither done nor being run by another process.

    Args:
        plan: What is wanted.
        store: Where results go, each as soon as it is there.
        workers: Processes at a time.
        again: Also what was done by other sources.
        told: Called as told(job, error) after each job, ours or not; the error is empty where it is done.
        since: What failed later is not tried again; see `n2n.tables.shared.Share`.
        threads: Of each process; None: its share of the cores.

    Returns:
        The failures, each with its reason.
    """
    failures: list[tuple[Job, str]] = []
    elsewhere: list[Job] = []

    def settle(job: Job, error: str) -> None:
        if error:
            failures.append((job, error))
        if told:
            told(job, error)

    def finish(job: Job, record: Record) -> None:
        error = record.get("error", "")
        before = store.read(job.fit)
        # A failure never replaces numbers; it is noted beside them, so that nobody else tries.
        is_lost = error and before is not None and before["status"] == "done"
        store.write(job.fit, {**before, "failed_again": error} if is_lost else record)
        share.release(job)
        settle(job, error)

    def take(job: Job) -> bool:
        state, error = share.take(job)
        if state == ELSEWHERE:
            elsewhere.append(job)
        elif state != MINE:
            settle(job, error)
        return state == MINE

    def measure_all(waiting: list[Job]) -> None:
        measure_with(workers, [job for job in waiting if not job.is_timed])
        # Beside others a fit takes longer: nothing else runs where the cost is the result.
        measure_with(1, [job for job in waiting if job.is_timed])

    def measure_with(workers: int, waiting: list[Job]) -> None:
        while waiting:
            # A process that dies takes its pool along. Each of those that were running is tried alone, to see which it
            # was.
            lost = _pass(measure, waiting, workers, finish, take, threads)
            suspects, waiting = lost[:workers], lost[workers:]
            for job in suspects:
                for guilty in _pass(measure, [job], 1, finish, take, threads):
                    finish(guilty, guilty.fit.failed("the process was killed, most likely for want of memory"))

    jobs = open_jobs(plan, store, again)
    if not jobs:
        return []
    measure = functools.partial(_measure, samples=plan.profile.samples)
    with Share(plan, store, again, since) as share:
        measure_all(jobs)
        # Who had these may have died meanwhile; who still has them will finish them.
        left = [*elsewhere]
        elsewhere.clear()
        measure_all(left)
    return failures


def _pass(
    measure: Callable[[Job], Record],
    jobs: Sequence[Job],
    workers: int,
    finish: Callable[[Job, Record], None],
    take: Callable[[Job], bool],
    threads: int | None = None,
) -> list[Job]:
    """Run jobs until all are done or a process dies; return those that are left, first those that were running.

    Only what `take` accepts is run.
    """
    waiting, running, lost = deque(jobs), dict[Future[Record], Job](), list[Job]()
    with _threads(threads or max(1, cores() // workers)), _pool(workers) as pool:
        while running or (waiting and not lost):
            while waiting and len(running) < workers and not lost:
                job = waiting.popleft()
                if not take(job):
                    continue
                try:
                    running[pool.submit(measure, job)] = job
                except BrokenProcessPool:
                    lost.append(job)
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                job = running.pop(future)
                try:
                    record = future.result()
                except BrokenProcessPool:
                    lost.append(job)
                else:
                    finish(job, record)
    return [*lost, *waiting]


def _measure(job: Job, samples: int | None) -> Record:
    # Imported where it runs: the parent process needs no torch.
    from n2n.tables.measure import measure

    return measure(job.fit, job.evaluations, samples)


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    # `spawn`: a forked process would share the threads and locks of torch.
    context = multiprocessing.get_context("spawn")
    before = set(multiprocessing.active_children())
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_follow_parent) as pool:
        try:
            yield pool
        except BaseException:
            # Nobody is there to keep what they still measure, and the pool would wait for it.
            for process in set(multiprocessing.active_children()) - before:
                process.terminate()
            raise


def _follow_parent() -> None:
    """Leave ^C to the parent, and end when it ends, however that is: a killed parent cannot say so."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _threads(count: int) -> Iterator[None]:
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
