"""From a swept command line to its runs: the only module of a sweep that composes."""

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from hydra import version
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra._internal.hydra import Hydra
from hydra._internal.utils import create_config_search_path, get_args_parser
from hydra.core.config_search_path import SearchPathQuery
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.types import RunMode
from omegaconf import OmegaConf, open_dict, read_write

from n2n.compose import check_choices, conf_dir, config_hash, hydra_arguments, register_schema, sweep_dir, validate
from n2n.errors import ConfigError
from n2n.messages import explain

_BASIC = "hydra._internal.core_plugins.basic_sweeper.BasicSweeper"
# What a run is does not depend on where it is computed and on who is told.
_ASIDE = ("logger", "device")


@dataclass(frozen=True)
class Job:
    """One run of a sweep.

    Attributes:
        hash: Names it by content.
        overrides: All settings, as Hydra wants them.
        settings: Those that are varied.
        config: Composed and checked.
    """

    hash: str
    overrides: list[str]
    settings: list[str]
    config: dict[str, Any]


@dataclass(frozen=True)
class Grid:
    """A composed sweep.

    Attributes:
        loader: Hydra's.
        master: The configuration with its `hydra` part, before anything is varied.
        axes: Key -> values, as text.
        arguments: Settings for an optimising sweeper.
        jobs: Every run, each once; None where an optimiser decides as it goes.
    """

    loader: Any
    master: Any
    axes: dict[str, list[str]]
    arguments: list[str]
    jobs: list[Job] | None


def make_grid(settings: Sequence[str], flags: Sequence[str], folder: Path) -> Grid:
    """Compose all runs of a command line.

    Args:
        settings: `key=value`, some with several values.
        flags: Hydra's own, e.g. --config-dir.
        folder: Of the sweep.

    Raises:
        ConfigError: The first thing that is wrong.
    """
    register_schema()
    version.setbase("1.3")
    options = get_args_parser().parse_args(list(flags))
    GlobalHydra.instance().clear()
    try:
        hydra = Hydra.create_main_hydra2(task_name="n2n", config_search_path=_search_path(options))
        overrides = [*hydra_arguments(settings), sweep_dir(folder)]
        config_name = options.config_name or "config"
        master = hydra.compose_config(config_name, overrides, RunMode.MULTIRUN, with_log_configuration=False)
        arguments = [*map(str, OmegaConf.to_container(master.hydra.overrides.task))]
        params = [f"{key}={value}" for key, value in (master.hydra.sweeper.get("params") or {}).items()]
        given = OverridesParser.create(config_loader=hydra.config_loader).parse_overrides([*params, *arguments])
        axes = {
            one.get_key_element().lstrip("+"): [*one.sweep_string_iterator()]
            if one.is_discrete_sweep()
            else [one.get_value_string()]
            for one in given
            if one.is_sweep_override()
        }
        jobs = None
        if master.hydra.sweeper._target_ == _BASIC:
            expanded = BasicSweeper.split_arguments(given, None)[0]
            if not any(text.startswith("hydra.searchpath=") for text in settings):
                check_choices(dict.fromkeys(chain(*expanded)), hydra.config_loader)
            jobs = _unique([_job(hydra.config_loader, master, one, axes) for one in expanded])
    except ConfigError:
        raise
    except Exception as error:
        raise ConfigError(explain(error)) from error
    finally:
        GlobalHydra.instance().clear()
    return Grid(hydra.config_loader, master, axes, arguments, jobs)


def run_hash(config: dict[str, Any]) -> str:
    """Return the name of a run of a sweep."""
    return config_hash({key: value for key, value in config.items() if key not in _ASIDE})


def varied(overrides: Sequence[str], axes: Sequence[str]) -> list[str]:
    """Return those settings whose key is varied, without Hydra's `+`.

    >>> varied(["seed=1", "distance=cd", "++terms.far_field.weight=2"], ["seed", "terms.far_field.weight"])
    ['seed=1', 'terms.far_field.weight=2']
    """
    return [text.lstrip("+") for text in overrides if text.lstrip("+").partition("=")[0] in axes]


def _job(loader: Any, master: Any, overrides: list[str], axes: dict[str, list[str]]) -> Job:
    composed = loader.load_sweep_config(master, overrides)
    with read_write(composed), open_dict(composed):
        del composed["hydra"]
    config = validate(composed)
    return Job(run_hash(config), overrides, varied(overrides, [*axes]), config)


def _unique(jobs: list[Job]) -> list[Job]:
    return [*{job.hash: job for job in reversed(jobs)}.values()][::-1]


def _search_path(options: Namespace) -> Any:
    conf = Path(options.config_path).absolute() if options.config_path else conf_dir()
    path = create_config_search_path(str(conf))
    if options.config_dir is not None:
        folder = Path(options.config_dir).absolute()
        if not folder.is_dir():
            raise ConfigError(f"--config-dir {options.config_dir}: there is no such folder")
        path.prepend(provider="command-line", path=f"file://{folder}", anchor=SearchPathQuery(provider="schema"))
    return path
