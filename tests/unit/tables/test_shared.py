"""Several `n2n tables run` on one folder: each fit is measured once, and none is lost with its process."""

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
import table_jobs

from n2n.errors import OutputError
from n2n.sweeps.claims import claim
from n2n.tables import run as module
from n2n.tables.shared import DONE, ELSEWHERE, FAILED, MINE, Share, measured_now, now, open_jobs
from n2n.tables.store import Store


@pytest.fixture(autouse=True)
def stand_in(monkeypatch):
    monkeypatch.setattr(module, "_measure", table_jobs.measure)


def start(results, workers, shapes):
    command = [sys.executable, table_jobs.__file__, "run", str(results), str(workers), *shapes]
    return subprocess.Popen(command, cwd=Path(table_jobs.__file__).parent, start_new_session=True)


def statuses(plan, store):
    return Counter((store.read(fit) or {}).get("status") for fit in plan.jobs)


def measured(folder):
    log = folder / "log"
    return Counter(log.read_text().split()) if log.exists() else Counter()


def wait_for(condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


def test_three_processes_measure_each_fit_once(tmp_path):
    shapes = [f"notes:{tmp_path}#0.05#{number}" for number in range(12)]
    processes = [start(tmp_path / "results", workers, shapes) for workers in (1, 2, 1)]
    assert [process.wait(60) for process in processes] == [0, 0, 0]
    assert measured(tmp_path) == dict.fromkeys(shapes, 1)
    plan, store = table_jobs.plan_of(shapes), Store(tmp_path / "results")
    assert statuses(plan, store) == {"done": 12} and measured_now(plan, store) == []


def test_what_a_killed_process_left_is_measured_by_the_next(tmp_path):
    shapes = [f"notes:{tmp_path}#{wait}#{number}" for number, wait in enumerate((0, 60, 60))]
    plan, store = table_jobs.plan_of(shapes), Store(tmp_path / "results")
    first = start(store.folder, 1, shapes)
    assert wait_for(lambda: len(measured(tmp_path)) == 2)
    # Seen from outside while it lives ...
    assert [job.fit.shape for job in measured_now(plan, store)] == [shapes[1]]
    with Share(plan, store) as share:
        assert [share.take(job) for job in plan.jobs.values()] == [(DONE, ""), (ELSEWHERE, ""), (MINE, "")]
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    # ... and free as soon as it does not.
    assert measured_now(plan, store) == []
    with Share(plan, store) as share:
        assert [share.take(job)[0] for job in plan.jobs.values()] == [DONE, MINE, MINE]
        assert len(measured_now(plan, store)) == 2
    assert measured_now(plan, store) == []


def test_what_others_are_at_is_left_to_them_and_is_no_failure(tmp_path):
    shapes, told = ["a", "b", "c"], []
    plan, store = table_jobs.plan_of(shapes), Store(tmp_path)
    now(store)
    fit = next(fit for fit in plan.jobs if fit.shape == "b")
    with claim(tmp_path / ".claims" / fit.id) as mine:
        assert mine
        # The claim is this process's own: that it is ours does not make it the run's.
        assert module.run(plan, store, 1, told=lambda job, error: told.append(job.fit.shape)) == []
    assert told == ["a", "c"] and statuses(plan, store) == {"done": 2, None: 1}
    assert module.run(plan, store, 1) == [] and statuses(plan, store) == {"done": 3}


def test_a_failure_of_those_beside_us_is_told_and_not_tried_again(tmp_path):
    plan, store, told = table_jobs.plan_of(["fails", "a"]), Store(tmp_path), []
    began = now(store)
    time.sleep(0.02)
    assert len(module.run(plan, store, 1)) == 1
    before = store.path(next(iter(plan.jobs))).stat().st_mtime_ns
    ((job, error),) = module.run(plan, store, 1, told=lambda job, error: told.append(error), since=began)
    assert (job.fit.shape, error, told) == ("fails", "it is broken", ["it is broken"])
    assert store.path(job.fit).stat().st_mtime_ns == before
    with Share(plan, store, since=began) as share:
        assert [share.take(job)[0] for job in plan.jobs.values()] == [FAILED, DONE]
    # Whoever starts later tries again.
    time.sleep(0.02)
    module.run(plan, store, 1)
    assert store.path(job.fit).stat().st_mtime_ns > before


def test_done_by_other_sources_is_open_to_those_who_want_it_again(tmp_path):
    plan, store = table_jobs.plan_of(["a"]), Store(tmp_path)
    module.run(plan, store, 1)
    (job,) = plan.jobs.values()
    with Share(plan, store, again=True) as share:
        assert open_jobs(plan, store, again=True) == [job] and share.take(job) == (MINE, "")
    with Share(plan, store) as share:
        assert open_jobs(plan, store) == [] and share.take(job) == (DONE, "")


def test_what_needs_a_package_that_is_not_here_is_not_measured_again(tmp_path, monkeypatch):
    plan, store = table_jobs.plan_of(["a"]), Store(tmp_path)
    module.run(plan, store, 1)
    (job,) = plan.jobs.values()
    monkeypatch.setattr("n2n.tables.shared.not_installed", {job.fit.method: "pip install it"}.get)
    assert plan.stale(store) == [job] and open_jobs(plan, store, again=True) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_is_told(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match="choose another --results"):
        module.run(table_jobs.plan_of(["a"]), Store(tmp_path), 1)


def test_a_file_in_the_place_of_the_folder_is_told(tmp_path):
    (tmp_path / "results").touch()
    with pytest.raises(OutputError, match="choose another --results"):
        module.run(table_jobs.plan_of(["a"]), Store(tmp_path / "results"), 1)
