"""Composition: three gates, plain dicts, one-line messages."""

import json

import pytest

from n2n.compose import compose, config_hash
from n2n.config import Config, QueriesConfig
from n2n.errors import ConfigError


def message(*overrides: str) -> str:
    with pytest.raises(ConfigError) as caught:
        compose(overrides)
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_the_result_is_plain():
    config = compose(["seed=3"])
    assert config["seed"] == 3
    assert json.loads(json.dumps(config)) == config


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        (
            "distance=emdd",
            "Unknown distance 'emdd'. Did you mean 'emd'? Known: approx, cd, emd, emd_squared, sinkhorn.",
        ),
        ("recipe=papper", "Unknown recipe 'papper'. Did you mean 'paper'? Known: fast, paper."),
        ("architecture.name=sirenn", "Unknown architecture 'sirenn'. Did you mean 'siren'? Known: grid, mlp, siren."),
        ("distance.pp=1", "distance 'emd' has no argument 'pp'. Did you mean 'p'? Known: p."),
        (
            "pairing.leafsize=1",
            "pairing 'stratified' has no argument 'leafsize'. Did you mean 'leaf_size'? Known: leaf_size.",
        ),
        (
            "queries.knd=auto",
            "Unknown configuration key 'queries.knd'. Did you mean 'kind'? Known: kind, neighbour, pulls, scale.",
        ),
        ("terms.eikonal.att=1", "regulariser 'eikonal' has no argument 'att'. Did you mean 'at'? Known: at."),
        ("terms.eikonal=1", "terms.eikonal=1 is not a term; give its weight as terms.eikonal.weight=..."),
        ("datamodule=files", "datamodule.paths is not set; give it as datamodule.paths=..."),
        ("seed=x", "seed=x: Value 'x' of type 'str' could not be converted to Integer"),
        ("seed=-1", "seed=-1 is out of range; give a whole number from 0 to 2147483647"),
        ("seed=2147483648", "seed=2147483648 is out of range; give a whole number from 0 to 2147483647"),
        (f"seed={10**20 - 1}", f"seed={10**20 - 1} is out of range; give a whole number from 0 to 2147483647"),
        ("iterations=null", "iterations=null is not a number; give a number >= 1"),
        ("batch_size=null", "batch_size=null is not a number; give a number >= 1"),
        ("plan_reuse=null", "plan_reuse=null is not a number; give a number >= 1"),
        ("queries.scale=null", "queries.scale=null is not a number; give a number >= 0"),
        ("iterations=soon", "iterations=soon is not a number; give a number >= 1"),
        ("iterations=1.5", "iterations=1.5 is not a whole number; give one >= 1"),
        ("batch_size=0", "batch_size=0 is out of range; give a number >= 1"),
        ("regulariser_weight=-0.1", "regulariser_weight=-0.1 is out of range; give a number >= 0"),
        ("regulariser_weight=nan", "regulariser_weight=nan is out of range; give a number >= 0"),
        ("num_observations=0", "num_observations=0 is out of range; give a number >= 1"),
        ("terms.eikonal.weight=-1", "terms.eikonal.weight=-1 is out of range; give a number >= 0"),
        ("device=gpu", "device=gpu is not known; choose one of: auto, cpu, cuda, mps"),
        ("task=paint", "Unknown task 'paint'. Known: denoise, reconstruct, upsample."),
    ],
)
def test_messages(override, expected):
    assert message(override) == expected


@pytest.mark.parametrize(
    ("override", "part"),
    [
        ("iteration=5", "Unknown configuration key 'iteration'. Did you mean 'iterations'?"),
        ("+iteration=5", "Unknown configuration key 'iteration'. Did you mean 'iterations'?"),
        ("terms.zero_levl.weight=1", "Unknown regulariser 'zero_levl'. Did you mean 'zero_level'?"),
        ("optimizer.lrr=1", "has no argument 'lrr'. Did you mean 'lr'?"),
        ("optimizer._target_=torch.optim.Atom", "optimizer._target_=torch.optim.Atom cannot be imported"),
        ("iterations", "cannot read the setting 'iterations'; write key=value"),
        ("a b=c", "cannot read the setting 'a b=c'; write key=value"),
        ("iterations=[1", "cannot read the setting 'iterations=[1'; write key=value"),
        ("terms=null", "terms=null"),
        ("foo/bar=1", "Unknown configuration key 'foo/bar'"),
    ],
)
def test_message_parts(override, part):
    assert part in message(override)


def test_arguments_a_yaml_file_does_not_mention_can_be_given():
    assert compose(["architecture=mlp", "architecture.num_conditions=2"])["architecture"]["num_conditions"] == 2
    assert compose(["terms.on_surface.weight=0.2"])["terms"]["on_surface"] == {"weight": 0.2}
    assert compose(["optimizer.weight_decay=0.1"])["optimizer"]["weight_decay"] == 0.1


def test_terms_can_be_dropped():
    assert "eikonal" not in compose(["~terms.eikonal"])["terms"]
    assert compose(["terms.eikonal=null"])["terms"]["eikonal"] is None


def test_whole_numbers_may_be_written_as_1e5():
    assert compose(["iterations=1e5"])["iterations"] == 100_000
    assert isinstance(compose(["iterations=1e5"])["iterations"], int)


def test_only_the_number_of_observations_may_be_missing():
    assert compose(["num_observations=null"])["num_observations"] is None
    for key in ("seed", "checkpoint_every", "queries.neighbour"):
        assert f"{key}=null" in message(f"{key}=null")


def test_the_largest_seed_is_one():
    assert compose(["seed=2147483647"])["seed"] == 2**31 - 1


def test_later_overrides_win():
    assert compose(["seed=1", "seed=2"])["seed"] == 2


def test_the_hash_names_the_content():
    base = config_hash(compose())
    assert base == config_hash(compose(["seed=0"]))
    assert base != config_hash(compose(["seed=1"]))
    assert len(base) == 10 and int(base, 16) >= 0


def test_the_dataclasses_check_themselves():
    with pytest.raises(ConfigError, match="plan_reuse=0 is out of range"):
        Config(plan_reuse=0)
    with pytest.raises(ConfigError, match=r"queries.kind=there is not known"):
        QueriesConfig(kind="there")
    with pytest.raises(ConfigError, match=r"queries.neighbour=0 is out of range"):
        QueriesConfig(neighbour=0)


def test_works_inside_a_hydra_application():
    from hydra import initialize_config_dir
    from hydra.core.global_hydra import GlobalHydra

    from n2n.compose import conf_dir

    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        theirs = GlobalHydra.instance().hydra
        assert compose(["seed=5"])["seed"] == 5
        with pytest.raises(ConfigError):
            compose(["sead=5"])
        assert GlobalHydra.instance().hydra is theirs
