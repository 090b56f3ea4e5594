"""`n2n fit -m` and `n2n sweep` on real fits: failures, other data, retries, results, Ctrl-C."""

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from n2n.cli.main import main
from n2n.cli.multirun import OtherRunsError, _report
from n2n.sweeps.grid import Grid
from n2n.sweeps.status import Status
from n2n.sweeps.store import Sweep

FIT = ["iterations=10", "plan_reuse=5", "logger=none"]
N2N = Path(sys.executable).parent / "n2n"


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def scan(name, radius=1.0):
    points = np.random.default_rng(0).normal(size=(400, 3))
    np.savetxt(name, radius * points / np.linalg.norm(points, axis=1, keepdims=True))


def attempts(name):
    return [run.attempt for run in Sweep.open(name).runs]


def test_failures_are_listed_and_only_what_is_open_is_fitted(capsys, tmp_path, monkeypatch):
    scan("a.xyz")
    paths = "datamodule.paths=[a.xyz],[b.xyz]"
    command = ["fit", "-m", "sweep=scans", "datamodule=files", paths, "hydra/launcher=basic", *FIT]
    assert main(command) == 2
    said = capsys.readouterr().err
    assert "1/2 done: datamodule.paths=[a.xyz]" in said
    assert "scans: 1 of 2 done, 1 failed" in said and "n2n sweep retry scans" in said
    assert said.count("b.xyz: ") >= 2  # as it ends, and in the list

    assert main(["sweep", "status", "scans"]) == 2
    table = capsys.readouterr().out
    assert "1 done, 1 failed" in table and "n2n fit -m sweep=scans" in table
    assert main(["sweep", "resume", "scans"]) == 2  # nothing was mended
    assert attempts("scans") == [1, 1]

    scan("b.xyz")
    assert main(["sweep", "retry", "sweeps/scans"]) == 0
    assert attempts("scans") == [1, 2]
    assert main(["sweep", "status", "scans"]) == 0

    scan("a.xyz", radius=2.0)
    assert main(command) == 0
    assert attempts("scans") == [2, 2]
    assert "data of 1 finished runs have changed" in capsys.readouterr().err
    assert main(command) == 0
    assert "0 of 2 runs to fit" in capsys.readouterr().err
    assert attempts("scans") == [2, 2]

    assert main(["sweep", "results", "scans"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [(row["datamodule.paths"], row["state"], row["iterations"]) for row in rows] == [
        ("[a.xyz]", "done", "10"),
        ("[b.xyz]", "done", "10"),
    ]
    assert float(rows[0]["spacing"]) == pytest.approx(2 * float(rows[1]["spacing"]), rel=1e-4)
    assert main(["sweep", "results", "scans", "-o", "scans.json"]) == 0
    assert [row["run"] for row in json.loads(Path("scans.json").read_text())] == [row["run"] for row in rows]
    assert main(["sweep"]) == 0
    assert "scans  2     2" in capsys.readouterr().out

    Path("a.xyz").rename("away.xyz")  # what was fitted to it stays, and nothing is tried
    monkeypatch.chdir(tmp_path.parent)
    folder = f"{tmp_path.name}/sweeps/scans"
    for verb in ("resume", "retry"):
        assert main(["sweep", verb, folder]) == 0
        assert "0 of 2 runs to fit" in capsys.readouterr().err
    assert attempts(folder) == [2, 2]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["fit", "-m", "seed=1"], "no setting has several values"),
        (["fit", "sweep=x", "seed=1"], "add -m"),
        (["fit", "-m", "--cfg", "job", "seed=0,1"], "leave -m out"),
        (["sweep", "status"], "which sweep?"),
        (["sweep", "status", "x"], "Unknown sweep 'x'"),
        (["sweep", "stauts", "x"], "invalid choice"),
    ],
)
def test_what_cannot_be_done_is_one_line(capsys, arguments, message):
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
    assert not Path("sweeps").exists()


def test_a_sweep_is_resumed_with_its_own_settings(capsys):
    Sweep.plan("x", ["-m", "sweep=x", "seed=0,1"], {"seed": ["0", "1"]}, {"gone": ["seed=0"]})
    assert main(["sweep", "resume", "x", "seed=3"]) == 2
    assert "would make other runs" in capsys.readouterr().err
    assert main(["sweep", "resume", "x"]) == 2
    assert "means other runs than when it was made" in capsys.readouterr().err
    assert main(["sweep", "results", "x", "hydra/launcher=basic"]) == 2
    assert "takes no settings" in capsys.readouterr().err
    assert main(["sweep", "status", "x", "-o", "x.csv"]) == 2


def test_a_command_that_means_other_runs_now_keeps_no_other_from_its_own(capsys, monkeypatch):
    Sweep.plan("x", ["-m", "sweep=x", "seed=0,1"], {"seed": ["0", "1"]}, {"gone": ["seed=0"]})
    Sweep.plan("x", ["-m", "sweep=x", "seed=2,3"], {"seed": ["2", "3"]}, {"here": ["seed=2"]})
    given = []

    def fit(settings, flags, states, sweep):
        given.append(settings[0])
        if settings[0] == "seed=0,1":
            raise OtherRunsError("it means other runs")
        return 0

    monkeypatch.setattr("n2n.cli.multirun.run_multirun", fit)
    assert main(["sweep", "resume", "x"]) == 2
    assert sorted(given) == ["seed=0,1", "seed=2,3"]
    assert "it means other runs" in capsys.readouterr().err


def test_a_refused_command_is_the_one_to_give_again_and_the_home_is_where_it_was_given(capsys, monkeypatch):
    Sweep.plan("x", ["-m", "sweep=x", "seed=0,1"], {"seed": ["0", "1"]}, {"gone": ["seed=0"]})
    Path("sweeps/y").mkdir()
    monkeypatch.chdir("sweeps/y")
    assert main(["sweep", "resume", "../x"]) == 2
    said = capsys.readouterr().err
    assert "sweeps/x: its command means other runs" in said and "n2n fit -m sweep=x seed=0,1" in said
    monkeypatch.chdir("../x")
    assert main(["sweep", "resume", "../x"]) == 2
    assert "means other runs" in capsys.readouterr().err


@pytest.mark.parametrize(("jobs", "verb"), [([], "retry"), (None, "results")])
def test_an_optimiser_does_not_try_again_what_failed(capsys, jobs, verb):
    sweep = Sweep.plan("x", ["-m", "sweep=x", "seed=0,1"], {"seed": ["0", "1"]}, {"h": ["seed=0"]})
    Status("failed", 1, "here", 1, "", ["seed=0"], None, error="no such file").write(sweep.run_dir("h"))
    assert _report(Grid(None, None, {}, [], jobs), sweep) == 2
    assert f"next: n2n sweep {verb} x" in capsys.readouterr().err


def begin(*arguments):
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        [str(N2N), *arguments], start_new_session=True, stderr=subprocess.PIPE, text=True, env=environment
    )


def alive(session):
    """Return the processes of a session that have not ended."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, owner = stat.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(owner) == session and state != "Z":
            found.append(stat.parent.name)
    return found


def press_ctrl_c(process):
    os.killpg(process.pid, signal.SIGINT)


@pytest.mark.parametrize("stop", [press_ctrl_c, subprocess.Popen.terminate])
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc to look for processes")
def test_an_interruption_ends_all_workers_and_resume_goes_on(stop):
    process = begin("fit", "-m", "sweep=x", "seed=0,1,2,3", "datamodule.points=400", "hydra.launcher.n_jobs=2", *FIT)
    end = time.monotonic() + 300
    while time.monotonic() < end and not any(Path("sweeps").glob("x/runs/*/status.json")):
        time.sleep(0.05)
    stop(process)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert said.splitlines()[-1] == "n2n: interrupted; `n2n sweep resume x` goes on where it stopped"
    assert "Traceback" not in said and "Warning" not in said
    end = time.monotonic() + 10
    while alive(process.pid) and time.monotonic() < end:
        time.sleep(0.1)
    assert not alive(process.pid)
    before = Sweep.open("x").runs
    assert {run.state for run in before} <= {"stale", "pending", "done"}

    process = begin("sweep", "resume", "x")
    said = process.communicate(timeout=300)[1]
    assert process.returncode == 0 and "4 of 4 done" in said
    for run, was in zip(Sweep.open("x").runs, before, strict=True):
        assert run.attempt == was.attempt + (was.state != "done")
    pids = {json.loads(path.read_text())["pid"] for path in Path("sweeps/x/runs").glob("*/status.json")}
    assert process.pid not in pids  # workers fit, and each of them more than one
