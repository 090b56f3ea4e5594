"""What a table and a profile may say: anything else is a typing error, and told before anything is measured."""

from typing import Any

from n2n.errors import ConfigError
from n2n.registry import suggest

_TABLE = {
    "title": str, "published": str, "competitors": str, "unfair": list, "experiments": list,
    "footnotes": list, "derived": list, "profiles": dict,
}  # fmt: skip
_EXPERIMENT = {
    "datamodule": str, "method": str, "shapes": (str, list), "axes": dict, "settings": list, "evaluate": str,
    "cells": list, "only": list, "note": str,
}  # fmt: skip
_CELL = {
    "row": str, "column": str, "value": str, "scale": (int, float), "evaluate": str, "mean": str,
}  # fmt: skip
_FOOTNOTE = {"rows": list, "columns": list, "text": str}
_DERIVED = {"from": str, "row": str, "factor": dict, "note": str}
_IN_PROFILE = {"shapes": list, "settings": list, "axes": dict}
_PROFILE = {
    "title": str, "settings": list, "datamodule": str, "keep": list, "shapes": int, "limits": dict, "samples": int,
}  # fmt: skip
_CHOICES = {"competitors": ("none", "rows", "columns"), "mean": ("class",)}


def check_table(where: str, spec: dict[str, Any]) -> None:
    """Raise ConfigError, one line with the place, unless a table is well formed.

    Args:
        where: Its file.
        spec: Its content.
    """
    _check(where, spec, _TABLE, needed=("title", "experiments"))
    axes: set[str] = set()
    for index, experiment in enumerate(spec["experiments"], 1):
        here = f"{where}: experiment {index}"
        _check(here, experiment, _EXPERIMENT, needed=("datamodule", "cells"))
        axes |= set(experiment.get("axes", {}))
        _check_axes(here, experiment.get("axes", {}))
        if experiment["datamodule"] == "files" and not isinstance(experiment.get("shapes"), list):
            raise ConfigError(
                f"{here}: files do not say which shapes they are; name them, shapes: [cup, vase], and their files by "
                "the settings, datamodule.paths=[scans/{shape}.ply] datamodule.reference=[true/{shape}.off]"
            )
        for cell in experiment["cells"]:
            _check(f"{here}: a cell", cell, _CELL, needed=("row", "column", "value"))
    for name, own in spec.get("profiles", {}).items():
        _check(f"{where}: profile {name}", own, _IN_PROFILE)
        _check_axes(f"{where}: profile {name}", own.get("axes", {}))
        for axis in own.get("axes", {}):
            if axis not in axes:
                raise ConfigError(f"{where}: profile {name}: Unknown axis {axis!r}.{suggest(axis, sorted(axes))}")
    for footnote in spec.get("footnotes", []):
        _check(f"{where}: a footnote", footnote, _FOOTNOTE, needed=("text",))
    for rule in spec.get("derived", []):
        _check(f"{where}: a derived row", rule, _DERIVED, needed=tuple(_DERIVED))


def check_profile(where: str, spec: dict[str, Any]) -> None:
    """Raise ConfigError, one line with the place, unless a profile is well formed."""
    _check(where, spec, _PROFILE, needed=("title",))


def _check_axes(where: str, axes: dict[str, Any]) -> None:
    for name, values in axes.items():
        if not isinstance(values, dict):
            raise ConfigError(f"{where}: the axis {name!r} needs label: value, e.g. {{1%: 0.01}}")
        for label, value in values.items():
            if isinstance(value, dict | list) and list(value) != ["skip"]:
                raise ConfigError(f"{where}: {name}: {label} needs one value, or {{skip: the reason}}")


def _check(where: str, spec: Any, known: dict[str, Any], needed: tuple[str, ...] = ()) -> None:
    if not isinstance(spec, dict):
        raise ConfigError(f"{where} is {spec!r}; it needs key: value. Known: {', '.join(sorted(known))}.")
    for key, value in spec.items():
        if key not in known:
            raise ConfigError(f"{where}: Unknown key {key!r}.{suggest(str(key), sorted(known))}")
        if not isinstance(value, known[key]):
            raise ConfigError(f"{where}: {key} is {value!r}; {_NEEDED.get(known[key], 'it needs a number')}")
        if value not in _CHOICES.get(key, (value,)):
            raise ConfigError(f"{where}: {key} is {value!r}; choose one of: {', '.join(_CHOICES[key])}")
    for key in needed:
        if key not in spec:
            raise ConfigError(f"{where}: {key} is missing")


_NEEDED = {
    str: "it needs text; put it in quotes",
    list: "it needs a list, [a, b]",
    dict: "it needs key: value",
    (str, list): "it needs a pattern of names, or a list of names",
}
