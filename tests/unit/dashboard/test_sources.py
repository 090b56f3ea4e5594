"""Runs, sweeps, folders of them and results of tables are found; damaged ones are shown as such."""

import json
import shutil

import pytest

from n2n.dashboard.sources import read_runs
from n2n.errors import InputError
from tests.unit.dashboard.conftest import write_run, write_sweep


def by_id(runs):
    return {run.id: run for run in runs}


def test_a_sweep_shows_all_its_runs(sweep):
    runs = by_id(read_runs([str(sweep)]))
    assert len(runs) == 8
    states = [run.state for run in runs.values()]
    assert (states.count("done"), states.count("failed"), states.count("pending")) == (6, 1, 1)
    assert runs["ffffffffff"].error == "weight out of range"
    run = runs["aaaaaaaa50"]
    assert run.swept == {"regulariser_weight": "0.05", "seed": "0"} and run.sweep == "weights"
    assert run.values["denoise/sbp/cd_sum2"] == pytest.approx(4.05e-4)
    assert run.floors == {"denoise/sbp/oracle/cd_sum2": 3e-4}
    assert run.values["validation"] == 0.4 and run.seconds == 12.5 and run.started.startswith("2026")
    assert run.curves["loss"][1][0] == 2


def test_what_was_left_open_is_what_the_fit_chose(tmp_path):
    (run,) = read_runs([str(write_run(tmp_path / "a"))])
    assert run.config["batch_size"] is None and run.effective["batch_size"] == 10000
    assert run.effective["num_observations"] == 200
    assert "logger._target_" not in run.config and "device" not in run.effective


def test_no_regulariser_is_weight_zero(tmp_path):
    folder = write_run(tmp_path / "a", regulariser={"name": "none"}, regulariser_weight=None)
    assert read_runs([str(folder)])[0].effective["regulariser_weight"] == 0


def test_names_and_defaults(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert read_runs() == []
    write_run(tmp_path / "runs" / "aaaaaaaaaa")
    write_sweep(tmp_path / "sweeps" / "weights", {"bbbbbbbbbb": {}, "cccccccccc": None})
    assert set(by_id(read_runs())) == {"aaaaaaaaaa", "bbbbbbbbbb", "cccccccccc"}
    assert len(read_runs(["weights"])) == 2
    assert len(read_runs(["aaaaaaaaaa"])) == 1
    assert len(read_runs(["weights", "sweeps/weights", "runs", "aaaaaaaaaa"])) == 3  # each once
    with pytest.raises(InputError, match="weigths"):
        read_runs(["weigths"])


def test_a_folder_without_runs_is_told(tmp_path):
    (tmp_path / "pictures").mkdir()
    assert read_runs([str(tmp_path / "pictures")]) == []
    (tmp_path / "pictures" / "a.png").write_text("")
    with pytest.raises(InputError, match="holds no runs"):
        read_runs([str(tmp_path / "pictures")])


def test_a_dead_worker_is_stale(tmp_path):
    folder = write_run(tmp_path / "a", state="running")
    assert read_runs([str(folder)])[0].state == "stale"


GARBAGE = [b"", b"{", b"[1, 2]", b"null", b'{"state": 3}', b"\xff\xfe\x00", b"a: [b", b"{" * 5000]


@pytest.mark.parametrize("name", ["config.yaml", "summary.json", "evaluation.json", "status.json", "metrics.csv"])
@pytest.mark.parametrize("content", GARBAGE)
def test_no_damage_to_a_file_stops_the_rest(tmp_path, name, content):
    folder = write_run(tmp_path / "a")
    (folder / name).write_bytes(content)
    (run,) = read_runs([str(folder)])
    assert run.id == "a" and run.state in {"done", "failed", "pending"}
    if content in (b"{", b"\xff\xfe\x00") and name != "metrics.csv":
        assert any(name in problem for problem in run.problems)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("status.json", {"state": "done", "settings": 7}),
        ("status.json", {"state": "sleeping", "settings": ["a=1"], "seconds": "long", "attempt": None}),
        ("evaluation.json", {"evaluations": {"denoise/sbp": 3}}),
        ("evaluation.json", {"evaluations": {"denoise/sbp": {"values": {"cd_sum2": None, "p2m": "x"}, "floors": [1]}}}),
        ("summary.json", {"config": [1], "observations": {}, "seconds": float("inf")}),
    ],
)
def test_well_formed_nonsense_is_survived(tmp_path, name, content):
    folder = write_run(tmp_path / "a")
    (folder / name).write_text(json.dumps(content))
    (run,) = read_runs([str(folder)])
    assert run.id == "a"


def test_a_sweep_without_its_list_shows_what_is_there(sweep):
    (sweep / "sweep.json").write_text("{")
    runs = read_runs([str(sweep)])
    assert len(runs) == 7 and all("sweep.json" in run.problems[0] for run in runs)


def test_a_folder_in_the_place_of_a_file_is_survived(tmp_path):
    folder = write_run(tmp_path / "a")
    (folder / "summary.json").unlink()
    (folder / "summary.json").mkdir()
    (run,) = read_runs([str(folder)])
    assert any("summary.json" in problem for problem in run.problems)


def test_results_of_tables_are_runs(tmp_path):
    folder = tmp_path / "laptop" / "pu"
    folder.mkdir(parents=True)
    record = {
        "id": "0123456789ab", "method": "n2n", "datamodule": "pu", "shape": "duck", "status": "done",
        "settings": ["datamodule.noise=0.03", "datamodule.points=10000", "num_observations=1"],
        "fit": {"iterations": 160}, "cost": {"seconds": 20.0}, "made": {"commit": "abc", "date": "2026-01-01"},
        "results": {"denoise/sbp": {"values": {"cd_sum2": 5e-4}, "floors": {"oracle": {"cd_sum2": 4e-4}}}},
    }  # fmt: skip
    (folder / "duck-0123456789ab.json").write_text(json.dumps(record))
    (folder / "pig-0123456789ac.json").write_text(json.dumps({**record, "status": "failed", "error": "no memory"}))
    (folder / "eight-0123456789ad.json").write_text("{")
    runs = by_id(read_runs([str(tmp_path / "laptop")]))
    duck = runs["duck-0123456789ab"]
    assert duck.effective["datamodule.noise"] == 0.03 and duck.effective["num_observations"] == 1
    assert duck.values["denoise/sbp/cd_sum2"] == 5e-4 and duck.seconds == 20
    assert runs["pig-0123456789ac"].error == "no memory"
    assert runs["eight-0123456789ad"].state == "failed" and runs["eight-0123456789ad"].problems
    shutil.rmtree(folder)
