"""What many observations learn from a short fit to a few of their points."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh

from n2n.compose import compose
from n2n.config import AUTO
from n2n.datamodules.observations import ObservationsDataModule
from n2n.fitting.auto import choose, measure
from n2n.fitting.fit import fit
from n2n.fitting.pilot import is_worth_a_pilot, pilot_of, steps_of, told
from n2n.fitting.prepare import Shape
from n2n.geometry.scaffold import Scaffold

NOISE = 0.03
GRID = {"architecture": {"name": "grid"}, "iterations": 200, "plan_reuse": 7, "effort": 1.0}


def _clouds(count, points=3000):
    """Scans of a plate that is two deviations of their noise thick."""
    plate = trimesh.creation.box((1, 1, 2 * NOISE))
    return [
        trimesh.sample.sample_surface(plate, points, seed=seed)[0]
        + NOISE * np.random.default_rng(seed).standard_normal((points, 3))
        for seed in range(count)
    ]


def _shape(count=2, points=500):
    clouds = _clouds(count, points)
    scales, sample = measure(clouds)
    tensors = [torch.as_tensor(cloud, dtype=torch.float32) for cloud in clouds]
    return Shape(tensors, scales, choose(scales, clouds), sample, Scaffold.build(sample, scales))


@pytest.fixture(scope="module")
def shape():
    return _shape()


def test_thin_parts_are_not_taken_for_noise():
    data = ObservationsDataModule([_clouds(8)])
    patches = measure([cloud.double().numpy() for cloud in data.shapes[0]])[0].noise * data.frames[0].scale
    found = fit(data, compose([])).report["noise"][0]
    assert patches > 1.35 * NOISE
    assert 0.9 * NOISE < found < 0.95 * patches


def test_many_dense_observations_of_a_grid_are_worth_one(shape):
    assert is_worth_a_pilot(shape, GRID)
    assert is_worth_a_pilot(shape, {**GRID, "iterations": AUTO})
    assert not is_worth_a_pilot(shape, {**GRID, "iterations": 50})
    assert not is_worth_a_pilot(_shape(1, 1000), GRID)
    assert not is_worth_a_pilot(shape, {**GRID, "architecture": {"name": "mlp"}})
    assert not is_worth_a_pilot(replace(shape, chosen=replace(shape.chosen, spacing=4 * shape.chosen.noise)), GRID)


def test_it_fits_the_sample_for_less_long(shape):
    pilot, config = pilot_of(shape, GRID)
    assert [len(cloud) for cloud in pilot.observations] == [len(shape.sample)]
    assert pilot.chosen.observations == 1
    assert pilot.scales.spacing == pytest.approx(math.sqrt(shape.scales.area / len(shape.sample)))
    assert config == {**GRID, "iterations": AUTO, "plan_reuse": AUTO, "effort": 0.4, "average_from": 1.0}


def test_it_stops_where_its_field_is_asked_for_the_last_time():
    # Blocks of eight: 0.4 of 64 steps are over when the one that begins at 32 begins.
    assert steps_of({"iterations": 64, "plan_reuse": 8}) == 32
    assert steps_of({"iterations": 64, "plan_reuse": 40}) == 40


def test_what_it_tells_changes_lengths_and_scaffold(shape):
    less = 0.6 * shape.scales.noise
    after = told(shape, less, seed=0)
    assert after.scales.noise == after.chosen.noise == less
    assert after.chosen.voxel < shape.chosen.voxel
    assert after.chosen.observations == 2
    assert after.scaffold is not shape.scaffold
    assert told(replace(shape, scaffold=None), less, seed=0).scaffold is None

    same = told(shape, 0.95 * shape.scales.noise, seed=0)
    assert same.scaffold is shape.scaffold
    assert same.chosen.noise == 0.95 * shape.scales.noise


def test_every_shape_has_its_own(monkeypatch):
    asked = []

    def steps(*arguments):
        asked.append(steps_of(*arguments))
        return asked[-1]

    monkeypatch.setattr("n2n.fitting.fit.steps_of", steps)
    data = ObservationsDataModule([_clouds(2, 700), _clouds(1, 700), [10 * cloud for cloud in _clouds(3, 500)]])
    result = fit(data, compose(["effort=0.1", "validation=0.05"]))
    assert len(asked) == 2
    assert result.report["noise"][2] == pytest.approx(10 * result.report["noise"][0], rel=0.5)


def test_a_resumed_fit_has_the_cells_of_before(tmp_path, monkeypatch):
    data, config = ObservationsDataModule([_clouds(3, 500)]), compose(["effort=0.2", "checkpoint_every=1"])
    whole = fit(data, config)

    def stop(done, total, values):
        if done > total / 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit(data, config, tmp_path, stop)
    monkeypatch.setattr("n2n.fitting.fit.pilot_of", lambda *_: pytest.fail("another pilot"))
    resumed = fit(data, config, tmp_path)
    assert resumed.report["resumed_at"] > 0
    assert all(
        torch.equal(a, b)
        for a, b in zip(whole.field.state_dict().values(), resumed.field.state_dict().values(), strict=True)
    )
