"""conf/experiment says what the paper says, and every one of them can be fitted once its data is there."""

from itertools import product
from pathlib import Path

import pytest
import yaml

from n2n.compose import compose, conf_dir
from n2n.errors import N2NError
from n2n.fitting.assemble import build_field, build_objective, build_optimizer
from n2n.registry import DATAMODULES
from n2n.tables import grid

NAMES = sorted(path.stem for path in (conf_dir() / "experiment").glob("*.yaml"))
PUBLISHED = yaml.safe_load((Path(grid.__file__).parent / "published.yaml").read_text())["tables"]
TASKS = ["denoise", "reconstruct", "upsample"]
# From the text of the paper: data, task, N, B, lambda, iterations. `None`: what the paper leaves to the data.
STATED = {
    "paper_pu_denoise": ("pu", "denoise", 200, 250, 0.0, 800_000),
    "paper_pc_denoise": ("pc", "denoise", 200, 250, 0.0, 800_000),
    "paper_large_noise": ("pu", "denoise", 200, 250, 0.0, 800_000),
    "paper_pu_upsample": ("pu", "upsample", 200, 250, 0.0, 800_000),
    "paper_shapenet": ("shapenet", "reconstruct", 200, 3000, 0.1, 800_000),
    "paper_abc": ("abc", "reconstruct", 1, 1000, 0.1, 800_000),
    "paper_famous": ("famous", "reconstruct", 1, 1000, 0.1, 800_000),
    "paper_dfaust": ("dfaust", "reconstruct", 1, 5000, 0.1, 800_000),
    "paper_srb": ("srb", "reconstruct", 1, 5000, 0.1, 800_000),
    "paper_scene3d": ("scene3d", "reconstruct", 1, 5000, 0.1, 800_000),
    "paper_paris": ("paris", "reconstruct", 1, 5000, 0.1, 800_000),
    "paper_kitti": ("kitti", "reconstruct", 1, 5000, 0.1, 800_000),
    "paper_complexity": ("pu", "denoise", 1, 250, 0.0, 50_000),
    "ablation_batch_size": ("pu", "denoise", 200, 250, 0.0, 800_000),
    "ablation_iterations": ("pu", "denoise", 200, 250, 0.0, 800_000),
    "ablation_observations": ("pu", "denoise", 200, 250, 0.0, 800_000),
    "ablation_distance": ("pu", "denoise", 200, 250, 0.0, 800_000),
    "ablation_lambda": ("pu", "denoise", 200, 250, 0.0, 800_000),
    "ablation_density": ("pu", "reconstruct", 1, 250, 0.1, 800_000),
    "ablation_mixing": ("pu", "reconstruct", 200, 250, 0.1, 800_000),
    "ablation_observations_tasks": ("pu", "reconstruct", 200, 250, 0.1, 800_000),
    "released_code": ("generated", "reconstruct", None, 5000, 0.1, 400_000),
}
# Axis of an experiment -> table of the paper, and what a column's text is worth.
TABLES = {
    ("ablation_batch_size", "batch_size"): ("T08_ablation_B", int),
    ("ablation_iterations", "iterations"): ("T09_ablation_iterations", lambda text: int(text) * 10_000),
    ("ablation_observations", "num_observations"): ("T10_ablation_N", int),
    ("ablation_observations_tasks", "num_observations"): ("T17_N_all_tasks", int),
    ("ablation_density", "datamodule.points"): ("T15_density", lambda text: int(text.removesuffix("K")) * 1000),
    ("paper_complexity", "datamodule.points"): (
        "T14_complexity", lambda text: int(text.partition("K")[0]) * 1000,
    ),
    ("paper_pu_upsample", "datamodule.points"): ("T02_upsampling", lambda text: int(text.partition("K")[0]) * 1000),
}  # fmt: skip


def axes(name):
    """Return the values an experiment sweeps: key -> texts."""
    spec = yaml.safe_load((conf_dir() / "experiment" / f"{name}.yaml").read_text())
    params = spec.get("hydra", {}).get("sweeper", {}).get("params", {})
    return {k: [str(i) for i in range(50)] if v == "range(50)" else str(v).split(",") for k, v in params.items()}


@pytest.mark.parametrize("name", NAMES)
def test_it_is_what_the_paper_says(name):
    config = compose([f"experiment={name}"])
    keys = ("task", "num_observations", "batch_size", "regulariser_weight", "iterations")
    assert (config["datamodule"]["name"], *(config[key] for key in keys)) == STATED[name]
    # The ablations of Sec. 4.5 and the appendix are on clouds with 3 % of noise.
    assert config["datamodule"].get("noise") == 0.03 or not name.startswith("ablation")


@pytest.mark.parametrize(("name", "key"), TABLES)
def test_an_axis_has_the_columns_of_its_table(name, key):
    table, worth = TABLES[name, key]
    columns = next(entry["columns"] for entry in PUBLISHED if entry["id"] == table)
    assert sorted(map(int, axes(name)[key])) == sorted({worth(column) for column in columns})


def test_the_axes_without_numbers_in_a_table():
    assert axes("ablation_lambda") == {"regulariser_weight": ["0", "0.05", "0.1", "0.2"]}
    assert axes("ablation_distance") == {"distance": ["cd", "emd"]}
    assert axes("ablation_mixing")["pairs"] == ["same", "random"]
    assert all(axes(name)["task"] == TASKS for name in NAMES if "task" in axes(name))
    assert axes("paper_large_noise") == {"datamodule.noise": ["0.02", "0.04", "0.06", "0.08", "0.1"]}
    assert len(axes("paper_paris")["datamodule.chunk"]) == compose(["experiment=paper_paris"])["datamodule"]["chunks"]


def test_a_task_brings_its_lambda_and_not_its_batch():
    for task, weight in zip(TASKS, (0.0, 0.1, 0.0), strict=True):
        config = compose(["experiment=ablation_density", f"task={task}"])
        assert (config["task"], config["regulariser_weight"], config["batch_size"]) == (task, weight, 250)


@pytest.mark.parametrize("name", NAMES)
def test_all_of_it_can_be_built(name, tmp_path, monkeypatch):
    swept = axes(name)
    jobs = list(product(*([f"{key}={value}" for value in values] for key, values in swept.items())))
    for job in (jobs[0], jobs[-1]):
        config = compose([f"experiment={name}", *job])
        sizes = {"layers": 2, "width": 8}
        small = {**config, "architecture": {**config["architecture"], **sizes}, "queries": {"kind": "observation"}}
        build_field(small, num_conditions=1)
        build_objective(small, [None])
        build_optimizer(small)
    monkeypatch.setenv("N2N_DATA", str(tmp_path))
    if config["datamodule"]["name"] != "generated":
        # Present or not, its arguments are understood: what is missing is the data, and what to do about it is said.
        with pytest.raises(N2NError, match="n2n data fetch"):
            DATAMODULES.build(config["datamodule"], num_observations=config["num_observations"])
