"""`hydra/sweeper=optuna`: Hydra looks for sweepers in this package."""

import json
import math
import sys
from pathlib import Path
from typing import Any

from hydra.core.plugins import Plugins
from hydra.plugins.sweeper import Sweeper
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig


class OptunaSweeper(Sweeper):
    """Try settings in rounds; Optuna chooses each round by the scores of those before.

    The sweep goes on where it stopped when the same command is given again: scores are kept in the sweep's folder, and
    runs that were lost are taken up first.

    Args:
        n_trials: How many runs in all.
        n_jobs: Runs in a round, handed to the launcher together.
        score: What a run returns; see `n2n.sweeps.score`.
        direction: `minimize` or `maximize`.
        seed: Of the sampler.
        params: What is searched, beside the command line.
    """

    def __init__(self, n_trials: int, n_jobs: int, score: str, direction: str, seed: int, params: Any) -> None:
        self.n_trials, self.n_jobs, self.score, self.direction, self.seed = n_trials, n_jobs, score, direction, seed
        self.params = dict(params or {})

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        self.config, self.hydra_context = config, hydra_context
        self.launcher = Plugins.instance().instantiate_launcher(
            hydra_context=hydra_context, task_function=task_function, config=config
        )

    def sweep(self, arguments: list[str]) -> None:
        """Run the trials that are left; writes best.json."""
        from n2n.errors import ConfigError
        from n2n.formats.atomic import atomic_path
        from n2n.sweeps.claims import claim
        from n2n.sweeps.score import VALIDATION
        from n2n.sweeps.study import STUDY_FILE, Study, search_space, settings_of

        fixed, space = search_space([*(f"{key}={value}" for key, value in self.params.items()), *arguments])
        if self.score == VALIDATION and not self.config.get("validation"):
            fixed.append("validation=0.1")
            _say("optuna: a tenth of the points is held out to score the fits (validation=0.1)")
        folder = Path(self.config.hydra.sweep.dir)
        folder.mkdir(parents=True, exist_ok=True)
        with claim(folder / f"{STUDY_FILE}.claim") as is_ours:
            if not is_ours:
                raise ConfigError(f"{folder} is being optimised by another process; wait, or give another sweep=NAME")
            study = Study(folder, space, self.direction, self.seed)
            while (left := self.n_trials - study.finished) > 0:
                trials = study.ask(min(left, self.n_jobs))
                jobs = [[*fixed, *settings_of(trial)] for trial in trials]
                self.validate_batch_is_legal(jobs)
                results = self.launcher.launch(jobs, initial_job_idx=trials[0].number)
                for trial, result in zip(trials, results, strict=True):
                    study.tell(trial, _score(result))
        best = study.best()
        with atomic_path(folder / "best.json") as temporary:
            summary = {"score": self.score, "trials": study.finished, "failed": study.failed, "best": best}
            temporary.write_text(json.dumps(summary, indent=1) + "\n")
        if best is None:
            raise ConfigError(f"none of the {study.finished} runs in {folder} has a score {self.score!r}")
        _say(
            f"optuna: best of {study.finished} ({study.failed} without a score): {' '.join(best['settings'])}, "
            f"{self.score} {best['score']:.6g} -> {folder / 'best.json'}"
        )


def _score(result: Any) -> float | None:
    from hydra.core.utils import JobStatus

    value = result.return_value if result.status is JobStatus.COMPLETED else None
    return value if isinstance(value, float) and math.isfinite(value) else None


def _say(text: str) -> None:
    print(text, file=sys.stderr)
