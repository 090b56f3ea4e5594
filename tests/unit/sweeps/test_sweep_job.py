"""What a worker does with a composed configuration."""

import pytest
from hydra.core.hydra_config import HydraConfig
from omegaconf import open_dict, read_write

from n2n.cli import job
from n2n.cli.sweep_job import SweepJob
from n2n.registry import DATAMODULES
from n2n.sweeps.grid import make_grid
from n2n.sweeps.status import FIELD_FILE
from n2n.sweeps.store import RunInfo


@pytest.fixture
def grid(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def fit_job(config, folder, sweep, data):
        assert len(data.shapes[0][0]) == config["datamodule"]["points"]
        (folder / FIELD_FILE).write_text(f"{config['seed']} {sweep}")
        (folder / "evaluation.json").write_text('{"validation": 0.5}')

    monkeypatch.setattr(job, "fit_job", fit_job)
    yield make_grid(["seed=0,1", "datamodule.points=100"], ["-m"], tmp_path / "x")
    HydraConfig.instance().cfg = None


def work(grid, planned, folder):
    composed = grid.loader.load_sweep_config(grid.master, grid.jobs[1].overrides)
    HydraConfig.instance().set_config(composed)
    with read_write(composed), open_dict(composed):
        del composed["hydra"]
    return SweepJob(folder, ("seed",), planned)(composed)


@pytest.mark.parametrize("is_planned", [True, False])
def test_fits_in_the_folder_of_its_run(grid, tmp_path, is_planned):
    planned = {" ".join(one.settings): one.hash for one in grid.jobs} if is_planned else None
    assert work(grid, planned, tmp_path / "x") == 0.5
    run = RunInfo.read(tmp_path / "x" / "runs" / grid.jobs[1].hash)
    assert (run.state, run.settings) == ("done", {"seed": "1"})
    assert (run.folder / FIELD_FILE).read_text() == "1 x"


def test_fails_where_the_configuration_is_not_the_planned_one(grid, tmp_path):
    assert work(grid, {"seed=1": "another"}, tmp_path / "x") is None
    (folder,) = (tmp_path / "x" / "runs").iterdir()
    run = RunInfo.read(folder)
    assert (run.hash, run.state) == ("another", "failed")
    assert "changed while the sweep ran" in run.error


def test_data_are_read_once(grid, tmp_path, monkeypatch):
    read, build = [], DATAMODULES.build
    monkeypatch.setattr(DATAMODULES, "build", lambda *given, **named: read.append(1) or build(*given, **named))
    assert work(grid, None, tmp_path / "x") == 0.5
    assert len(read) == 1
