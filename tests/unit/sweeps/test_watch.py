"""What is seen of a sweep as it goes on, and how the cores are shared."""

import pytest
from omegaconf import OmegaConf

from n2n.cli.sweep_progress import line
from n2n.sweeps.grid import Grid
from n2n.sweeps.launch import is_joblib, set_processes
from n2n.sweeps.status import FIELD_FILE, Status
from n2n.sweeps.store import Sweep
from n2n.sweeps.watch import Watch


@pytest.fixture
def sweep(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    planned = {name: [f"seed={name}"] for name in "abc"}
    made = Sweep.plan("x", [], {"seed": ["a", "b", "c"]}, planned)
    tell(made, "a", "done")
    tell(made, "b", "failed", error="no such file")
    return made


def tell(sweep, name, state, attempt=1, error=None):
    folder = sweep.run_dir(name)
    folder.mkdir(parents=True, exist_ok=True)
    if state == "done":
        (folder / FIELD_FILE).touch()
    Status(state, attempt, "", 0, "", [f"seed={name}"], "d", "", 1.25, error).write(folder)


def test_what_ended_before_is_no_news(sweep):
    watch = Watch(sweep, {"b", "c"})
    assert watch.look() == []
    tell(sweep, "b", "running", attempt=2)
    tell(sweep, "c", "done")
    assert [run.hash for run in watch.look()] == ["c"]
    tell(sweep, "b", "failed", attempt=2, error="no such file")
    (news,) = watch.look()
    assert watch.look() == []
    assert (watch.count("done"), watch.count("failed")) == (1, 1)
    assert line(watch, news, 2) == "2/2 failed: seed=b: no such file  (1.2 s)"


def test_all_that_appears_is_watched_where_an_optimiser_plans(sweep):
    watch = Watch(sweep, None)
    tell(sweep, "d", "done")
    assert [line(watch, run, 1) for run in watch.look()] == ["1 done: seed=d  (1.2 s)"]


def test_data_that_changed_are_news_again(sweep):
    watch = Watch(sweep, {"a"})
    tell(sweep, "a", "done", attempt=2)
    assert [run.hash for run in watch.look()] == ["a"]


@pytest.mark.parametrize(
    ("asked", "cores", "runs", "processes", "threads"),
    [(-1, 16, 24, 16, 1), (-1, 16, 4, 4, 4), (-1, 1, 24, 1, 1), (4, 16, 24, 4, 4), (32, 16, 24, 32, 1)],
)
def test_cores_are_shared(asked, cores, runs, processes, threads):
    target = "hydra_plugins.hydra_joblib_launcher.joblib_launcher.JoblibLauncher"
    launcher = {"_target_": target, "n_jobs": asked, "batch_size": "auto"}
    grid = Grid(None, OmegaConf.create({"hydra": {"launcher": launcher}}), {}, [], None)
    OmegaConf.set_readonly(grid.master, True)
    assert is_joblib(grid)
    assert set_processes(grid, cores, runs) == (processes, threads)
    assert (grid.master.hydra.launcher.n_jobs, grid.master.hydra.launcher.batch_size) == (processes, "1")
