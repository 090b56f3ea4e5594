"""One YAML option by itself: a protocol is no part of a fit's configuration."""

from importlib.metadata import entry_points
from importlib.resources import files
from typing import Any

from n2n.compose import CONF_PLUGINS, conf_dir
from n2n.errors import ConfigError
from n2n.registry import suggest


def load_option(group: str, name: str) -> dict[str, Any]:
    """Read conf/GROUP/NAME.yaml, ours or a plugin's; Hydra takes no part, so a running Hydra application is left alone.

    Raises:
        ConfigError: No such option (with the nearest known one), or no readable YAML.
    """
    from omegaconf import OmegaConf

    found = find_options(group)
    if name not in found:
        raise ConfigError(f"Unknown {group} {name!r}.{suggest(name, list(found))}")
    try:
        return OmegaConf.to_container(OmegaConf.create(found[name].read_text(encoding="utf-8")), resolve=True)
    except Exception as error:
        reason = " ".join(str(error).split())[:160]
        raise ConfigError(f"{found[name]}: is not readable YAML ({reason})") from error


def find_options(group: str) -> dict[str, Any]:
    """Return option -> file; ours win over a plugin's of the same name."""
    folders = [files(point.value) / group for point in entry_points(group=CONF_PLUGINS)]
    found = {}
    for folder in [*folders, conf_dir() / group]:
        if folder.is_dir():
            found |= {file.name[:-5]: file for file in folder.iterdir() if file.name.endswith(".yaml")}
    return dict(sorted(found.items()))
