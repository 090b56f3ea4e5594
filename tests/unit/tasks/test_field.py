"""Fitted fields on disk, and `n2n.fit` from arrays to a field."""

from pathlib import Path

import numpy as np
import pytest
import torch

import n2n
from n2n.errors import ConfigError, InputError
from n2n.fitting.assemble import build_field
from n2n.geometry.frame import Frame
from n2n.geometry.shapes import scan
from n2n.tasks import api
from n2n.tasks.field import FIELD_FILE, Field

SHORT = ["iterations=10", "plan_reuse=5"]
ARCHITECTURES = {
    "mlp": {"layers": 2, "width": 16},
    "siren": {"layers": 2, "width": 16},
    "grid": {"voxel": 0.2, "lower": (-1.0, -1.0, -1.0), "upper": (1.0, 1.0, 1.0), "levels": 2},
}


def _field(name="mlp", shapes=1):
    torch.manual_seed(0)
    config = {"architecture": {"name": name, **ARCHITECTURES[name]}, "seed": 3}
    sdf = build_field(config, shapes)
    with torch.no_grad():
        for parameter in sdf.parameters():
            parameter += 0.01 * torch.randn_like(parameter)
    frames = [Frame((5e5 + i, 5e6, 100.0), 40.0 + i) for i in range(shapes)]
    return Field(sdf, frames, config, {"iterations": 7, "noise": [0.5]})


@pytest.mark.parametrize("shapes", [1, 3])
@pytest.mark.parametrize("name", ARCHITECTURES)
def test_saving_and_loading_changes_nothing(tmp_path, name, shapes):
    field = _field(name, shapes)
    points = np.random.default_rng(0).normal(size=(50, 3)) * 20 + [5e5, 5e6, 100]
    path = field.save(tmp_path / "new" / "run")
    loaded = Field.load(tmp_path / "new" / "run", device="cpu")
    assert path.name == FIELD_FILE and list(path.parent.iterdir()) == [path]
    assert (loaded.frames, loaded.config, loaded.report) == (field.frames, field.config, field.report)
    for shape in range(shapes):
        assert np.array_equal(loaded.sdf_at(points, shape), field.sdf_at(points, shape))
    assert not loaded.sdf.training


def test_files_hold_plain_numbers_and_tensors(tmp_path):
    state = torch.load(_field().save(tmp_path), weights_only=True)
    assert state["frames"] == [{"centre": (5e5, 5e6, 100.0), "scale": 40.0}]


def test_saving_again_replaces_the_file(tmp_path):
    field = _field()
    field.save(tmp_path)
    field.report["iterations"] = 8
    field.save(tmp_path)
    assert Field.load(tmp_path).report["iterations"] == 8
    assert [path.name for path in tmp_path.iterdir()] == [FIELD_FILE]


def test_a_folder_without_a_field_says_how_to_make_one(tmp_path):
    for folder in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(InputError, match=r"holds no finished run .* make one with `n2n fit`"):
            Field.load(folder)


def _without(key):
    def damage(path):
        state = torch.load(path, weights_only=True)
        del state[key]
        torch.save(state, path)

    return damage


def _other_network(path):
    state = torch.load(path, weights_only=True)
    state["config"]["architecture"]["width"] = 17
    torch.save(state, path)


@pytest.mark.parametrize(
    "damage",
    [
        pytest.param(lambda path: path.write_bytes(b"not a field"), id="other file"),
        pytest.param(lambda path: path.write_bytes(b""), id="empty"),
        pytest.param(lambda path: path.write_bytes(path.read_bytes()[:1000]), id="cut off"),
        pytest.param(lambda path: torch.save([1, 2], path), id="a list"),
        pytest.param(lambda path: torch.save({"config": np.float64(1)}, path), id="not plain"),
        pytest.param(_without("frames"), id="no frames"),
        pytest.param(_without("weights"), id="no weights"),
        pytest.param(_other_network, id="other network"),
    ],
)
def test_damaged_files_are_one_line(tmp_path, damage):
    damage(_field().save(tmp_path))
    with pytest.raises(InputError, match="cannot be read as an n2n field") as caught:
        Field.load(tmp_path)
    assert "\n" not in str(caught.value)


def test_fit_takes_an_array_and_keeps_the_field(tmp_path):
    cloud = 30 * scan("sphere", 300, 0.02) + [5e5, 5e6, 100]
    seen = []
    field = n2n.fit(cloud, overrides=SHORT, run_dir=tmp_path, report=lambda *state: seen.append(state[0]))
    assert seen == [5, 10]
    loaded = n2n.Field.load(tmp_path)
    assert np.array_equal(loaded.denoise(cloud), field.denoise(cloud))
    radius = np.linalg.norm(field.denoise(cloud) - [5e5, 5e6, 100], axis=1)
    assert np.abs(radius / 30 - 1).max() < 0.2


@pytest.mark.parametrize("kind", [str, Path])
def test_fit_makes_the_folder_it_is_given(tmp_path, kind):
    cloud, folder = scan("sphere", 300, 0.02), tmp_path / "new" / "folder"
    field = n2n.fit(cloud, overrides=[*SHORT, "redistance=false"], run_dir=kind(folder))
    assert np.array_equal(n2n.Field.load(folder).sdf_at(cloud), field.sdf_at(cloud))


def test_fit_takes_observations_of_different_size():
    field = n2n.fit([scan("sphere", 150, 0.02), scan("sphere", 200, 0.02, 1)], overrides=SHORT, seed=4)
    assert field.report["observations"] == [2] and field.config["seed"] == 4
    assert field.sdf_at(np.zeros((1, 3)))[0] < 0 < field.sdf_at(np.array([[1.3, 0, 0]]))[0]
    mesh = field.reconstruct(resolution=32)
    assert mesh.volume == pytest.approx(4 / 3 * np.pi, rel=0.1)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((50, 3)), r"points\[0\]: 50 points are too few"),
        (np.full((200, 3), np.nan), r"points\[0\]: 200 of 200 points are NaN"),
        (np.zeros((200, 2)), r"points\[0\]: expected an array of shape \(n, 3\)"),
        (np.zeros((200, 3)), "all 200 points are equal"),
        (np.zeros((2, 50, 3)), r"points\[0\]: 50 points are too few"),
        (torch.zeros(200, 2), r"points\[0\]: expected an array of shape \(n, 3\)"),
        (torch.zeros(9), r"^points: got 9 single numbers; give an array of shape \(n, 3\), or a list of such arrays$"),
        ([1.0, 2.0, 3.0], r"^points: got 3 single numbers; give an array of shape"),
        ([[1.0, 2.0, 3.0], [4.0, 5.0]], r"^points: got rows of 2 to 3 numbers; give an array of shape"),
        ([np.zeros((150, 3)), np.zeros(3)], r"^points: got a list of 2 parts, one of shape \(3,\); give an array"),
        ([["a", "b", "c"]], r"^points: cannot be read as numbers \(could not convert"),
        ([], "no observations given"),
    ],
)
def test_clouds_that_cannot_be_fitted_are_told(points, message):
    with pytest.raises(InputError, match=message):
        n2n.fit(points)


@pytest.mark.parametrize(
    ("change", "observations"),
    [
        (torch.tensor, 1),
        (lambda cloud: torch.tensor(cloud, requires_grad=True), 1),
        (np.ndarray.tolist, 1),
        (list, 1),
        (lambda cloud: [cloud.tolist(), cloud.tolist()[:120]], 2),
        (lambda cloud: [torch.tensor(cloud), torch.tensor(cloud[:120])], 2),
        (lambda cloud: (cloud, cloud), 2),
        (lambda cloud: np.stack([cloud, cloud]), 2),
        (lambda cloud: torch.tensor(cloud).float()[None], 1),
    ],
    ids=["tensor", "grad", "lists", "rows", "clouds as lists", "tensors", "tuple", "3-D array", "3-D tensor"],
)
def test_whatever_holds_numbers_is_a_cloud(monkeypatch, change, observations):
    seen = []

    def no_fit(clouds, *_):
        seen.extend(clouds)
        return _field()

    monkeypatch.setattr(api, "fit_clouds", no_fit)
    cloud = scan("sphere", 150, 0.02)
    n2n.fit(change(cloud))
    assert len(seen) == observations
    assert all(isinstance(part, np.ndarray) and part.dtype == np.float64 for part in seen)
    np.testing.assert_allclose(seen[0], cloud, atol=1e-6)


def test_recipes_and_settings_are_checked():
    cloud = scan("sphere", 150, 0.02)
    with pytest.raises(ConfigError, match="Unknown recipe 'quick'"):
        n2n.fit(cloud, recipe="quick")
    with pytest.raises(ConfigError, match="iterations=0 is out of range"):
        n2n.fit(cloud, overrides=["iterations=0"])
