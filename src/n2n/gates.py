"""The third gate before step 0: does every component of a configuration take the arguments it is given?"""

import inspect
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from n2n.errors import ConfigError
from n2n.registry import ARCHITECTURES, DATAMODULES, DISTANCES, PAIRINGS, REGULARISERS, suggest

# What the program itself passes besides the configuration's arguments.
_GIVEN = {
    "architecture": (ARCHITECTURES, ("num_conditions",)),
    "distance": (DISTANCES, ()),
    "pairing": (PAIRINGS, ("batch_size",)),
    "regulariser": (REGULARISERS, ()),
    "datamodule": (DATAMODULES, ("num_observations",)),
}
# Positional arguments that optimiser and scheduler get from the fit; loggers get their folder by keyword.
_POSITIONAL = {"optimizer": 1, "scheduler": 2, "logger": 0}


def check_components(config: Mapping[str, Any]) -> None:
    """Bind every component's arguments to its signature; nothing is constructed.

    Raises:
        ConfigError: Unknown component, unknown argument (with the nearest known one) or missing argument.
    """
    for key, (registry, given) in _GIVEN.items():
        registry.check(config[key], *given)
    for name, spec in config["terms"].items():
        if spec is not None:
            arguments = {key: value for key, value in spec.items() if key != "weight"}
            REGULARISERS.check({"name": name, **arguments})
    _check_weight(config["regulariser"].get("name"), config["regulariser_weight"])
    for key, positional in _POSITIONAL.items():
        if config[key]:
            _check_target(key, config[key], positional)


def _check_weight(name: Any, weight: float | None) -> None:
    """A regulariser without a weight would do nothing; one of weight 0 is meant to."""
    if name != "none" and weight is None:
        raise ConfigError(f"regulariser={name} needs its lambda; give it as regulariser_weight=0.1")


def _check_target(key: str, spec: Mapping[str, Any], positional: int) -> None:
    """Check a component that is given by its import path under `_target_`."""
    path = spec.get("_target_")
    if not isinstance(path, str):
        raise ConfigError(f"{key} needs _target_, the import path of a class; see conf/{key}/")
    module, _, name = path.rpartition(".")
    try:
        target = getattr(import_module(module), name)
        parameters = list(inspect.signature(target).parameters.values())
    except (ImportError, AttributeError, ValueError, TypeError) as error:
        raise ConfigError(f"{key}._target_={path} cannot be imported ({error}); give the path of a class") from error
    if any(p.kind is p.VAR_KEYWORD for p in parameters):
        return
    known = [p.name for p in parameters[positional:]]
    for argument in spec:
        if not argument.startswith("_") and argument not in known:
            raise ConfigError(f"{key} {path} has no argument {argument!r}.{suggest(argument, known)}")
