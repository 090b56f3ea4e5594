"""From conf/ and `key=value` overrides to one plain dict: the only module that talks to Hydra's composition."""

import hashlib
import json
import re
from dataclasses import asdict
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from n2n.config import Config
from n2n.errors import ConfigError
from n2n.registry import suggest

CONF_PLUGINS = "n2n.conf"


def conf_dir() -> Path:
    """Return the folder of YAML options: inside the wheel, or beside src/ in a checkout."""
    here = Path(__file__).parent
    for candidate in (here / "conf", here.parent.parent / "conf"):
        if (candidate / "config.yaml").exists():
            return candidate
    raise ConfigError(f"the configuration folder conf/ is missing beside {here}; reinstall n2n")


def plugin_search_paths() -> list[str]:
    """Return `pkg://...` search paths of third-party YAML options (entry point group `n2n.conf`)."""
    return [f"pkg://{point.value}" for point in entry_points(group=CONF_PLUGINS)]


def register_schema() -> None:
    """Make the typed schema known to Hydra as `n2n_schema`."""
    from hydra.core.config_store import ConfigStore

    ConfigStore.instance().store(name="n2n_schema", node=Config)


def compose(overrides: list[str]) -> dict[str, Any]:
    """Compose conf/config.yaml with overrides such as `recipe=paper` or `iterations=500`.

    Returns:
        Plain nested dict, types and ranges checked.

    Raises:
        ConfigError: Unknown key or option (with the nearest known one), wrong type or range.
    """
    from hydra import compose as hydra_compose
    from hydra import initialize_config_dir
    from hydra.core.global_hydra import GlobalHydra

    register_schema()
    GlobalHydra.instance().clear()
    search = ",".join(plugin_search_paths())
    extra = [f"hydra.searchpath=[{search}]"] if search else []
    try:
        with initialize_config_dir(str(conf_dir()), version_base="1.3", job_name="n2n"):
            composed = hydra_compose("config", overrides=[*overrides, *extra])
    except Exception as error:
        raise ConfigError(explain(error)) from error
    return validate(composed)


def validate(composed: Any) -> dict[str, Any]:
    """Check a composed DictConfig against the schema's types and ranges and return a plain dict."""
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    try:
        typed = OmegaConf.to_object(composed)
    except OmegaConfBaseException as error:
        raise ConfigError(explain(error)) from error
    return asdict(typed)


def explain(error: Exception) -> str:
    """Reduce a Hydra or OmegaConf error to one line that says what to change."""
    cause = error
    while cause.__cause__ is not None and not isinstance(cause, ConfigError):
        cause = cause.__cause__
    if isinstance(cause, ConfigError):
        return str(cause)
    text = " ".join(str(error).split())
    missing = re.search(r"Could not find '([\w/]+)/([^'/]+)'", text)
    if missing:
        group, option = missing.groups()
        known = sorted(path.stem for path in (conf_dir() / group).glob("*.yaml"))
        return f"Unknown {group} {option!r}.{suggest(option, known)}"
    key = re.search(r"(?:Could not override|Key) '([\w.]+)'", text)
    if key:
        name = key.group(1)
        known = _known_keys(name)
        return f"Unknown configuration key {name!r}.{suggest(name.rpartition('.')[2], known)}"
    return text


def _known_keys(name: str) -> list[str]:
    """Return the keys beside a dotted name in the default configuration."""
    node: Any = asdict(Config())
    for part in name.split(".")[:-1]:
        node = node.get(part, {}) if isinstance(node, dict) else {}
    return list(node) if isinstance(node, dict) else []


def config_hash(config: dict[str, Any]) -> str:
    """Return 10 hex digits that name a configuration by content."""
    return hashlib.sha256(json.dumps(config, sort_keys=True, default=str).encode()).hexdigest()[:10]
