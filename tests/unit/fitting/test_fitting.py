"""Short fits to small scans, with every component by name."""

import itertools

import numpy as np
import pytest
import torch

from n2n import registry
from n2n.compose import compose
from n2n.datamodules.observations import ObservationsDataModule
from n2n.errors import ConfigError
from n2n.fitting.assemble import build_field
from n2n.fitting.fit import fit, pick_device
from n2n.geometry.shapes import sample_surface, scan

SHORT = ["iterations=20", "plan_reuse=5", "device=cpu"]
TINY_NETWORK = ["architecture.width=32", "architecture.layers=3"]
TINY = {"mlp": TINY_NETWORK, "siren": ["architecture.width=32", "architecture.layers=2"], "grid": []}


@pytest.fixture(scope="module")
def sphere():
    return scan("sphere", 300, 0.02)


def _fit(clouds, *overrides, losses=None):
    """Fit one shape's observations; collect the loss of every block."""
    report = None if losses is None else lambda done, total, values: losses.append(values["loss"])
    return fit(ObservationsDataModule([clouds]), compose([*SHORT, *overrides]), report=report)


def _at(result, world, shape=0):
    """f at world positions, unit coordinates."""
    points = torch.as_tensor(result.frames[shape].to_unit(np.asarray(world, float)), dtype=torch.float32)
    with torch.no_grad():
        return result.field(points, torch.full((len(points),), shape))


def _weights(result):
    return torch.cat([p.detach().flatten() for p in result.field.parameters()])


def _leaves(config):
    if isinstance(config, dict):
        return [leaf for value in config.values() for leaf in _leaves(value)]
    return [config]


def test_the_fast_recipe_finds_a_sphere():
    result = _fit([scan("sphere", 1500, 0.02)], "iterations=60", "plan_reuse=20")
    surface = sample_surface("sphere", 300, seed=5)
    assert _at(result, surface).abs().mean() < 0.012
    assert (_at(result, 0.8 * surface) < -0.1).all() and (_at(result, 1.15 * surface) > 0.05).all()
    assert not result.field.training


@pytest.mark.parametrize(("recipe", "architecture"), [("fast", "grid"), ("fast", "mlp"), ("paper", "grid")])
def test_every_auto_is_filled(sphere, recipe, architecture):
    overrides = [f"recipe={recipe}", f"architecture={architecture}", *TINY[architecture], *SHORT, "batch_size=64"]
    config, untouched = compose(overrides), compose(overrides)
    filled = fit(ObservationsDataModule([[sphere]]), config).config
    assert "auto" in _leaves(config) and config == untouched
    assert "auto" not in _leaves(filled)
    assert filled["iterations"] == 20 and filled["batch_size"] == 64


def test_filled_values_are_plain_numbers(sphere):
    # A checkpoint that holds anything else cannot be loaded with weights_only=True.
    result = _fit([sphere])
    for leaf in _leaves(result.config) + _leaves(result.report):
        for value in leaf if isinstance(leaf, list | tuple) else [leaf]:
            assert type(value) in (bool, int, float, str, type(None))


def test_a_device_of_auto_is_named_in_the_result(sphere):
    result = _fit([sphere], "device=auto")
    assert result.config["device"] == result.report["device"] == str(next(result.field.parameters()).device)


@pytest.mark.parametrize("overrides", [[], ["recipe=paper", *TINY_NETWORK, "batch_size=64", "plan_reuse=1"]])
def test_equal_seeds_give_equal_weights(sphere, overrides):
    clouds = [sphere, scan("sphere", 300, 0.02, 1)]
    first, second = (_fit(clouds, *overrides, "seed=3") for _ in range(2))
    assert torch.equal(_weights(first), _weights(second))
    other = _fit(clouds, *overrides, "seed=4")
    assert not torch.equal(_weights(first), _weights(other))


def test_random_state_of_the_caller_does_not_matter(sphere):
    torch.manual_seed(1)
    first = _fit([sphere], "architecture=mlp", *TINY["mlp"])
    torch.manual_seed(2)
    torch.rand(3), np.random.rand(3)
    assert torch.equal(_weights(first), _weights(_fit([sphere], "architecture=mlp", *TINY["mlp"])))


@pytest.mark.parametrize("task", ["reconstruct", "denoise"])
def test_the_paper_recipe_lowers_its_loss(sphere, task):
    losses = []
    settings = [*TINY_NETWORK, "batch_size=64", "plan_reuse=1", "optimizer.lr=1e-3"]
    result = _fit([sphere], "recipe=paper", f"task={task}", *settings, losses=losses)
    assert len(losses) == 20 and np.isfinite(losses).all()
    assert np.mean(losses[-5:]) < 0.95 * np.mean(losses[:5])
    assert ("regulariser" in result.report["losses"]) == (task == "reconstruct")


@pytest.mark.parametrize("recipe", ["fast", "paper"])
@pytest.mark.parametrize("name", registry.ARCHITECTURES.names())
def test_architectures_by_name(sphere, name, recipe):
    # Only the distance and f^2 at the data, from the architecture's own start: nothing that depends on tuned weights.
    overrides = [f"recipe={recipe}", f"architecture={name}", *TINY[name], "optimizer.lr=5e-3", "batch_size=128"]
    settings = ["regulariser=none", "regulariser.name=on_surface", "regulariser_weight=1", "scaffold=false"]
    config = compose([*SHORT, *overrides, *settings])
    result = fit(ObservationsDataModule([[sphere]]), {**config, "terms": {}})
    surface = sample_surface("sphere", 300, seed=5)
    after = _at(result, surface).abs().mean()
    torch.manual_seed(0)
    result.field = build_field(result.config, 1)
    assert after < 0.8 * _at(result, surface).abs().mean()


@pytest.mark.parametrize("name", [*registry.DISTANCES.names(), "emd_squared"])
def test_distances_by_name(sphere, name):
    result = _fit([sphere], f"distance={name}")
    assert _at(result, sample_surface("sphere", 200)).abs().mean() < 0.05


@pytest.mark.parametrize("name", registry.PAIRINGS.names())
def test_pairings_by_name(sphere, name):
    result = _fit([sphere], f"pairing={name}", "batch_size=256")
    assert _at(result, sample_surface("sphere", 200)).abs().mean() < 0.05


@pytest.mark.parametrize("name", registry.REGULARISERS.names())
def test_regularisers_by_name(sphere, name):
    config = compose([*SHORT, "iterations=1", f"regulariser.name={name}", "regulariser_weight=1e-6"])
    losses = fit(ObservationsDataModule([[sphere]]), {**config, "terms": {}}).report["losses"]
    assert (losses["regulariser"] > 0) == (name != "none")
    assert losses["loss"] == pytest.approx(losses["distance"] + 1e-6 * losses["regulariser"], rel=1e-4)


# Matching two clouds is coarser than matching a cloud with itself.
@pytest.mark.parametrize(("pairs", "error"), [("same", 0.03), ("random", 0.2)])
def test_several_observations_of_different_size(pairs, error):
    clouds = [scan("sphere", count, 0.02, seed) for seed, count in enumerate([150, 200, 250, 300])]
    result = _fit(clouds, f"pairs={pairs}", "iterations=40")
    assert _at(result, sample_surface("sphere", 200)).abs().mean() < error
    assert _at(result, [[0.0, 0, 0]]) < 0
    assert result.report["observations"] == [4] and result.report["points"] == [900]


def test_merged_observations_know_the_surface_better_than_one():
    clouds = [scan("sphere", 200, 0.05, seed) for seed in range(8)]
    surface = sample_surface("sphere", 300, seed=9)
    settings = ["iterations=60", "batch_size=1600"]
    one, eight = (_at(_fit(clouds[:count], *settings), surface).abs().mean() for count in (1, 8))
    assert eight < 0.7 * one


@pytest.mark.parametrize("overrides", [["iterations=60"], ["architecture=mlp", *TINY["mlp"]]])
def test_two_shapes_in_one_field(overrides):
    # The centre tells them apart: inside the sphere, in the hole of the torus, which is scaled and far away.
    shapes = [[scan("sphere", 400, 0.01)], [20 * scan("torus", 400, 0.01) + [1000, 0, 0]]]
    result = fit(ObservationsDataModule(shapes), compose([*SHORT, "optimizer.lr=0.01", *overrides]))
    assert len(result.frames) == 2 and result.frames[1].scale == pytest.approx(20, rel=0.1)
    if "iterations=60" in overrides:
        assert _at(result, [[0.0, 0, 0]], shape=0) < 0
        assert _at(result, [[1000.0, 0, 0]], shape=1) > 0
        assert _at(result, sample_surface("sphere", 200), 0).abs().mean() < 0.02
        assert _at(result, 20 * sample_surface("torus", 200) + [1000, 0, 0], 1).abs().mean() < 0.03
    else:
        assert not torch.equal(_at(result, [[0.5, 0, 0]], 0), _at(result, [[1010.0, 0, 0]], 1))


def test_report_counts_iterations_and_measures_in_world_units():
    cloud = scan("sphere", 1500, 0.02)
    seen = []
    config = compose(SHORT)
    result = fit(ObservationsDataModule([[50 * cloud]]), config, report=lambda *state: seen.append(state))
    assert [(done, total) for done, total, _ in seen] == [(5, 20), (10, 20), (15, 20), (20, 20)]
    assert result.report["noise"] == [pytest.approx(50 * 0.02, rel=0.35)]
    assert result.report["spacing"] == [pytest.approx(50 * np.sqrt(4 * np.pi / 1500), rel=0.15)]
    assert result.report["losses"] == seen[-1][2]


def test_the_last_block_may_be_shorter(sphere):
    seen = []
    fit(
        ObservationsDataModule([[sphere]]), compose([*SHORT, "iterations=12"]), report=lambda *state: seen.append(state)
    )
    assert [done for done, _, _ in seen] == [5, 10, 12]


def test_the_learning_rate_follows_the_scheduler():
    from n2n.fitting.schedule import constant, cosine

    def rates(scheduler, **more):
        optimizer = torch.optim.SGD([torch.nn.Parameter(torch.zeros(1))], lr=2.0)
        schedule = scheduler(optimizer, 10, **more)
        seen = []
        for _ in range(13):
            seen.append(optimizer.param_groups[0]["lr"])
            optimizer.step()
            schedule.step()
        return seen

    decayed = rates(cosine, final=0.1)
    assert decayed[0] == 2 and decayed[5] == pytest.approx(2 * 0.55) and decayed[10:] == pytest.approx([0.2] * 3)
    assert all(a >= b for a, b in itertools.pairwise(decayed))
    assert rates(constant) == [2.0] * 13


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["architecture=mlp", "architecture.output=sigmoid"], "mlp: output must be 'tanh' or 'linear', got 'sigmoid'"),
        (["distance.p=3"], "emd: p must be 1 or 2, got 3"),
        (["architecture.voxel=1e-4"], "grid: voxel=0.0001 makes .* use a larger voxel"),
        (["terms.on_surface.weight=auto"], "on_surface"),
        (["pairing.leaf_size=0"], "leaf_size"),
    ],
)
def test_arguments_out_of_range_are_configuration_errors(sphere, overrides, message):
    with pytest.raises(ConfigError, match=message):
        _fit([sphere], *overrides)


def test_devices_that_do_not_exist_are_refused(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert pick_device("auto") == torch.device("cpu")
    with pytest.raises(ConfigError, match="use device=cpu"):
        pick_device("cuda")


@pytest.mark.parametrize(
    "overrides",
    [["plan_reuse=1"], ["plan_reuse=50"], ["plan_reuse=50", "regulariser=consistency", "regulariser_weight=1"]],
)
def test_a_fit_that_diverges_says_so(overrides):
    settings = [*SHORT, "architecture=mlp", *TINY["mlp"], "optimizer.lr=1e30", *overrides]
    with pytest.raises(ConfigError, match=r"diverged.*optimizer\.lr"):
        _fit([scan("sphere", 200, 0.01)], *settings)
