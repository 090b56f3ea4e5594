"""An optimising sweep as data: what may be varied, what was tried, what came of it. Needs Optuna."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from n2n.errors import ConfigError
from n2n.messages import explain

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution
    from optuna.trial import Trial

STUDY_FILE = "study.log"
_RESUMES = "resumes"  # mark of a trial that repeats one whose process was lost


class Study:
    """Trials and their scores, kept in a file: whoever opens it again goes on with it.

    Args:
        folder: Of the sweep.
        space: What is searched: key -> Optuna's distribution.
        direction: `minimize` or `maximize`.
        seed: Of the sampler.

    Raises:
        ConfigError: The file holds trials of another space.
    """

    def __init__(self, folder: Path, space: dict[str, "BaseDistribution"], direction: str, seed: int) -> None:
        import optuna
        from optuna.storages.journal import JournalFileBackend

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self._states = optuna.trial.TrialState
        self._study = optuna.create_study(
            storage=optuna.storages.JournalStorage(JournalFileBackend(str(folder / STUDY_FILE))),
            study_name="n2n",
            direction=direction,
            load_if_exists=True,
        )
        self._space, self._seed = space, seed
        self._check_space(folder)
        self._take_up_lost()

    @property
    def finished(self) -> int:
        """How many trials have come to an end, well or not."""
        trials = self._study.get_trials(deepcopy=False)
        ended = sum(trial.state.is_finished() for trial in trials)
        return ended - sum(_RESUMES in trial.user_attrs for trial in trials)

    @property
    def failed(self) -> int:
        """How many of them have no score."""
        return self.finished - len(self._study.get_trials(deepcopy=False, states=(self._states.COMPLETE,)))

    def ask(self, count: int) -> list["Trial"]:
        """Return what to try next; first what a lost process left unfinished."""
        return [self._ask() for _ in range(count)]

    def _ask(self) -> "Trial":
        from optuna.samplers import TPESampler

        # Seeded by how many there are: one seed for all would make a study that is resumed repeat its first guesses.
        # Trials that run together must not all be tried at the same place (constant_liar).
        count = len(self._study.get_trials(deepcopy=False))
        self._study.sampler = TPESampler(seed=self._seed + count, constant_liar=True)
        return self._study.ask(self._space)

    def tell(self, trial: "Trial", score: float | None) -> None:
        """Remember what came of a trial; None where nothing did."""
        if score is None:
            self._study.tell(trial, state=self._states.FAIL)
        else:
            self._study.tell(trial, score)

    def best(self) -> dict[str, Any] | None:
        """Return the best trial as plain data; None where none has a score."""
        if not self._study.get_trials(deepcopy=False, states=(self._states.COMPLETE,)):
            return None
        best = self._study.best_trial
        return {"score": best.value, "settings": [text.lstrip("+") for text in settings_of(best)], "trial": best.number}

    def _take_up_lost(self) -> None:
        for trial in self._study.get_trials(states=(self._states.RUNNING,)):
            self._study.enqueue_trial(trial.params, user_attrs={_RESUMES: trial.number})
            self._study.tell(trial.number, state=self._states.FAIL)

    def _check_space(self, folder: Path) -> None:
        from optuna.distributions import check_distribution_compatibility

        for trial in self._study.get_trials(deepcopy=False):
            try:
                if trial.distributions.keys() - self._space.keys():
                    raise ValueError("other keys")
                for key, distribution in trial.distributions.items():
                    check_distribution_compatibility(distribution, self._space[key])
            except ValueError as error:
                raise ConfigError(
                    f"{folder} searches other settings than these ({error}); give this sweep another name: sweep=NAME"
                ) from error


def settings_of(trial: Any) -> list[str]:
    """Return the settings a trial stands for, as `key=value`."""
    return [f"{key}={value}" for key, value in trial.params.items()]


def search_space(arguments: Sequence[str]) -> tuple[list[str], dict[str, "BaseDistribution"]]:
    """Tell fixed settings from those that are searched.

    `a,b` and `choice(a,b)` are choices, `range(1,10)` whole numbers, `interval(0,1)` any number between,
    `int(interval(1,9))` any whole one, `tag(log,interval(1e-4,1))` on a logarithmic scale.

    Raises:
        ConfigError: A setting cannot be read, or none is searched.
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser

    try:
        parsed = OverridesParser.create().parse_overrides(list(arguments))
        space = {one.get_key_element(): _distribution(one) for one in parsed if one.is_sweep_override()}
    except Exception as error:
        raise ConfigError(explain(error)) from error
    if not space:
        raise ConfigError("nothing is searched; give a setting several values, e.g. 'queries.scale=interval(0.5,2)'")
    return [text for text, one in zip(arguments, parsed, strict=True) if one.get_key_element() not in space], space


def _distribution(override: Any) -> "BaseDistribution":
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    values = override.value()
    if override.is_interval_sweep():
        log = "log" in values.tags
        if isinstance(values.start, int) and isinstance(values.end, int):
            return IntDistribution(values.start, values.end, log=log)
        return FloatDistribution(values.start, values.end, log=log)
    texts = list(override.sweep_string_iterator())
    if override.is_range_sweep() and not values.shuffle:
        if all(isinstance(number, int) for number in (values.start, values.stop, values.step)):
            return IntDistribution(int(texts[0]), int(texts[-1]), step=values.step)
        return FloatDistribution(float(texts[0]), float(texts[-1]), step=values.step)
    return CategoricalDistribution(texts)
