"""Every YAML option composes with every recipe, and its component takes the arguments it is given."""

import pytest

from n2n import registry
from n2n.compose import compose, conf_dir
from n2n.errors import ConfigError

NOT_OF_A_FIT = {"setting", "table", "profile", "protocol"}
GROUPS = sorted(folder.name for folder in conf_dir().iterdir() if folder.is_dir() and folder.name not in NOT_OF_A_FIT)
OPTIONS = [(group, option.stem) for group in GROUPS for option in sorted((conf_dir() / group).glob("*.yaml"))]
NEEDS = {("datamodule", "files"): ["datamodule.paths=[a.ply,b.ply]"]}


def test_the_default_is_the_fast_recipe():
    assert compose() == compose(["recipe=fast"])


@pytest.mark.parametrize("base", ["recipe=fast", "recipe=paper", "experiment=released_code"])
@pytest.mark.parametrize(("group", "option"), OPTIONS)
def test_any_option_goes_with_any_recipe(base, group, option):
    weight = ["regulariser_weight=0.1"] if group == "regulariser" else []
    config = compose([base, f"{group}={option}", *weight, *NEEDS.get((group, option), [])])
    assert config["iterations"] == "auto" or config["iterations"] >= 1


@pytest.mark.parametrize(
    ("kind", "group"),
    [
        (registry.ARCHITECTURES, "architecture"),
        (registry.DISTANCES, "distance"),
        (registry.PAIRINGS, "pairing"),
        (registry.DATAMODULES, "datamodule"),
    ],
)
def test_every_registered_name_has_an_option_of_its_name(kind, group):
    options = {path.stem for path in (conf_dir() / group).glob("*.yaml")}
    assert set(kind.names()) <= options
    for name in kind.names():
        assert compose([f"{group}={name}", *NEEDS.get((group, name), [])])[group]["name"] == name


def test_every_regulariser_can_be_lambda_r_and_a_term():
    for name in registry.REGULARISERS.names():
        config = compose(
            [f"regulariser.name={name}", "regulariser_weight=0", f"terms.{name}=null", f"terms.{name}={{weight:0.5}}"]
        )
        assert config["terms"][name] == {"weight": 0.5}


def test_a_regulariser_is_not_dropped_for_want_of_a_weight():
    with pytest.raises(ConfigError, match=r"regulariser=eikonal needs its lambda; give it as regulariser_weight=0.1"):
        compose(["regulariser=eikonal"])


@pytest.mark.parametrize(
    ("task", "weight", "batch"), [("reconstruct", 0.1, 5000), ("denoise", 0.0, 250), ("upsample", 0.0, 250)]
)
def test_the_paper_recipe_is_the_paper(task, weight, batch):
    config = compose(["recipe=paper", f"task={task}"])
    assert config["architecture"] | {"layers": 8, "width": 512, "output": "tanh"} == config["architecture"]
    assert config["distance"] == {"name": "emd", "p": 1}
    assert config["pairing"] == {"name": "global"}
    assert config["regulariser"] == {"name": "consistency", "against": "batch"}
    assert (config["regulariser_weight"], config["batch_size"]) == (weight, batch)
    assert config["optimizer"]["_target_"] == "torch.optim.Adam" and config["optimizer"]["lr"] == 1e-4
    assert config["iterations"] == 800_000
    assert config["plan_reuse"] == 1 and config["terms"] == {} and config["num_observations"] is None
    assert config["queries"] == {"kind": "auto", "neighbour": 50, "scale": 1.0, "pulls": 0}
    assert config["target_noise"] == 0 and config["average_from"] == 1 and config["redistance"] is False


def test_the_released_script_differs_where_it_does():
    config = compose(["experiment=released_code"])
    assert config["architecture"]["output"] == "linear"
    assert config["distance"]["name"] == "approx"
    assert config["regulariser"]["name"] == "consistency_target"
    assert (config["iterations"], config["batch_size"], config["regulariser_weight"]) == (400_000, 5000, 0.1)
