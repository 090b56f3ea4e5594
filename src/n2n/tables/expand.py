"""From a table and a profile to the cells that are wanted, each with its fits."""

import itertools
import re
from collections.abc import Callable
from fnmatch import fnmatch
from typing import Any, NamedTuple

from n2n.errors import ConfigError
from n2n.registry import suggest
from n2n.tables.methods import check_method
from n2n.tables.spec import Fit, Profile, Table, Wanted

TASKS = ("denoise", "reconstruct", "upsample")
COSTS = ("minutes", "memory", "seconds")
_AXIS = re.compile(r"\{(\w+)\}")
_BETWEEN = re.compile(r"\s+(?=[\w.]+=)")  # two settings of one text; names of files may hold blanks

# Of a datamodule: names of the shapes present, and what is missing and where to get it.
Present = Callable[[str, str | None], tuple[list[str], str | None]]
# Of one place on the axes: axis -> (label, value).
Point = dict[str, tuple[str, Any]]


class _Fits(NamedTuple):
    """The fits of a cell, or the reason why there are none; see `Wanted` for the rest."""

    fits: list[Fit]
    reason: str = ""
    notes: tuple[str, ...] = ()
    whole: bool = True


def expand(table: Table, profile: Profile, present: Present) -> list[Wanted]:
    """Return every cell of ours in a table, in order.

    Args:
        table: What to measure.
        profile: With which effort.
        present: Tells the shapes of a datamodule that are at hand.

    Raises:
        ConfigError: The table asks for something that does not exist.
    """
    own = table.spec.get("profiles", {}).get(profile.name, {})
    cells = []
    for experiment in table.spec["experiments"]:
        if profile.name in experiment.get("only", [profile.name]):
            try:
                cells += _experiment(experiment, own, profile, present)
            except ConfigError as error:
                raise ConfigError(f"table {table.name}: {error}") from error
    return cells


def _experiment(spec: dict[str, Any], own: dict[str, Any], profile: Profile, present: Present) -> list[Wanted]:
    axes = {name: {str(k): v for k, v in values.items()} for name, values in spec.get("axes", {}).items()}
    for name in axes:
        axes[name].update({str(k): v for k, v in own.get("axes", {}).get(name, {}).items()})
    wanted = []
    for labels in itertools.product(*axes.values()):
        point: Point = {name: (label, axes[name][label]) for name, label in zip(axes, labels, strict=True)}
        method = _fill(spec.get("method", "n2n"), point, 1)
        check_method(method)
        for cell in spec["cells"]:
            evaluation = _fill(cell.get("evaluate", spec.get("evaluate", "")), point, 1)
            value = _fill(cell["value"], point, 1)
            skip = next((str(v["skip"]) for _, v in point.values() if isinstance(v, dict)), "")
            if not skip:
                _check(evaluation, value)
            # Settings may depend on what the field is for: `task={task}`.
            task = evaluation.split("/")[0] or "denoise"
            settled = {**point, "task": (task, task)}
            found = _Fits([], skip) if skip else _fits(spec, own, profile, present, method, settled)
            wanted.append(
                Wanted(
                    row=_fill(cell["row"], point, 0),
                    column=_fill(cell["column"], point, 0),
                    evaluation=evaluation,
                    value=value,
                    scale=float(cell.get("scale", 1)),
                    method=method,
                    by_class=cell.get("mean") == "class",
                    whole=found.whole,
                    fits=found.fits,
                    reason=found.reason,
                    notes=[*([spec["note"]] if "note" in spec else []), *found.notes],
                )
            )
    return wanted


def _check(evaluation: str, value: str) -> None:
    group, _, key = value.rpartition(".")
    if group == "cost":
        if key not in COSTS:
            raise ConfigError(f"Unknown cost {key!r}.{suggest(key, list(COSTS))}")
        return
    task, _, protocol = evaluation.partition("/")
    if not protocol:
        raise ConfigError(f"{value} is measured by a protocol; give it as evaluate: task/protocol, e.g. denoise/sbp")
    if task not in TASKS:
        raise ConfigError(f"Unknown task {task!r}.{suggest(task, list(TASKS))}")


def _fits(
    spec: dict[str, Any], own: dict[str, Any], profile: Profile, present: Present, method: str, point: Point
) -> _Fits:
    """Return the fits at one point of the axes, or why there are none, and what a reader must know about them."""
    stand_in = profile.datamodule
    datamodule = stand_in or spec["datamodule"]
    texts = [*profile.settings, *own.get("settings", []), *spec.get("settings", [])]

    def settings(shape: str) -> tuple[str, ...]:
        return _settings([_fill(text, {**point, "shape": (shape, shape)}, 1) for text in texts], profile)

    shapes, missing = spec.get("shapes", "*"), None
    if isinstance(shapes, list) and not stand_in:
        names = [_fill(name, point, 1) for name in shapes]
    else:
        variant = next((t.partition("=")[2] for t in settings("*") if t.startswith("datamodule.variant=")), None)
        names, missing = present(datamodule, variant)
        pattern = "*" if stand_in else _fill(shapes, point, 1)
        names = [name for name in names if fnmatch(name, pattern)]
        if not names:
            return _Fits([], missing or f"{datamodule}: no shape {pattern} is here")
    chosen = None if stand_in else own.get("shapes")
    if chosen:
        names = [name for name in names if name in chosen]
        if not names:
            return _Fits([], f"{datamodule}: none of the shapes {', '.join(chosen)} is here")
        missing = f"of {datamodule} only {', '.join(names)}: this profile's choice for ablations"
    names = names[: profile.shapes]
    notes = (missing,) if missing and not stand_in else ()
    whole = not (stand_in or missing or chosen or profile.shapes)
    return _Fits([Fit(method, datamodule, name, settings(name)) for name in names], "", notes, whole)


def _settings(settings: list[str], profile: Profile) -> tuple[str, ...]:
    """Return each key once, the last word counting, within the profile's limits."""
    texts = [text for group in settings for text in _BETWEEN.split(group.strip())]
    for text in texts:
        if "=" not in text:
            raise ConfigError(f"cannot read the setting {text!r}; write key=value")
    values = dict(text.split("=", 1) for text in texts)
    for key in list(values):
        if profile.datamodule and key.startswith("datamodule.") and key not in profile.keep:
            del values[key]
    for key, limit in profile.limits.items():
        if key in values and as_number(values[key], float("inf")) > limit:
            values[key] = f"{limit:g}"
    return tuple(f"{key}={value}" for key, value in sorted(values.items()))


def as_number(text: str, otherwise: int | float) -> int | float:
    """Return the number a setting is; `otherwise` for words such as `auto`."""
    try:
        return float(text)
    except ValueError:
        return otherwise


def _fill(text: str, point: Point, which: int) -> str:
    """Put labels (0) or values (1) of the axes in the place of `{axis}`."""

    def replaced(match: re.Match[str]) -> str:
        if match[1] not in point:
            raise ConfigError(f"Unknown axis {match[0]} in {text!r}.{suggest(match[1], list(point))}")
        return str(point[match[1]][which])

    return _AXIS.sub(replaced, text)
