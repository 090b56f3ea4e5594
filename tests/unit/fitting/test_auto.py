"""Scales chosen from the data, and configurations filled with them."""

import copy

import numpy as np
import pytest

from n2n.compose import compose
from n2n.fitting.auto import choose, fill, measure
from n2n.geometry.scaffold import MAX_POINTS
from n2n.geometry.scale import Scales
from n2n.geometry.shapes import sample_surface, scan


def _choose(noise=0.02, spacing=0.04, count=500, observations=1, seed=0):
    random = np.random.default_rng(seed)
    clouds = [random.uniform(-0.5, 0.5, (count, 3)) for _ in range(observations)]
    return choose(Scales(noise, spacing, 24, 3.0), clouds), clouds


def _values(recipe="fast", *overrides, **scales):
    chosen, _ = _choose(**scales)
    return chosen.values(compose([f"recipe={recipe}", *overrides]))


def test_more_noise_means_larger_cells_and_margins():
    (fine, _), (coarse, _) = _choose(noise=0.02), _choose(noise=0.04)
    assert fine.voxel < coarse.voxel < 2 * fine.voxel
    assert coarse.margin >= fine.margin and coarse.band > fine.band
    values = _values(noise=0.02), _values(noise=0.04)
    assert values[1]["queries.scale"] == pytest.approx(2 * values[0]["queries.scale"])
    assert values[1]["terms.smoothness.weight"] > values[0]["terms.smoothness.weight"]


def test_signs_are_not_asked_for_between_the_samples_of_the_scaffold():
    # Many observations allow small cells and margins, but the winding number is that of a few thousand samples.
    scales = Scales(noise=0.01, spacing=0.003, patch=48, area=4.0)
    assert choose(scales, [np.zeros((10_000, 3))] * 40).margin >= np.sqrt(4.0 / MAX_POINTS)


def test_denser_data_allow_smaller_cells():
    assert _choose(spacing=0.01)[0].voxel < _choose(spacing=0.04)[0].voxel


def test_a_clean_cloud_still_has_a_length():
    chosen, _ = _choose(noise=0.0, spacing=0.04)
    assert chosen.noise == pytest.approx(0.057 * 0.04)
    assert 0 < chosen.voxel < _choose(noise=0.02)[0].voxel


@pytest.mark.parametrize("noise", [0.001, 0.05])
def test_the_box_holds_all_observations_and_their_noise(noise):
    chosen, clouds = _choose(noise=noise, observations=3)
    points = np.concatenate(clouds)
    assert (points.min(axis=0) - chosen.lower >= 4 * noise - 1e-12).all()
    assert (chosen.upper - points.max(axis=0) >= 4 * noise - 1e-12).all()
    assert (np.subtract(chosen.upper, chosen.lower) < 1.5).all()


def test_a_batch_is_at_least_one_observation_within_bounds():
    assert 500 <= _choose(count=500, observations=3)[0].batch_size <= 1500
    assert 10_000 < _choose(count=100_000)[0].batch_size < 100_000


def test_queries_follow_the_number_of_observations():
    assert _values("paper", observations=1)["queries.kind"] == "neighbour"
    assert _values("paper", observations=2)["queries.kind"] == "observation"


def test_networks_take_more_and_smaller_steps_than_the_grid():
    grid, network = _values(), _values("fast", "architecture=mlp")
    assert grid["iterations"] < network["iterations"]
    assert grid["optimizer.lr"] > network["optimizer.lr"]


def test_weights_follow_the_unit_of_the_distance():
    # A distance of exponent 1 is larger than its square by 1 / noise (about); its companions grow alike.
    squared, plain = _values(noise=0.02), _values("fast", "distance=emd", noise=0.02)
    terms = ("eikonal", "smoothness", "scaffold", "far_field")
    ratios = [plain[f"terms.{term}.weight"] / squared[f"terms.{term}.weight"] for term in terms]
    assert ratios == pytest.approx([ratios[0]] * 4)
    assert ratios[0] == pytest.approx(1 / 0.02, rel=0.2)


def test_observations_together_are_denser_than_one():
    clouds = [sample_surface("sphere", 1000, seed) for seed in range(4)]
    one, pool = measure(clouds[:1])
    four, pooled = measure(clouds)
    assert len(pool) == 1000 and len(pooled) == 4000
    assert one.spacing == pytest.approx(np.sqrt(4 * np.pi / 1000), rel=0.1)
    assert four.spacing == pytest.approx(np.sqrt(4 * np.pi / 4000), rel=0.1)


def test_only_a_sample_of_many_points_is_measured():
    clouds = [scan("sphere", 15_000, 0.02, seed) for seed in range(4)]
    scales, pool = measure(clouds)
    assert len(pool) == 40_000
    assert scales.noise == pytest.approx(0.02, rel=0.25)
    assert scales.spacing == pytest.approx(np.sqrt(4 * np.pi / 60_000), rel=0.1)
    assert measure(clouds)[0] == scales


def test_fill_replaces_auto_by_the_value_of_its_dotted_name():
    config = {"a": "auto", "b": {"a": "auto", "c": "automatic", "d": 3}, "a.b": 1, "e": None}
    before = copy.deepcopy(config)
    filled = fill(config, {"a": 1, "b.a": 2, "b.d": 9})
    assert filled == {"a": 1, "b": {"a": 2, "c": "automatic", "d": 3}, "a.b": 1, "e": None}
    assert config == before


def test_effort_is_a_factor_on_the_iterations():
    chosen, _ = _choose()
    config = compose([])
    plain, half, more = (chosen.values({**config, "effort": effort}) for effort in (1, 0.5, 3))
    assert (half["iterations"], more["iterations"]) == (plain["iterations"] // 2, 3 * plain["iterations"])
    assert half["plan_reuse"] == plain["plan_reuse"] // 2 and more["plan_reuse"] == plain["plan_reuse"]


def test_more_points_than_the_fit_sees_do_not_make_finer_cells():
    # 16 batches of 32 768 points are seen while the weights are averaged.
    chosen, _ = _choose(spacing=0.004, count=5000, observations=400)
    seen = 16 * 32_768
    assert chosen.merged == pytest.approx(seen / 5000)
    assert chosen.spacing == pytest.approx(0.004 * (400 * 5000 / seen) ** 0.5)
    assert _choose(observations=8)[0].merged == 8
