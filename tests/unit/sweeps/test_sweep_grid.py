"""From a command line to runs: every combination once, named by what decides the result."""

from pathlib import Path

import pytest

from n2n.compose import compose
from n2n.errors import ConfigError
from n2n.sweeps.command import check_jobs, is_sweep, take_name
from n2n.sweeps.grid import make_grid, run_hash, varied


def grid(*settings, flags=("-m",)):
    return make_grid(list(settings), list(flags), Path("sweeps/x"))


def test_every_combination_once(tmp_path):
    made = grid("seed=0,1", "distance=emd,cd", "iterations=5", "seed=2,3")
    assert made.axes == {"seed": ["2", "3"], "distance": ["emd", "cd"]}
    assert [job.settings for job in made.jobs] == [
        ["seed=2", "distance=emd"],
        ["seed=2", "distance=cd"],
        ["seed=3", "distance=emd"],
        ["seed=3", "distance=cd"],
    ]
    assert len({job.hash for job in made.jobs}) == 4
    for job in made.jobs:
        assert job.config == compose([*job.settings, "iterations=5"])


def test_logger_and_device_make_no_other_run():
    names = [[job.hash for job in grid("seed=0,1", *more).jobs] for more in ([], ["logger=none", "device=cpu"])]
    assert names[0] == names[1]
    assert len(grid("seed=0,1", "device=cpu,auto").jobs) == 2
    assert run_hash(compose(["seed=1"])) == names[0][1] != run_hash(compose(["seed=1", "iterations=7"]))


def test_components_arguments_are_varied_too():
    made = grid("terms.zero_level.weight=0.1,0.2")
    assert [job.settings for job in made.jobs] == [["terms.zero_level.weight=0.1"], ["terms.zero_level.weight=0.2"]]
    assert varied(made.jobs[0].overrides, list(made.axes)) == made.jobs[0].settings


def test_what_an_experiment_varies_is_an_axis(tmp_path):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "mine.yaml").write_text(
        "# @package _global_\niterations: 9\nhydra: {sweeper: {params: {batch_size: '100,250'}}}\n"
    )
    made = grid("experiment=mine", flags=["-m", "--config-dir", str(tmp_path)])
    assert made.axes == {"batch_size": ["100", "250"]}
    assert [(job.config["batch_size"], job.config["iterations"]) for job in made.jobs] == [(100, 9), (250, 9)]


@pytest.mark.parametrize(
    "settings", [["seed=0,-1"], ["distance=emd,cd", "distance.foo=7"], ["seed=0,1", "iterations=0"]]
)
def test_what_is_wrong_with_one_run_is_said_of_the_command(settings):
    with pytest.raises(ConfigError) as error:
        grid(*settings)
    assert "\n" not in str(error.value)


def test_unknown_options_are_named_before_the_first_run():
    with pytest.raises(ConfigError, match="Did you mean 'emd'"):
        grid("distance=cd,emdd")
    with pytest.raises(ConfigError, match="Did you mean 'default'"):
        grid("seed=0,1", "debug=defualt")
    with pytest.raises(ConfigError, match="Did you mean 'emd'"):
        check_jobs(["distance=choice(cd,emdd)"], ["-m"])
    with pytest.raises(ConfigError, match="no such folder"):
        grid("seed=0,1", flags=["-m", "--config-dir", "/nowhere"])


def test_name_of_a_sweep():
    assert take_name(["seed=0,1", "sweep=a", "sweep=b-1.2"]) == ("b-1.2", ["seed=0,1"])
    assert take_name(["seed=0,1"]) == (None, ["seed=0,1"])
    for name in ("", "a/b", "..", "a b"):
        with pytest.raises(ConfigError, match="not a name"):
            take_name([f"sweep={name}"])


def test_what_is_a_sweep():
    assert is_sweep([], ["-m"]) and is_sweep([], ["--multirun"]) and is_sweep(["hydra.mode=MULTIRUN"], [])
    assert not is_sweep(["seed=0,1"], ["--cfg", "job"])
