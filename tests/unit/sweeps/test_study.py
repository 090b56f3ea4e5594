"""Optimising sweeps: the search space, a study that outlives its process, and Hydra's sweeper on top."""

import json
import random
from importlib import import_module
from pathlib import Path

import pytest

from n2n.errors import ConfigError
from n2n.sweeps.score import score

optuna = pytest.importorskip("optuna", reason="needs optuna: pip install 'n2n[optuna]'")

from n2n.sweeps.study import Study, search_space, settings_of  # noqa: E402

SPACE = ["x=interval(-2,2)", "shape=round,square"]


def loss(params):
    return (params["x"] - 0.5) ** 2 + (params["shape"] == "square")


def open_study(folder, arguments=SPACE, direction="minimize"):
    return Study(folder, search_space(arguments)[1], direction, seed=0)


def test_what_is_searched_and_what_is_fixed():
    fixed, space = search_space(
        [
            "datamodule.noise=0.02",
            "a=interval(0,0.5)",
            "b=tag(log,interval(0.001,1))",
            "c=int(interval(1,9))",
            "d=range(2,11,3)",
            "e=cd,emd",
            "++f.g=choice(1,2)",
        ]
    )
    assert fixed == ["datamodule.noise=0.02"]
    assert list(space) == ["a", "b", "c", "d", "e", "++f.g"]
    assert (space["a"].low, space["a"].high, space["a"].log) == (0, 0.5, False)
    assert (space["b"].low, space["b"].high, space["b"].log) == (0.001, 1, True)
    assert isinstance(space["c"], optuna.distributions.IntDistribution) and space["c"].high == 9
    # range(2,11,3) is 2, 5, 8: its end is not one of its values.
    assert (space["d"].low, space["d"].high, space["d"].step) == (2, 8, 3)
    assert space["e"].choices == ("cd", "emd") and space["++f.g"].choices == ("1", "2")


@pytest.mark.parametrize(("arguments", "message"), [(["seed=1"], "nothing is searched"), (["seed=[1"], "cannot read")])
def test_a_space_that_is_none_is_refused(arguments, message):
    with pytest.raises(ConfigError, match=message):
        search_space(arguments)


def test_it_finds_the_minimum_better_than_chance(tmp_path):
    scores = []
    for seed in range(3):
        folder = tmp_path / str(seed)
        folder.mkdir()
        study = Study(folder, search_space(SPACE)[1], "minimize", 1000 * seed)
        for _ in range(30):
            (trial,) = study.ask(1)
            study.tell(trial, loss(trial.params))
        scores.append(study.best()["score"])
        assert "shape=round" in study.best()["settings"]
    numbers = random.Random(0)
    chance = [
        min(loss({"x": numbers.uniform(-2, 2), "shape": numbers.choice(["round", "square"])}) for _ in range(30))
        for _ in range(200)
    ]
    # The worst of three searches against the median of blind ones.
    assert max(scores) < sorted(chance)[100]


def test_it_goes_on_after_its_process_was_lost(tmp_path):
    study = open_study(tmp_path)
    done, failed, *lost = study.ask(4)
    study.tell(done, 1.0)
    study.tell(failed, None)
    again = open_study(tmp_path)
    assert (again.finished, again.failed) == (2, 1)
    # What was running is what comes next, and only then something new.
    trials = again.ask(3)
    assert [settings_of(trial) for trial in trials[:2]] == [settings_of(trial) for trial in lost]
    assert settings_of(trials[2]) not in [settings_of(trial) for trial in (done, failed, *lost)]
    for trial in trials:
        again.tell(trial, 2.0)
    assert (again.finished, again.failed) == (5, 1)
    assert again.best() == {"score": 1.0, "settings": settings_of(done), "trial": 0}
    # Lost twice, it is still one trial.
    again.ask(1)
    third = open_study(tmp_path)
    third.ask(1)
    fourth = open_study(tmp_path)
    assert fourth.finished == 5
    fourth.tell(fourth.ask(1)[0], 3.0)
    assert fourth.finished == 6


def test_it_maximises_on_demand(tmp_path):
    study = open_study(tmp_path, direction="maximize")
    for value, trial in enumerate(study.ask(3)):
        study.tell(trial, float(value))
    assert study.best()["score"] == 2


@pytest.mark.parametrize("other", [["x=interval(-2,2)"], ["x=interval(-2,2)", "shape=round,oval"]])
def test_another_space_needs_another_sweep(other, tmp_path):
    study = open_study(tmp_path)
    study.tell(study.ask(1)[0], 1.0)
    with pytest.raises(ConfigError, match=r"searches other settings.*sweep=NAME"):
        open_study(tmp_path, other)
    open_study(tmp_path, ["x=interval(-1,1)", "shape=round,square"])


def test_a_score_is_a_number_of_a_run(tmp_path):
    assert score(tmp_path) is None
    measured = {"denoise/sbp": {"values": {"cd_sum2": 0.00025, "p2m": None}, "floors": {}}}
    (tmp_path / "evaluation.json").write_text(json.dumps({"validation": 0.004, "evaluations": measured}))
    assert score(tmp_path) == 0.004
    assert score(tmp_path, "denoise/sbp/cd_sum2") == 0.00025
    assert score(tmp_path, "denoise/sbp/p2m") is score(tmp_path, "denoise/sbp/hausdorff") is None
    (tmp_path / "evaluation.json").write_text('{"validation": NaN}')
    assert score(tmp_path) is None


class Launcher:
    """Stands for any launcher: what a job returns is in its settings; `stop` ends the process after so many jobs."""

    def __init__(self, stop=99):
        self.jobs, self.stop = [], stop

    def launch(self, job_overrides, initial_job_idx):
        from hydra.core.utils import JobReturn, JobStatus

        results = []
        for job in job_overrides:
            if len(self.jobs) == self.stop:
                raise KeyboardInterrupt
            self.jobs.append(job)
            settings = dict(text.split("=") for text in job)
            x = float(settings["x"])
            result = JobReturn(overrides=job, status=JobStatus.COMPLETED)
            result.return_value = None if x < -1 else (x - 0.5) ** 2
            results.append(result)
        return results


def sweep(folder, launcher, validation=0.0, n_trials=9):
    from omegaconf import OmegaConf

    from hydra_plugins.n2n_optuna import OptunaSweeper

    sweeper = OptunaSweeper(n_trials, 2, "validation", "minimize", 0, {"x": "interval(-2,2)"})
    sweeper.launcher, sweeper.hydra_context = launcher, None
    sweeper.config = OmegaConf.create({"validation": validation, "hydra": {"sweep": {"dir": str(folder)}}})
    sweeper.validate_batch_is_legal = lambda jobs: None
    sweeper.sweep(["seed=3"])
    return json.loads((folder / "best.json").read_text())


def test_the_sweeper_hands_rounds_to_the_launcher(tmp_path, capsys):
    launcher = Launcher()
    found = sweep(tmp_path, launcher)
    assert len(launcher.jobs) == found["trials"] == 9
    assert all("seed=3" in job and "validation=0.1" in job for job in launcher.jobs)
    scores = {
        text: (float(text.removeprefix("x=")) - 0.5) ** 2 for job in launcher.jobs for text in job if "x=" in text
    }
    failed = [text for text in scores if float(text.removeprefix("x=")) < -1]
    assert found["failed"] == len(failed)
    best = min((text for text in scores if text not in failed), key=scores.get)
    assert found["best"]["settings"] == [best] and found["best"]["score"] == pytest.approx(scores[best])
    assert best in capsys.readouterr().err


def test_the_sweeper_does_each_trial_once(tmp_path):
    first, second = Launcher(stop=5), Launcher()
    with pytest.raises(KeyboardInterrupt):
        sweep(tmp_path, first)
    found = sweep(tmp_path, second, n_trials=9)
    # The round that was cut off is repeated: its finished run is known by its folder, and costs nothing.
    assert found["trials"] == 9 and second.jobs[0] == first.jobs[4]
    assert len({tuple(job) for job in first.jobs + second.jobs}) == 9
    third = Launcher()
    assert sweep(tmp_path, third, n_trials=9) == found and third.jobs == []


def test_the_sweeper_leaves_a_share_that_was_chosen(tmp_path):
    launcher = Launcher()
    sweep(tmp_path, launcher, validation=0.2)
    assert not any("validation" in text for job in launcher.jobs for text in job)


def test_no_score_at_all_is_an_error(tmp_path, monkeypatch):
    launcher = Launcher()
    # By the module itself: Hydra loads its plugins in a way that leaves no attribute on their package.
    monkeypatch.setattr(import_module("hydra_plugins.n2n_optuna"), "_score", lambda result: None)
    with pytest.raises(ConfigError, match="none of the 9 runs"):
        sweep(tmp_path, launcher)
    assert Path(tmp_path / "best.json").exists()
