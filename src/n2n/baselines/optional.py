"""Packages that only some people want: imported when a baseline is made, with the line that installs them."""

from importlib import import_module
from types import ModuleType

from n2n.errors import ConfigError


def optional(module: str, extra: str, who: str) -> ModuleType:
    """Import a module of an extra.

    Args:
        module: What to import, e.g. `pymeshlab`.
        extra: The extra of n2n that installs it.
        who: What needs it, for the message.

    Raises:
        ConfigError: It is not installed, or cannot be loaded on this machine.
    """
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        why = "" if isinstance(error, ModuleNotFoundError) and error.name == package else f" ({error})"
        raise ConfigError(f"{who} needs the package {package}{why}; pip install 'n2n[{extra}]'") from error
