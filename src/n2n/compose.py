"""From conf/ and `key=value` overrides to one plain dict: the only module that talks to Hydra's composition."""

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from n2n.config import OPEN_KEYS, Config
from n2n.errors import ConfigError
from n2n.gates import check_components
from n2n.messages import explain, unknown_key
from n2n.registry import suggest

CONF_PLUGINS = "n2n.conf"
_CHOICE = re.compile(r"\+{0,2}([\w/]+)=([\w.-]*)")
_OPEN = re.compile(rf"(?:{'|'.join(OPEN_KEYS)})\.[\w.]+=")


def conf_dir() -> Path:
    """Return the folder of YAML options: inside the wheel, or beside src/ in a checkout."""
    here = Path(__file__).parent
    for candidate in (here / "conf", here.parent.parent / "conf"):
        if (candidate / "config.yaml").exists():
            return candidate
    raise ConfigError(f"the configuration folder conf/ is missing beside {here}; reinstall n2n")


def plugin_search_paths() -> list[str]:
    """Return `pkg://...` search paths of third-party YAML options (entry point group `n2n.conf`)."""
    return sorted(f"pkg://{point.value}" for point in entry_points(group=CONF_PLUGINS))


def register_schema() -> None:
    """Make the typed schema known to Hydra as `n2n_schema`."""
    from hydra.core.config_store import ConfigStore

    ConfigStore.instance().store(name="n2n_schema", node=Config)


def hydra_arguments(overrides: Sequence[str]) -> list[str]:
    """Return overrides as Hydra wants them: plugins' options found, component arguments open.

    Hydra would refuse `terms.on_surface.weight=1` because no YAML file mentions that key. Components know their own
    arguments, and `check_components` asks them; so such keys are passed as `++key=value` (add or change).
    """
    opened = [f"++{text}" if _OPEN.match(text) else text for text in overrides]
    search = plugin_search_paths()
    return [*opened, *([f"hydra.searchpath=[{','.join(search)}]"] if search else [])]


def sweep_dir(folder: Path) -> str:
    """Return the setting that tells Hydra the folder of a sweep, whatever is in its name.

    >>> print(sweep_dir(Path("it's")))
    hydra.sweep.dir='it\\'s'
    """
    return "hydra.sweep.dir='" + str(folder).replace("'", r"\'") + "'"


def compose(overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Compose conf/config.yaml with overrides such as `recipe=paper` or `iterations=500`.

    Returns:
        Plain nested dict; types, ranges and component arguments checked.

    Raises:
        ConfigError: Unknown key or option (with the nearest known one), wrong type or range.
    """
    from hydra import compose as hydra_compose
    from hydra import initialize_config_dir
    from hydra.core.global_hydra import GlobalHydra

    register_schema()
    with _own_hydra():
        try:
            with initialize_config_dir(str(conf_dir()), version_base="1.3", job_name="n2n"):
                check_choices(overrides, GlobalHydra.instance().config_loader())
                composed = hydra_compose("config", overrides=hydra_arguments(overrides))
        except Exception as error:
            raise ConfigError(explain(error)) from error
    return validate(composed)


def validate(composed: Any) -> dict[str, Any]:
    """Pass a composed DictConfig through the three gates and return a plain dict.

    Types are checked by the schema, ranges by `Config`, component arguments by the components' signatures.
    """
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    for key in composed:
        if key not in Config.__dataclass_fields__:
            raise ConfigError(unknown_key(key))
    try:
        typed = OmegaConf.to_object(composed)
    except OmegaConfBaseException as error:
        raise ConfigError(explain(error)) from error
    config = asdict(typed)
    check_components(config)
    return config


def check_choices(overrides: Iterable[str], loader: Any) -> None:
    """Refuse options that no folder of conf/ holds: of an optional group (debug=defualt) Hydra ignores them.

    Args:
        overrides: `key=value`, others than choices of a group among them.
        loader: Hydra's loader of configurations.

    Raises:
        ConfigError: An unknown option, with the nearest known one.
    """
    search = [f"hydra.searchpath=[{','.join(plugin_search_paths())}]"]
    for text in overrides:
        choice = _CHOICE.fullmatch(text)
        if choice is None:
            continue
        group, option = choice.groups()
        options = loader.get_group_options(group, overrides=search)
        if options and option not in options:
            raise ConfigError(f"Unknown {group} {option!r}.{suggest(option, options)}")


def config_hash(config: dict[str, Any]) -> str:
    """Return 10 hex digits that name a configuration by content."""
    return hashlib.sha256(json.dumps(config, sort_keys=True, default=str).encode()).hexdigest()[:10]


@contextmanager
def _own_hydra() -> Iterator[None]:
    """Give Hydra's global state back afterwards: the caller may be a Hydra application itself."""
    from hydra.core.global_hydra import GlobalHydra

    theirs = GlobalHydra.instance().hydra
    GlobalHydra.instance().clear()
    try:
        yield
    finally:
        GlobalHydra.instance().hydra = theirs
