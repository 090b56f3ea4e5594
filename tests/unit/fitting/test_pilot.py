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
    found = fit(data, compose(["iterations=1"])).report["noise"][0]
    assert patches > 1.35 * NOISE
    assert NOISE < found < 0.95 * patches


def test_many_dense_observations_of_a_grid_are_worth_one(shape):
    assert is_worth_a_pilot([shape], GRID)
    assert not is_worth_a_pilot([_shape(1, 1000)], GRID)
    assert not is_worth_a_pilot([shape], {**GRID, "architecture": {"name": "mlp"}})
    sparse = replace(shape, chosen=replace(shape.chosen, spacing=4 * shape.chosen.noise))
    assert not is_worth_a_pilot([sparse], GRID)
    assert is_worth_a_pilot([sparse, shape], GRID)


def test_it_fits_the_sample_for_less_long(shape):
    (pilot,), config = pilot_of([shape], GRID)
    assert [len(cloud) for cloud in pilot.observations] == [len(shape.sample)]
    assert pilot.chosen.observations == 1
    assert pilot.scales.spacing == pytest.approx(math.sqrt(shape.scales.area / len(shape.sample)))
    assert config == {**GRID, "iterations": AUTO, "plan_reuse": AUTO, "effort": 0.4}


def test_it_stops_when_its_field_has_been_asked():
    # Blocks of eight: 0.4 of 64 steps are over when the one that begins at 32 begins.
    assert steps_of({"iterations": 64, "plan_reuse": 8}) == 33
    assert steps_of({"iterations": 64, "plan_reuse": 40}) == 41


def test_what_it_tells_changes_lengths_and_scaffold(shape):
    (pilot,), _ = pilot_of([shape], GRID)
    less = replace(pilot, chosen=replace(pilot.chosen, noise=0.6 * shape.scales.noise))
    (after,) = told([shape], [less], seed=0)
    assert after.scales.noise == after.chosen.noise == 0.6 * shape.scales.noise
    assert after.chosen.voxel < shape.chosen.voxel
    assert after.chosen.observations == 2
    assert after.scaffold is not shape.scaffold

    (same,) = told([shape], [pilot], seed=0)
    assert same.scaffold is shape.scaffold
    assert same.scales.noise == shape.scales.noise
