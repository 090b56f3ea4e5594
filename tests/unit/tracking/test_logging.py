"""What a run logs: read back from the files each logger writes, by a reader of their own."""

import csv
import json
import math
import re
import struct
from importlib.util import find_spec

import numpy as np
import pytest
import torch

from n2n.cli import job
from n2n.cli.job import fit_job
from n2n.compose import compose
from n2n.datamodules.generated import GeneratedDataModule
from n2n.errors import ConfigError
from n2n.losses.state import FieldState
from n2n.sweeps.claims import claim
from n2n.sweeps.status import CLAIM
from n2n.tracking import media, names, tracker
from n2n.tracking.callback import eikonal_deviation, gradient_norm

SMALL = ["datamodule.shape=sphere", "datamodule.points=400", "iterations=10", "plan_reuse=5", "redistance=false"]
LOGGED = set(names.TRAINING) - {names.REGULARISER, names.GPU_MEMORY}


def run(folder, *settings, sweep=None):
    return fit_job(compose([*SMALL, *settings]), folder, sweep)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """One fit, told to each logger; a home of their own shows what they leave there."""
    folder, patch = tmp_path_factory.mktemp("runs"), pytest.MonkeyPatch()
    home = folder / "home"
    home.mkdir()
    patch.setenv("HOME", str(home))
    for key in ("WANDB_API_KEY", "WANDB_DIR", "WANDB_MODE", "XDG_CACHE_HOME", "XDG_CONFIG_HOME"):
        patch.delenv(key, raising=False)
    patch.chdir(folder)
    patch.setattr(media, "_RESOLUTION", 24)
    patch.setattr(media, "_SIZE", 120)
    for logger in ("none", "csv", "wandb", "tensorboard"):
        if logger != "tensorboard" or find_spec("tensorboard"):
            extra = ["evaluate=[denoise/sbp]"] if logger == "wandb" else []
            run(folder / logger, f"logger={logger}", *extra, sweep="weights")
    patch.undo()
    return folder


def rows(folder):
    with (folder / "metrics.csv").open() as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def records(folder):
    """Return the records of W&B's own file, by kind."""
    from wandb.proto.wandb_internal_pb2 import Record

    (path,) = folder.glob("wandb/offline-run-*/*.wandb")
    content, kinds, data, place = path.read_bytes(), {}, b"", 7
    assert content.startswith(b":W&B")
    # LevelDB's log: blocks of 32 KiB; a part of a record has checksum, length, and 1 whole, 2 first, 3 middle, 4 last.
    while place < len(content):
        if (left := 32768 - place % 32768) < 7:
            place += left
            continue
        length, part = struct.unpack("<HB", content[place + 4 : place + 7])
        data, place = data + content[place + 7 : place + 7 + length], place + 7 + length
        if part in (1, 4):
            record = Record()
            record.ParseFromString(data)
            kinds.setdefault(record.WhichOneof("record_type"), []).append(record)
            data = b""
    return kinds


def history(kinds):
    """Return rows of values; nested keys are joined by dots."""
    return [
        {".".join(item.nested_key) or item.key: json.loads(item.value_json) for item in record.history.item}
        for record in kinds["history"]
    ]


def test_the_field_is_the_same_bit_for_bit_whoever_is_told(runs):
    fields = {p.parent.name: torch.load(p)["weights"] for p in runs.glob("*/field.ckpt")}
    assert set(fields) >= {"none", "csv", "wandb"}
    for name, weights in fields.items():
        assert all(torch.equal(weights[key], fields["none"][key]) for key in weights), name


def test_without_a_logger_nothing_is_measured_or_drawn(runs, tmp_path, monkeypatch):
    left = {path.name for path in (runs / "none").iterdir()}
    assert left == {"config.yaml", "evaluation.json", "field.ckpt", "summary.json"}
    assert {path.name for path in (runs / "csv").iterdir()} - left == {"metrics.csv", "media"}
    monkeypatch.setattr(tracker, "FitLog", lambda: pytest.fail("measured"))
    run(tmp_path / "run", "logger=none")


def test_watched_values_by_hand():
    gradient = torch.tensor([[3.0, 0.0, 4.0], [0.0, 1.0, 0.0]])
    state = FieldState(None, gradient, gradient[:, 0], gradient, gradient, gradient)
    assert gradient_norm(state) == 3 and eikonal_deviation(state) == 2


def test_csv_holds_every_name_in_every_row(runs):
    table = rows(runs / "csv")
    assert [row["step"] for row in table] == [5, 10]
    data = GeneratedDataModule("sphere", 400)
    for row in table:
        assert set(row) >= LOGGED and all(math.isfinite(value) for value in row.values())
        # The fast recipe matches by squared distance.
        assert row[names.MATCHED_DISTANCE] == pytest.approx(row[names.DISTANCE] ** 0.5 * data.frames[0].scale, rel=1e-5)
        assert 0.01 < row[names.MEMORY] < 100 and row[names.STEPS_PER_SECOND] > 0
    assert table[0][names.LEARNING_RATE] > table[1][names.LEARNING_RATE] > 0
    losses = json.loads((runs / "csv" / "summary.json").read_text())["losses"]
    assert not set(losses) & {names.GRADIENT_NORM, names.MEMORY}
    assert losses["loss"] == table[-1]["loss"]


def test_wandb_offline_is_told_everything_and_stays_in_the_run_folder(runs):
    kinds = records(runs / "wandb")
    told = kinds["run"][0].run
    assert (told.run_group, told.job_type) == ("weights", "fit")
    assert re.fullmatch("weights-wandb-[0-9a-f]{6}", told.run_id)
    assert set(told.tags) == {"fast", "generated", "reconstruct"}
    config = {item.key: json.loads(item.value_json) for r in kinds["config"] for item in r.config.update}
    assert config["datamodule"]["shape"] == "sphere" and {"commit", "modified", "n2n"} <= set(config)
    table = history(kinds)
    training = [row for row in table if names.LOSS in row]
    assert [row["trainer/global_step"] for row in training] == [5, 10]
    assert all(set(row) >= LOGGED for row in training)
    csv_rows = rows(runs / "csv")
    assert [row[names.GRADIENT_NORM] for row in training] == [row[names.GRADIENT_NORM] for row in csv_rows]
    after = {key: value for row in table for key, value in row.items() if names.LOSS not in row}
    evaluation = json.loads((runs / "wandb" / "evaluation.json").read_text())
    assert after["denoise/sbp/cd_sum2"] == evaluation["evaluations"]["denoise/sbp"]["values"]["cd_sum2"]
    assert {names.NOISE, names.SPACING, names.VOXEL, names.SECONDS} <= set(after)
    kinds_of_media = [after[f"{name}._type"] for name in names.MEDIA]
    assert kinds_of_media == ["image-file", "object3D-file", "object3D-file"]
    stored = {path.suffix for path in (runs / "wandb" / "wandb").rglob("files/media/**/*") if path.is_file()}
    assert stored == {".png", ".glb", ".json"}
    assert kinds["exit"][0].exit.exit_code == 0
    assert {path.name for path in runs.iterdir()} <= {"home", "none", "csv", "wandb", "tensorboard"}
    assert not [path for path in (runs / "home").rglob("*") if "wandb" in path.name]


def test_tensorboard_is_told_everything(runs):
    accumulator = pytest.importorskip(
        "tensorboard.backend.event_processing.event_accumulator", reason="needs the extra tensorboard"
    )
    events = accumulator.EventAccumulator(str(runs / "tensorboard" / "tensorboard"), size_guidance={"tensors": 0})
    events.Reload()
    tags = events.Tags()
    assert set(tags["scalars"]) >= LOGGED | {names.NOISE, names.SPACING, names.SECONDS}
    assert [event.step for event in events.Scalars(names.LOSS)] == [5, 10]
    assert tags["images"] == [names.LEVEL_SETS]
    assert {f"{name}_VERTEX" for name in (names.MESH, names.POINTS)} <= set(tags["tensors"])


def test_a_run_that_fails_is_marked(tmp_path, monkeypatch, capfd):
    def broken(*arguments, **settings):
        raise RuntimeError("broken")

    monkeypatch.setattr(job, "fit", broken)
    with pytest.raises(RuntimeError, match="broken"):
        run(tmp_path / "run", "logger=wandb")
    assert records(tmp_path / "run")["exit"][0].exit.exit_code == 1
    assert "wandb:" not in "".join(capfd.readouterr())


def test_wandb_online_without_a_login_is_one_line_before_the_fit(tmp_path, monkeypatch, capfd):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("NETRC", str(tmp_path / "netrc"))
    for key in ("WANDB_API_KEY", "WANDB_IDENTITY_TOKEN_FILE"):
        monkeypatch.delenv(key, raising=False)
    monkeypatch.setattr(job, "fit", lambda *arguments, **settings: pytest.fail("fitted"))
    with pytest.raises(ConfigError, match="wandb login") as caught:
        run(tmp_path / "run", "logger=wandb", "logger.offline=false")
    assert "\n" not in str(caught.value) and "wandb:" not in "".join(capfd.readouterr())
    assert not (tmp_path / "run").exists()


def test_a_missing_tensorboard_is_one_line_before_the_fit(tmp_path, monkeypatch):
    monkeypatch.setattr("n2n.tracking.loggers.find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"pip install 'n2n\[tensorboard\]'"):
        run(tmp_path / "run", "logger=tensorboard")


def test_an_interrupted_fit_goes_on_with_another_logger(tmp_path, monkeypatch):
    whole = run(tmp_path / "whole", "checkpoint_every=5", "logger=none")
    part = tmp_path / "part"

    def interrupted(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(tracker.Tracker, "finish", interrupted)
        with pytest.raises(KeyboardInterrupt):
            run(part, "checkpoint_every=5", "logger=none")
    assert not (part / "field.ckpt").exists()
    run(part, "checkpoint_every=5", "logger=csv", "media=false", "evaluate=[denoise/sbp]")
    fields = [torch.load(folder / "field.ckpt")["weights"] for folder in (whole, part)]
    assert all(np.array_equal(fields[0][key], fields[1][key]) for key in fields[0])


def test_a_run_is_fitted_by_one_process_at_a_time(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    with claim(folder / CLAIM), pytest.raises(ConfigError, match="another process is fitting this"):
        run(folder)
    assert [path.name for path in folder.iterdir()] == ["claim.1"]
