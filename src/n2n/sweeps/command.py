"""The command line of `n2n fit`: told apart, and every job of it checked before the first one starts."""

import re
from itertools import chain, islice, pairwise
from typing import NoReturn

from n2n.compose import compose
from n2n.errors import ConfigError
from n2n.messages import explain
from n2n.registry import suggest

_VALUES_PER_KEY = 20
_NAME = re.compile(r"[\w][\w.-]*")
_SWEEP, _MULTIRUN = "sweep=", "hydra.mode=MULTIRUN"
# Flags of Hydra that take a value, and those after which conf/ is not what n2n ships.
_WITH_VALUE = ("--cfg", "-c", "--package", "-p", "--info", "-i")
_OTHER_CONF = ("--config-dir", "-cd", "--config-path", "-cp", "--config-name", "-cn")


def check_jobs(settings: list[str], flags: list[str]) -> None:
    """Compose what the command line asks for; of a sweep whose runs nobody knows yet, every value once.

    Raises:
        ConfigError: The first thing that is wrong, in one line. Hydra would say it in twenty, and after other jobs ran.
    """
    if any(flag.partition("=")[0] in _OTHER_CONF for flag in flags) or "--hydra-help" in flags:
        return
    if any(setting.startswith("hydra.searchpath=") for setting in settings):
        return
    for job in sweep_samples(settings) if is_sweep(settings, flags) else [settings]:
        compose(job)


def is_sweep(settings: list[str], flags: list[str]) -> bool:
    """Return whether a command line asks for several runs."""
    return bool({"-m", "--multirun"} & set(flags)) or _MULTIRUN in settings


def take_name(settings: list[str]) -> tuple[str | None, list[str]]:
    """Take the sweep's name out of the settings: it says where runs are kept, and nothing about them.

    >>> take_name(["seed=0,1", "sweep=seeds"])
    ('seeds', ['seed=0,1'])

    Raises:
        ConfigError: It cannot be the name of a folder.
    """
    names = [text.removeprefix(_SWEEP) for text in settings if text.startswith(_SWEEP)]
    if names and not _NAME.fullmatch(names[-1]):
        raise ConfigError(f"sweep={names[-1]} is not a name; use letters, digits, dots, - and _, e.g. sweep=seeds")
    return (names[-1] if names else None), [text for text in settings if not text.startswith(_SWEEP)]


def is_about_launcher(setting: str) -> bool:
    """Return whether a setting says how runs are started, not what they are.

    >>> is_about_launcher("hydra/launcher=basic"), is_about_launcher("hydra.launcher.n_jobs=4")
    (True, True)
    >>> is_about_launcher("seed=1")
    False
    """
    return setting.lstrip("+").startswith(("hydra/launcher=", "hydra.launcher."))


def check_flags(flags: list[str]) -> None:
    """Refuse what Hydra would refuse, in one line.

    Raises:
        ConfigError: Unknown flag, or a flag without its value.
    """
    from hydra._internal.utils import get_args_parser

    hydra = get_args_parser()
    known = [flag for action in hydra._actions for flag in action.option_strings]

    def refuse(message: str) -> NoReturn:
        unknown = message.removeprefix("unrecognized arguments: ")
        hint = suggest(unknown, known) if unknown != message else ""
        raise ConfigError(f"n2n fit: {message}.{hint} See `n2n fit --help`; settings are key=value")

    hydra.error = refuse
    hydra.parse_args([flag for flag in flags if flag != "--version"])


def split_arguments(arguments: list[str]) -> tuple[list[str], list[str]]:
    """Tell settings from Hydra's flags and their values, so that they may be mixed; Hydra alone refuses that.

    >>> split_arguments(["seed=1", "--cfg", "job", "distance=cd", "-m"])
    (['seed=1', 'distance=cd'], ['--cfg', 'job', '-m'])
    """
    settings: list[str] = []
    flags: list[str] = []
    for before, argument in pairwise(["", *arguments]):
        is_value = before in (*_WITH_VALUE, *_OTHER_CONF) and "=" not in argument
        (flags if argument.startswith("-") or is_value else settings).append(argument)
    return settings, flags


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
