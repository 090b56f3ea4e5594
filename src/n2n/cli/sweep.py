"""Check every job of a `n2n fit` command line before the first one starts."""

from itertools import chain, islice

from n2n.compose import compose
from n2n.errors import ConfigError
from n2n.messages import explain

_VALUES_PER_KEY = 20
# Flags of Hydra that take a value, and those after which conf/ is not what n2n ships.
_WITH_VALUE = ("--cfg", "-c", "--package", "-p", "--info", "-i")
_OTHER_CONF = ("--config-dir", "-cd", "--config-path", "-cp", "--config-name", "-cn")


def check_jobs(arguments: list[str]) -> None:
    """Compose what the command line asks for; of a sweep, every value once.

    Raises:
        ConfigError: The first thing that is wrong, in one line. Hydra would say it in twenty, and after other jobs ran.
    """
    overrides = settings_of(arguments)
    if overrides is None:
        return
    for job in sweep_samples(overrides):
        compose(job)


def settings_of(arguments: list[str]) -> list[str] | None:
    """Return the `key=value` arguments among Hydra's flags; None where they cannot be checked from here."""
    settings, skip = [], False
    for argument in arguments:
        if argument.partition("=")[0] in _OTHER_CONF or argument.startswith(("hydra.searchpath=", "--hydra-help")):
            return None
        if argument.startswith("-"):
            # `--info` may stand alone, so its value is only skipped where it is none of ours.
            skip = argument in _WITH_VALUE
            continue
        if skip and "=" not in argument:
            skip = False
            continue
        settings.append(argument)
    return settings


def sweep_samples(overrides: list[str]) -> list[list[str]]:
    """Return jobs that show every value of every swept key at least once; one job where nothing is swept.

    >>> sweep_samples(["seed=0,1", "distance=emd,cd"])
    [['seed=0', 'distance=emd'], ['seed=1', 'distance=emd'], ['seed=0', 'distance=cd']]
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser

    try:
        parsed = OverridesParser.create().parse_overrides(overrides)
    except Exception as error:
        raise ConfigError(explain(error)) from error
    choices = []
    for text, override in zip(overrides, parsed, strict=True):
        if override.is_sweep_override() and override.is_discrete_sweep():
            key = text.partition("=")[0]
            values = [f"{key}={value}" for value in islice(override.sweep_string_iterator(), _VALUES_PER_KEY)]
            choices.append(values)
        elif override.is_sweep_override():
            choices.append([])  # a continuous range: only an optimiser's launcher knows its values
        else:
            choices.append([text])
    base = [values[:1] for values in choices]
    jobs = [list(chain(*base))]
    for index, values in enumerate(choices):
        jobs += [list(chain(*base[:index], [value], *base[index + 1 :])) for value in values[1:]]
    return jobs
