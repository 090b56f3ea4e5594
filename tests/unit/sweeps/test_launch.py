"""Workers that die: their runs are tried again, the guilty one alone, and it alone fails."""

import contextlib
from concurrent.futures.process import BrokenProcessPool

import pytest

from n2n.errors import ConfigError
from n2n.sweeps import launch as module
from n2n.sweeps.attempt import attempt
from n2n.sweeps.grid import Grid, Job
from n2n.sweeps.launch import launch
from n2n.sweeps.status import FIELD_FILE
from n2n.sweeps.store import Sweep

NAMES = ["a", "b", "c", "d"]
JOBS = [Job(name, [f"name={name}"], [f"name={name}"], {}) for name in NAMES]

GRID = Grid(None, None, {}, [], None)


@pytest.fixture
def sweep(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return Sweep.plan("x", [], {"name": NAMES}, {job.hash: job.settings for job in JOBS})


class Workers:
    """Two at a time, like the launcher; a run named in `kills` takes its worker, and so both, along that often."""

    def __init__(self, sweep, kills, before=0):
        self.sweep, self.kills, self.before, self.batches = sweep, dict(kills), before, []

    def __call__(self, grid, jobs, task):
        self.batches.append([job.hash for job in jobs])
        if self.before:
            self.before -= 1
            raise BrokenProcessPool
        for pair in (jobs[i : i + 2] for i in range(0, len(jobs), 2)):
            guilty = [job for job in pair if self.kills.get(job.hash, 0)]
            for job in pair:
                self.run(job, is_killed=bool(guilty))
            if guilty:
                self.kills[guilty[0].hash] -= 1
                raise BrokenProcessPool

    def run(self, job, is_killed):
        folder = self.sweep.run_dir(job.hash)

        def fit():
            if is_killed:
                raise SystemExit  # leaves what a killed process leaves: a status that says running, nobody who owns it
            (folder / FIELD_FILE).touch()

        with contextlib.suppress(SystemExit):
            attempt(folder, job.settings, lambda: "d", fit)


def states(sweep):
    return {run.hash: run.state for run in sweep.runs}


@pytest.mark.parametrize(
    ("kills", "failed", "attempts"),
    [
        ({}, [], {"a": 1, "b": 1, "c": 1, "d": 1}),
        ({"b": 1}, [], {"a": 2, "b": 2, "c": 1, "d": 1}),
        ({"b": 2}, [], {"a": 3, "b": 3, "c": 1, "d": 1}),
        ({"b": 9}, ["b"], {"a": 3, "b": 3, "c": 1, "d": 1}),
        ({"c": 9, "b": 1}, ["c"], {"a": 2, "b": 2, "c": 3, "d": 3}),
    ],
)
def test_only_the_guilty_fail(sweep, monkeypatch, kills, failed, attempts):
    monkeypatch.setattr(module, "_launch", Workers(sweep, kills))
    launch(GRID, sweep, JOBS, print)
    assert states(sweep) == {name: "failed" if name in failed else "done" for name in NAMES}
    assert {run.hash: run.attempt for run in sweep.runs} == attempts
    assert all("want of memory" in run.error for run in sweep.runs if run.state == "failed")


def test_workers_that_never_begin_are_an_error(sweep, monkeypatch):
    workers = Workers(sweep, {}, before=99)
    monkeypatch.setattr(module, "_launch", workers)
    with pytest.raises(ConfigError, match="workers die"):
        launch(GRID, sweep, JOBS, print)
    assert len(workers.batches) < 9
    assert set(states(sweep).values()) == {"pending"}


def test_workers_killed_while_they_start_are_started_again(sweep, monkeypatch):
    monkeypatch.setattr(module, "_launch", Workers(sweep, {}, before=2))
    launch(GRID, sweep, JOBS, print)
    assert set(states(sweep).values()) == {"done"}


def test_failed_runs_are_not_lost_when_workers_die(sweep, monkeypatch):
    def fails():
        raise ValueError

    for job in JOBS:
        attempt(sweep.run_dir(job.hash), job.settings, lambda: "d", fails)
    monkeypatch.setattr(module, "_launch", Workers(sweep, {"a": 1}))
    launch(GRID, sweep, JOBS, print)
    assert set(states(sweep).values()) == {"done"}
