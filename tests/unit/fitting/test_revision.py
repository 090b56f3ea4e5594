"""The noise, measured anew by the field while it is fitted."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from n2n.architectures.base import SDF
from n2n.fitting.auto import choose
from n2n.fitting.prepare import Shape
from n2n.fitting.revision import Revision
from n2n.geometry.scale import Scales

NOISE = 0.02


class _Ball(SDF):
    def __init__(self):
        super().__init__()
        self.radius = torch.nn.Parameter(torch.tensor(0.5))

    def forward(self, points, condition=None):
        return points.norm(dim=-1) - self.radius


def _shape(measured, seed=0):
    random = np.random.default_rng(seed)
    directions = random.standard_normal((30_000, 3))
    cloud = 0.5 * directions / np.linalg.norm(directions, axis=1, keepdims=True) + NOISE * random.standard_normal(
        (30_000, 3)
    )
    scales = Scales(measured, float(np.sqrt(np.pi / len(cloud))), 96, np.pi)
    return Shape([], scales, choose(scales, [cloud]), cloud, None)


def _revision(*measured):
    built = []

    def build(config):
        built.append(config["noise"])
        return f"objective {len(built)}"

    def fill(shapes):
        return {"noise": [shape.chosen.noise for shape in shapes], "iterations": 100, "plan_reuse": 5}

    return Revision([_shape(noise) for noise in measured], fill, build), built


def _run(revision, steps=100):
    module = SimpleNamespace(field=_Ball(), iterations=steps, global_step=0, objective="first")
    revision.on_train_start(None, module)
    seen = []
    for module.global_step in range(0, steps, 5):
        revision.on_train_batch_start(None, module)
        seen.append(module.objective)
    return seen


@pytest.mark.parametrize("measured", [1.1, 1.6])
def test_noise_that_patches_overrated_is_put_right(measured):
    revision, _ = _revision(measured * NOISE)
    _run(revision)
    assert revision.config["noise"] == [pytest.approx(NOISE, rel=0.06)]


def test_patches_are_never_told_that_they_saw_too_little():
    revision, _ = _revision(0.8 * NOISE)
    _run(revision)
    assert revision.config["noise"] == [pytest.approx(0.8 * NOISE)]


def test_it_begins_with_less_and_asks_twice():
    revision, built = _revision(1.3 * NOISE)
    assert revision.config["noise"] == [pytest.approx(0.7 * 1.3 * NOISE)]
    seen = _run(revision)
    assert seen[:5] == ["first"] * 5 and seen[5] == "objective 1" and seen[8] == seen[-1] == "objective 2"
    assert len(built) == 2


def test_every_shape_has_its_own():
    revision, _ = _revision(1.2 * NOISE, 0.9 * NOISE)
    _run(revision)
    assert revision.config["noise"] == [pytest.approx(NOISE, rel=0.06), pytest.approx(0.9 * NOISE)]


def test_where_nothing_depends_on_the_noise_the_objective_stays():
    shape = _shape(1.3 * NOISE)
    config = {"iterations": 100, "plan_reuse": 5}
    revision = Revision([shape], lambda shapes: config, lambda config: pytest.fail("built anew"))
    assert _run(revision)[-1] == "first"


def test_a_resumed_fit_goes_on_with_what_was_found():
    revision, _ = _revision(1.5 * NOISE)
    _run(revision)
    resumed, built = _revision(1.5 * NOISE)
    resumed.load_state_dict(revision.state_dict())
    assert resumed.config == revision.config
    assert _run(resumed)[0] == "objective 1" and built == [revision.config["noise"]]


def _untouched(shape, plan_reuse=5):
    def fill(shapes):
        return {"noise": [shape.chosen.noise for shape in shapes], "iterations": 100, "plan_reuse": plan_reuse}

    revision = Revision([shape], fill, lambda config: pytest.fail("built anew"))
    _run(revision)
    return revision.config["noise"] == [shape.chosen.noise]


def test_sparse_points_are_not_asked_about():
    shape = _shape(1.3 * NOISE)
    assert _untouched(replace(shape, chosen=replace(shape.chosen, spacing=4 * shape.chosen.noise)))


def test_a_fit_of_one_matching_has_no_time_to_ask():
    assert _untouched(_shape(1.3 * NOISE), plan_reuse=100)


def test_many_observations_begin_with_all_of_the_noise():
    shape = _shape(1.3 * NOISE)
    many = replace(shape, chosen=replace(shape.chosen, observations=9))

    def fill(shapes):
        return {"noise": shapes[0].chosen.noise, "iterations": 100, "plan_reuse": 5}

    revision = Revision([many], fill, lambda config: "new")
    assert revision.config["noise"] == many.chosen.noise
    _run(revision)
    assert revision.config["noise"] == pytest.approx(NOISE, rel=0.06)


def test_a_clean_cloud_keeps_its_length():
    chosen = _shape(0.0).chosen
    assert chosen.revised(1e-9, chosen.noise) == chosen.noise > 0


def test_what_cannot_be_measured_stays():
    chosen = _shape(NOISE).chosen
    assert chosen.revised(float("nan"), chosen.noise) == chosen.noise
