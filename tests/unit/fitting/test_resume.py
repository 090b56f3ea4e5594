"""A fit that was interrupted gives the weights of one that was not."""

import errno
from functools import cache
from pathlib import Path

import pytest
import torch

from n2n.compose import compose
from n2n.datamodules.observations import ObservationsDataModule
from n2n.errors import ConfigError, InputError, OutputError
from n2n.fitting.fit import LAST_CHECKPOINT, fit
from n2n.geometry.shapes import scan

BLOCKS = ["iterations=40", "plan_reuse=10", "checkpoint_every=10", "device=cpu"]
RECIPES = {
    "fast": [],
    "pairs of observations": ["pairs=random", "batch_size=100"],
    "paper": ["recipe=paper", "architecture.width=32", "architecture.layers=3", "batch_size=64"],
    "network": ["architecture=siren", "architecture.width=32", "architecture.layers=2"],
}


def _data(count=2):
    return ObservationsDataModule([[scan("sphere", 200, 0.02, seed) for seed in range(count)]])


def _config(recipe="fast", *overrides):
    return compose([*RECIPES[recipe], *BLOCKS, *overrides])


@cache
def _whole(recipe="fast"):
    """The fit that nothing disturbed."""
    return fit(_data(), _config(recipe))


def _stop_at(iteration):
    def report(done, total, values):
        if done == iteration:
            raise KeyboardInterrupt

    return report


def _interrupted(config, run_dir, iteration, data=None):
    with pytest.raises(KeyboardInterrupt):
        fit(data or _data(), config, run_dir, _stop_at(iteration))


def _assert_equal(result, other):
    weights, others = result.field.state_dict(), other.field.state_dict()
    assert weights.keys() == others.keys()
    for name in weights:
        assert torch.equal(weights[name], others[name]), name


@pytest.mark.parametrize("recipe", RECIPES)
def test_resuming_changes_nothing(tmp_path, recipe):
    _interrupted(_config(recipe), tmp_path, 30)
    # Nothing but tensors and plain numbers may be in a checkpoint: it is loaded with weights_only=True.
    state = torch.load(tmp_path / LAST_CHECKPOINT, weights_only=True)
    assert all(value.isfinite().all() for value in state["state_dict"].values())
    resumed = fit(_data(), _config(recipe), tmp_path)
    assert 0 < resumed.report["resumed_at"] == state["global_step"] < 40
    _assert_equal(resumed, _whole(recipe))


def test_a_half_done_average_goes_on(tmp_path):
    # Both averaging and adapting have begun when the fit stops; without redistancing, which comes after the average.
    config = _config("fast", "average_from=0.2", "terms.smoothness.adapt_from=0.2", "redistance=false")
    _interrupted(config, tmp_path, 30)
    state = torch.load(tmp_path / LAST_CHECKPOINT, weights_only=True)
    assert state["global_step"] == 20 and state["state_dict"]["_averaged.n_averaged"] == 12
    resumed, whole = fit(_data(), config, tmp_path), fit(_data(), config)
    assert resumed.report["resumed_at"] == 20
    _assert_equal(resumed, whole)
    # The last state of the same fit, and an average that had forgotten its first part, would be others.
    for later in (1.0, 0.5):
        other = fit(_data(), {**config, "average_from": later})
        assert not torch.equal(other.field.levels[-1], whole.field.levels[-1])


def test_resuming_twice_changes_nothing(tmp_path):
    _interrupted(_config(), tmp_path, 20)
    _interrupted(_config(), tmp_path, 30)
    _assert_equal(fit(_data(), _config(), tmp_path), _whole())


def test_resuming_counts_on_from_where_it_was(tmp_path):
    config = _config()
    _interrupted(config, tmp_path, 30)
    seen = []
    result = fit(_data(), config, tmp_path, lambda done, total, values: seen.append(done))
    assert seen == list(range(result.report["resumed_at"] + 10, 41, 10))


def test_an_interruption_before_the_first_checkpoint_starts_anew(tmp_path):
    config = _config("fast", "checkpoint_every=30")
    _interrupted(config, tmp_path, 10)
    assert not (tmp_path / LAST_CHECKPOINT).exists()
    again = fit(_data(), config, tmp_path)
    assert again.report["resumed_at"] == 0
    _assert_equal(again, _whole())


def test_a_finished_fit_that_was_not_saved_comes_back_trained(tmp_path):
    # The program may be killed after the last checkpoint and before the field is written.
    config = _config()
    whole = fit(_data(), config, tmp_path)
    assert torch.load(tmp_path / LAST_CHECKPOINT, weights_only=True)["global_step"] == 40
    _assert_equal(fit(_data(), config, tmp_path), whole)


def test_several_shapes_resume(tmp_path):
    def data():
        return ObservationsDataModule([[scan("sphere", 200, 0.02)], [scan("torus", 200, 0.01)]])

    config = _config()
    _interrupted(config, tmp_path, 30, data())
    _assert_equal(fit(data(), config, tmp_path), fit(data(), config))


def test_checkpoints_are_written_as_often_as_asked(tmp_path):
    steps = []

    def report(done, total, values):
        path = tmp_path / LAST_CHECKPOINT
        steps.append(torch.load(path, weights_only=True)["global_step"] if path.exists() else None)

    # The report comes before the checkpoint of the same block.
    fit(_data(1), _config("fast", "checkpoint_every=20"), tmp_path, report)
    assert steps == [None, None, 20, 20]
    assert [path.name for path in tmp_path.iterdir()] == [LAST_CHECKPOINT]


def test_nothing_is_written_without_a_run_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fit(_data(1), compose(["iterations=10", "plan_reuse=5", "device=cpu"]))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("iteration", [20, 40])
def test_a_fit_of_other_points_or_settings_is_not_resumed(tmp_path, iteration):
    _interrupted(_config(), tmp_path, iteration)
    others = ObservationsDataModule([[scan("sphere", 200, 0.02, seed) for seed in (7, 8)]])
    with pytest.raises(ConfigError, match="holds a fit of other points or with other settings"):
        fit(others, _config(), tmp_path)
    with pytest.raises(ConfigError, match="holds a fit of other points or with other settings"):
        fit(_data(), _config("fast", "optimizer.lr=0.01"), tmp_path)


def test_a_damaged_checkpoint_says_what_to_do(tmp_path):
    _interrupted(_config(), tmp_path, 20)
    whole = (tmp_path / LAST_CHECKPOINT).read_bytes()
    (tmp_path / LAST_CHECKPOINT).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"last\.ckpt cannot be read as an n2n field .*; delete it and fit again"):
        fit(_data(), _config(), tmp_path)


def test_a_full_disk_leaves_the_last_whole_checkpoint(tmp_path, monkeypatch):
    _interrupted(_config(), tmp_path, 20)
    whole = (tmp_path / LAST_CHECKPOINT).read_bytes()

    def full(path, content):
        with path.open("wb") as file:
            file.write(content[:100])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError, match="No space left on device"):
        fit(_data(), _config(), tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {LAST_CHECKPOINT: whole}
