"""Jobs in processes of their own: whatever happens to one, the others' results are kept."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import table_jobs

from n2n.tables import run as module
from n2n.tables.plan import Job, Plan
from n2n.tables.shared import FAILED, MINE, Share, now
from n2n.tables.spec import Fit, Profile
from n2n.tables.store import Store


@pytest.fixture
def plan(monkeypatch):
    """Return a function that plans one stand-in per name."""
    monkeypatch.setattr(module, "_measure", table_jobs.measure)

    def planned(*shapes, evaluation="denoise/sbp"):
        jobs = [Job(Fit("n2n", "pu", str(shape), ()), {evaluation: set()}) for shape in shapes]
        return Plan(Profile("p", "a profile"), [], {}, {job.fit: job for job in jobs})

    return planned


def kept(plan, store):
    return {job.fit.shape.partition(":")[0]: (store.read(job.fit) or {}).get("status") for job in plan.jobs.values()}


def alive(pid):
    """Tell whether a process runs; one that ended and that nobody asked for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def wait_for(condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


def test_where_the_cost_is_the_result_nothing_runs_beside(plan, tmp_path):
    timed = plan("a", "b", "c", evaluation="")
    assert module.run(timed, store := Store(tmp_path), workers=3) == []
    assert len({store.read(fit)["pid"] for fit in timed.jobs}) == 1


def test_a_failure_is_recorded_and_tried_again_and_what_is_done_is_not(plan, tmp_path):
    wanted, store, told = plan("a", "fails", "b"), Store(tmp_path), []
    failures = module.run(wanted, store, 1, told=lambda job, error: told.append((job.fit.shape, error)))
    assert [(job.fit.shape, error) for job, error in failures] == [("fails", "it is broken")]
    assert told == [("a", ""), ("fails", "it is broken"), ("b", "")]
    assert kept(wanted, store) == {"a": "done", "fails": "failed", "b": "done"}
    told.clear()
    assert len(module.run(wanted, store, 1, told=lambda job, error: told.append(job.fit.shape))) == 1
    assert told == ["fails"]


def test_a_killed_process_loses_only_its_own_job(plan, tmp_path):
    wanted, store = plan("a", "killed", "b", "c", "d"), Store(tmp_path)
    ((job, error),) = module.run(wanted, store, 2)
    assert job.fit.shape == "killed" and "the process was killed" in error
    assert kept(wanted, store) == {"a": "done", "killed": "failed", "b": "done", "c": "done", "d": "done"}
    # The rest went on in one pool, not one by one.
    assert len({store.read(j.fit)["pid"] for j in wanted.jobs.values() if j.fit.shape in "cd"}) <= 2
    assert store.read(job.fit)["shape"] == "killed"


def test_who_was_killed_along_with_another_is_tried_again(plan, tmp_path):
    wanted, store = plan(f"killed-once:{tmp_path / 'once'}", "a"), Store(tmp_path / "results")
    assert module.run(wanted, store, 2) == []
    assert set(kept(wanted, store).values()) == {"done"}


def test_an_interruption_keeps_what_is_done_and_waits_for_nothing(plan, tmp_path):
    note = tmp_path / "pid"
    wanted, store = plan("a", f"sleeps:{note}", "b"), Store(tmp_path / "results")

    def interrupt(job, error):
        assert wait_for(lambda: note.exists() and note.read_text())
        raise KeyboardInterrupt

    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        module.run(wanted, store, 2, told=interrupt)
    assert time.monotonic() - start < 30
    assert kept(wanted, store) == {"a": "done", "sleeps": None, "b": None}
    assert [job.fit.shape for job in wanted.open(store)] == [f"sleeps:{note}", "b"]
    assert wait_for(lambda: not alive(int(note.read_text())))


@pytest.mark.parametrize("signal_name", ["SIGTERM", "SIGKILL"])
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")
def test_no_process_outlives_its_parent(signal_name, tmp_path):
    note = tmp_path / "pid"
    command = [sys.executable, table_jobs.__file__, f"sleeps:{note}"]
    parent = subprocess.Popen(command, cwd=Path(table_jobs.__file__).parent)
    try:
        assert wait_for(lambda: note.exists() and note.read_text())
        worker = int(note.read_text())
        assert alive(worker)
    finally:
        parent.send_signal(getattr(signal, signal_name))
        parent.wait()
    assert wait_for(lambda: not alive(worker), 5)


def test_processes_share_the_cores(plan, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "cores", lambda: 8)
    before = os.environ.get("OMP_NUM_THREADS")
    wanted, store = plan("a"), Store(tmp_path)
    module.run(wanted, store, 3)
    assert store.read(next(iter(wanted.jobs)))["threads"] == "2"
    assert os.environ.get("OMP_NUM_THREADS") == before


def test_a_failed_repetition_keeps_the_numbers(plan, tmp_path):
    wanted, store = plan("fails"), Store(tmp_path)
    good = {"status": "done", "results": {}, "cost": {}, "made": {"sources": "older"}}
    store.write(next(iter(wanted.jobs)), good)
    (job,), since = wanted.jobs.values(), now(store) - 1
    assert module.run(wanted, store, 1, again=True, since=since) == [(job, "it is broken")]
    assert store.read(job.fit) == {**good, "failed_again": "it is broken"}
    # Who works on the same plan does not try it too; who starts later does.
    with Share(wanted, store, again=True, since=since) as share:
        assert share.take(job) == (FAILED, "it is broken")
    with Share(wanted, store, again=True, since=now(store) + 1) as share:
        assert share.take(job) == (MINE, "")
