"""Sweeps on disk: found by name and path, extended, and the state of each run."""

import os
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from n2n.errors import ConfigError, InputError
from n2n.sweeps import store
from n2n.sweeps.claims import claim
from n2n.sweeps.status import CLAIM, FIELD_FILE, Status
from n2n.sweeps.store import RunInfo, Sweep, all_sweeps
from n2n.tasks import field


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def plan(name="seeds", command=("-m", "seed=0,1"), values=("0", "1")):
    return Sweep.plan(name, list(command), {"seed": list(values)}, {f"h{v}": [f"seed={v}"] for v in values})


def status(state, **changes):
    known = {"attempt": 1, "host": "here", "pid": 1, "started": "", "settings": ["seed=1"], "data": "d"}
    return Status(state, **{**known, **changes})


def test_the_field_is_that_of_a_task():
    assert FIELD_FILE == field.FIELD_FILE


def test_opened_by_name_and_by_path(tmp_path, monkeypatch):
    made = plan()
    assert Sweep.open("seeds") == Sweep.open("sweeps/seeds") == made
    monkeypatch.chdir("/")
    assert Sweep.open(tmp_path / "sweeps" / "seeds").planned == made.planned


def test_unknown_one_names_the_nearest():
    with pytest.raises(ConfigError, match="There are none"):
        Sweep.open("seed")
    plan()
    with pytest.raises(ConfigError, match=r"Unknown sweep 'sedes'\. Did you mean 'seeds'"):
        Sweep.open("sedes")


def test_damaged_one_says_how_to_mend_it():
    made = plan()
    (made.folder / "sweep.json").write_text("{")
    with pytest.raises(InputError, match="sweep=seeds"):
        Sweep.open("seeds")


def test_extended_keeps_runs_and_commands():
    first = plan()
    both = plan(command=("-m", "seed=1,2"), values=("1", "2"))
    assert both == Sweep.open("seeds")
    assert both.commands == [["-m", "seed=0,1"], ["-m", "seed=1,2"]]
    assert both.axes == {"seed": ["0", "1", "2"]}
    assert [run.hash for run in both.runs] == ["h0", "h1", "h2"]
    assert both.created == first.created
    assert plan().commands == [["-m", "seed=1,2"], ["-m", "seed=0,1"]]


def test_extended_by_several_at_once():
    values = [str(value) for value in range(8)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda value: plan(command=("-m", f"seed={value}"), values=(value,)), values))
    sweep = Sweep.open("seeds")
    assert sorted(sweep.planned) == [f"h{value}" for value in values]
    assert sorted(command[1] for command in sweep.commands) == [f"seed={value}" for value in values]


def test_all_of_them_oldest_first():
    for name in ("b", "a"):
        plan(name)
        path = store.SWEEPS / name / "sweep.json"
        path.write_text(path.read_text().replace('"created": "', f'"created": "{"9" if name == "a" else "1"}'))
    assert [sweep.name for sweep in all_sweeps()[0]] == ["b", "a"]


def test_a_damaged_one_does_not_hide_the_others():
    for name in ("a", "b"):
        plan(name)
    (store.SWEEPS / "a" / "sweep.json").write_text("{")
    found, damaged = all_sweeps()
    assert [sweep.name for sweep in found] == ["b"]
    assert len(damaged) == 1 and "sweeps/a/sweep.json: is damaged" in str(damaged[0])


def test_runs_are_those_planned_and_those_found():
    sweep = plan()
    assert [(run.hash, run.state) for run in sweep.runs] == [("h0", "pending"), ("h1", "pending")]
    for name in ("h1", "later"):
        sweep.run_dir(name).mkdir(parents=True)
        status("failed", error="no such file", seconds=1.5, attempt=2).write(sweep.run_dir(name))
    run = sweep.runs[1]
    assert (run.state, run.error, run.seconds, run.attempt) == ("failed", "no such file", 1.5, 2)
    assert [(run.hash, run.settings) for run in sweep.runs][2] == ("later", {"seed": "1"})


@pytest.mark.parametrize(
    ("told", "owned", "finished", "state"),
    [
        ("running", True, False, "running"),
        ("running", False, False, "stale"),
        ("running", False, True, "stale"),  # killed between the field and the status
        ("done", False, True, "done"),
        ("done", False, False, "pending"),  # somebody deleted the field to have it fitted again
        ("failed", False, False, "failed"),
    ],
)
def test_state_of_a_run(tmp_path, told, owned, finished, state):
    status(told).write(tmp_path)
    if finished:
        (tmp_path / FIELD_FILE).touch()
    with claim(tmp_path / CLAIM):
        if owned:
            assert RunInfo.read(tmp_path).state == state
    if not owned:
        assert RunInfo.read(tmp_path).state == state


def test_state_of_a_run_of_its_own(tmp_path):
    folder = tmp_path / "runs" / "0123456789"
    assert RunInfo.read(folder).state == "pending"
    folder.mkdir(parents=True)
    assert RunInfo.read(folder).state == "pending"
    log = folder / "metrics.csv"
    log.write_text("step,loss\n9,1.0\n19,\n")
    assert (RunInfo.read(folder).state, RunInfo.read(folder).iteration()) == ("running", 19)
    os.utime(log, (time.time() - 300,) * 2)
    assert RunInfo.read(folder).state == "stale"
    (folder / FIELD_FILE).touch()
    (folder / "summary.json").write_text('{"iterations": 20}')
    run = RunInfo.read(folder)
    assert (run.state, run.iteration(), run.settings, run.label) == ("done", 20, {}, "0123456789")
