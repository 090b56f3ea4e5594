"""The methods a table may name: ours, and the baselines."""

import functools

from n2n.errors import ConfigError
from n2n.registry import BASELINES, suggest

OURS = "n2n"


def check_method(name: str) -> None:
    """Raise ConfigError unless there is a method of this name."""
    if name != OURS and name not in BASELINES.names():
        raise ConfigError(f"Unknown method {name!r}.{suggest(name, [OURS, *BASELINES.names()])}")


@functools.cache
def not_installed(name: str) -> str:
    """Say which package a method lacks here, and how to install it; empty where it can run."""
    if name == OURS:
        return ""
    try:
        BASELINES.build(name)
    except ConfigError as error:
        return str(error)
    return ""
