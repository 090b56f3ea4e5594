"""Sweeps and tables through Hydra's launchers: submitit here, and on a Slurm that stands in for a cluster."""

import csv
import json
import os
import re
import sys
import threading
import time
from types import SimpleNamespace

import pytest
import slurm_stand_in
from omegaconf import OmegaConf

from n2n.cli.main import main
from n2n.compose import conf_dir
from n2n.errors import ConfigError
from n2n.sweeps.launchers import check_installed, start

PRESETS = sorted(path.stem for path in (conf_dir() / "hydra" / "launcher").glob("*.yaml"))
SHORT = ("debug=default", "iterations=4", "plan_reuse=2", "datamodule.points=300", "redistance=false", "media=false")


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working folder; what others on the PATH may be is out of the way."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    return tmp_path


@pytest.fixture
def slurm(here, monkeypatch):
    """The state folder of a Slurm that is on the PATH."""
    pytest.importorskip("submitit", reason="needs submitit: pip install 'n2n[slurm]'")
    from submitit.slurm import slurm

    monkeypatch.setenv("PATH", f"{slurm_stand_in.install(here / 'slurm')}{os.pathsep}{os.environ['PATH']}")
    # submitit asks sacct every ten minutes and looks for results in between; a test has no minutes.
    monkeypatch.setattr(slurm.SlurmJob, "watcher", slurm.SlurmInfoWatcher(delay_s=1))
    yield here / "slurm" / "state"
    slurm_stand_in.end(here / "slurm" / "state")


def wait_for(condition, seconds=600.0):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_composes(name, here):
    from hydra import compose, initialize_config_dir

    from n2n.compose import register_schema

    register_schema()
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        config = compose("config", [f"hydra/launcher={name}", "hydra.sweep.dir=there"], return_hydra_config=True)
    launcher = config.hydra.launcher
    assert "submitit_folder" not in launcher or launcher.submitit_folder == "there/.submitit/%j"


@pytest.mark.parametrize(
    ("target", "extra"),
    [
        ("hydra_plugins.hydra_submitit_launcher.submitit_launcher.LocalLauncher", "slurm"),
        ("hydra_plugins.hydra_ray_launcher.ray_launcher.RayLauncher", "ray"),
        ("hydra_plugins.n2n_optuna.OptunaSweeper", "optuna"),
    ],
)
def test_what_is_not_installed_is_told_with_the_extra(target, extra, monkeypatch):
    monkeypatch.setattr("n2n.sweeps.launchers.find_spec", lambda name: None)
    basic = {"_target_": "hydra._internal.core_plugins.basic_launcher.BasicLauncher"}
    with pytest.raises(ConfigError, match=rf"pip install 'n2n\[{extra}\]'"):
        check_installed(OmegaConf.create({"launcher": {"_target_": target}, "sweeper": {"_target_": target}}))
    check_installed(OmegaConf.create({"launcher": basic, "sweeper": basic}))


def test_without_slurm_that_is_said_before_anything_is_written(here, monkeypatch, capsys):
    pytest.importorskip("submitit", reason="needs submitit: pip install 'n2n[slurm]'")
    monkeypatch.setenv("PATH", str(here))
    assert main(["fit", "-m", "seed=0,1", "hydra/launcher=slurm_cpu"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "there is no Slurm here" in error and not (here / "sweeps").exists()


@pytest.mark.parametrize(("preset", "gpus", "cores"), [("slurm_cpu", None, "4"), ("slurm_gpu", "1", "8")])
def test_what_is_submitted(preset, gpus, cores, slurm, monkeypatch):
    monkeypatch.setenv("STAND_IN_RECORDS", "1")
    monkeypatch.setattr("submitit.core.core.Job.results", lambda job: [SimpleNamespace(return_value=None)])
    settings = ["hydra.launcher.partition=a100", "hydra.launcher.array_parallelism=2"]
    start(preset, settings, slurm.parent / "logs", 3, print)
    script = (slurm / "script").read_text()
    asked = dict(re.findall(r"^#SBATCH --([\w-]+)=?(.*)$", script, re.MULTILINE))
    assert (asked["array"], asked["partition"], asked["cpus-per-task"]) == ("0-2%2", "a100", cores)
    assert asked.get("gpus-per-node") == gpus
    # Four hours at a time, warned two minutes before the end; requeued then, and when a node fails.
    assert (asked["time"], asked["signal"], asked["requeue"], asked["open-mode"]) == ("240", "USR2@120", "", "append")
    assert (asked["nodes"], asked["ntasks-per-node"]) == ("1", "1")
    assert asked["output"].startswith(str(slurm.parent / "logs" / ".submitit"))
    assert "export SRUN_CPUS_PER_TASK=$SLURM_CPUS_PER_TASK" in script and sys.executable in script.rpartition("srun")[2]


def test_a_sweep_on_slurm_outlives_a_preemption(slurm, here):
    def preempt():
        # Once there is something to go on from; the two runs may begin in any order.
        assert wait_for(lambda: list(here.glob("sweeps/s/runs/*/last.ckpt")))
        run = next(here.glob("sweeps/s/runs/*/last.ckpt")).parent
        pid = json.loads((run / "status.json").read_text())["pid"]
        name = next(p.stem for p in slurm.glob("*.pid") if int(p.read_text()) == pid)
        slurm_stand_in.preempt(slurm, name)
        preempted.append((name, run))

    preempted = []
    watcher = threading.Thread(target=preempt)
    watcher.start()
    settings = [*SHORT[2:], "iterations=300", "plan_reuse=2", "checkpoint_every=20", "seed=0,1"]
    assert main(["fit", "-m", *settings, "hydra/launcher=slurm_gpu", "sweep=s"]) == 0
    watcher.join()
    ((name, run),) = preempted
    assert {path.stem: path.read_text() for path in slurm.glob("*.starts")} == {
        task: ".." if task == name else "." for task in ("4242_0", "4242_1")
    }
    for path in here.glob("sweeps/s/runs/*/status.json"):
        status = json.loads(path.read_text())
        assert (status["state"], status["attempt"]) == ("done", 2 if path.parent == run else 1)
    # The second attempt went on from a checkpoint; a run that begins anew logs its first steps.
    (other,) = (path.parent for path in here.glob("sweeps/s/runs/*/status.json") if path.parent != run)
    assert min(steps(other)) < 20 <= min(steps(run)) and max(steps(run)) == max(steps(other))
    # srun gives a task all of its cores.
    assert [path.read_text() for path in slurm.glob("*.cpus")] == ["8", "8"]


def steps(run):
    with (run / "metrics.csv").open(newline="") as file:
        return [int(row["step"]) for row in csv.DictReader(file) if row["loss"]]


def test_tables_through_a_launcher(here, capsys):
    pytest.importorskip("submitit", reason="needs submitit: pip install 'n2n[slurm]'")
    command = ["T10", "--profile", "smoke", "--results", "kept"]
    assert main(["tables", "run", *command, "--launcher", "local", "--workers", "2"]) == 0
    error = capsys.readouterr().err
    assert "2 fits, 0 done before, 2 workers" in error and "2 of 2 fits measured" in error and "1 rendered" in error
    logs = [path.read_text() for path in here.glob("kept/.workers/.submitit/*/*_log.out")]
    assert len(logs) == 2 and sum(log.count("done: generated bracket") for log in logs) >= 2
    records = [json.loads(path.read_text()) for path in here.glob("kept/generated/*.json")]
    assert [record["status"] for record in records] == ["done", "done"]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["hydra.launcher.partition=a"], "add --launcher"),
        (["seed=1", "--launcher", "local"], "seed=1 is no setting of a launcher"),
        (["--launcher", "slum_gpu"], "Unknown hydra/launcher 'slum_gpu'. Did you mean 'slurm_gpu'?"),
        (["--launcher", "slurm_gpu", "hydra.launcher.partitio=a"], "partitio"),
    ],
)
def test_mistakes_are_one_line(arguments, expected, here, capsys):
    assert main(["tables", "run", "T10", "--profile", "smoke", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.splitlines()[-1].startswith("n2n: error: ") and expected in error
