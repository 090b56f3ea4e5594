"""A table as data: which fits, on which shapes, measured how, become which cells (conf/table, conf/profile)."""

import hashlib
import itertools
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import yaml

from n2n.compose import conf_dir
from n2n.errors import ConfigError
from n2n.registry import suggest

# What an experiment, a cell and a profile may say: anything else is a typing error.
_TABLE = {
    "title", "published", "competitors", "higher", "unfair", "experiments", "footnotes", "derived", "profiles",
}  # fmt: skip
_EXPERIMENT = {"datamodule", "method", "shapes", "axes", "settings", "evaluate", "cells", "only", "note"}
_PROFILE = {"title", "settings", "datamodule", "keep", "shapes", "limits", "samples"}
_CELL = {"row", "column", "value", "scale", "evaluate", "mean"}


@dataclass(frozen=True)
class Fit:
    """One fit, or one run of a baseline, on one shape; what it is made of is its name.

    Attributes:
        method: `n2n`, or a registered baseline.
        datamodule: Registered name.
        shape: The datamodule's name of the shape.
        settings: `key=value`, each key once, sorted.
    """

    method: str
    datamodule: str
    shape: str
    settings: tuple[str, ...]

    @property
    def id(self) -> str:
        """12 hex digits."""
        content = json.dumps([self.method, self.datamodule, self.shape, self.settings])
        return hashlib.sha256(content.encode()).hexdigest()[:12]


@dataclass
class Wanted:
    """A cell of ours before it is measured.

    Attributes:
        row, column: Where it stands.
        evaluation: `task/protocol`, e.g. `denoise/sbp`; empty where only the cost of the fit counts.
        value: Which value of the evaluation: `p2m`, `oracle.cd_sum2` (a floor), `cost.minutes` (of the fit).
        scale: Factor to the table's unit.
        fits: One per shape; the cell is the mean over them.
        by_class: Mean over classes (what stands before the `/` of a shape's name) of the means over their shapes.
        reason: Why it must stay blank; empty otherwise.
        notes: Footnotes.
    """

    row: str
    column: str
    evaluation: str
    value: str
    scale: float
    by_class: bool = False
    fits: list[Fit] = field(default_factory=list)
    reason: str = ""
    notes: list[str] = field(default_factory=list)

    @property
    def floor(self) -> str:
        """Which floor of the evaluation is wanted; empty for the value itself."""
        group = self.value.rpartition(".")[0]
        return "" if group == "cost" else group


@dataclass
class Table:
    """One of conf/table/*.yaml."""

    name: str
    spec: dict[str, Any]

    @property
    def title(self) -> str:
        """What the table shows."""
        return self.spec["title"]


@dataclass
class Profile:
    """One of conf/profile/*.yaml: with which effort and on which data tables are computed.

    Attributes:
        title: In one line.
        settings: Of every fit, below what a table says.
        datamodule: Stands in for every dataset (generated shapes); None: the tables' own data.
        keep: Settings of the tables' datamodules that the stand-in understands.
        shapes: At most this many shapes an experiment; None: all.
        limits: Largest value of a setting.
        samples: At most this many samples of a mesh, whatever the protocol says; None: as it says.
    """

    name: str
    title: str
    settings: list[str] = field(default_factory=list)
    datamodule: str | None = None
    keep: list[str] = field(default_factory=list)
    shapes: int | None = None
    limits: dict[str, float] = field(default_factory=dict)
    samples: int | None = None


# Of a datamodule: names of the shapes present, and what is missing and where to get it.
Present = Callable[[str], tuple[list[str], str | None]]


def load_tables(names: list[str] | None = None) -> list[Table]:
    """Read the tables of conf/table; all, or those asked for by name or by its start (`T01`).

    Raises:
        ConfigError: Unknown name, or a table that says what no table may say.
    """
    known = {path.stem: path for path in sorted((conf_dir() / "table").glob("*.yaml"))}
    chosen = list(known) if not names else [_match(name, list(known)) for name in names]
    tables = []
    for name in dict.fromkeys(chosen):
        spec = _read(known[name])
        _check_keys(known[name], spec, _TABLE)
        for experiment in spec["experiments"]:
            _check_keys(known[name], experiment, _EXPERIMENT)
            for cell in experiment["cells"]:
                _check_keys(known[name], cell, _CELL)
        tables.append(Table(name, spec))
    return tables


def load_profile(name: str) -> Profile:
    """Read a profile of conf/profile."""
    known = {path.stem: path for path in sorted((conf_dir() / "profile").glob("*.yaml"))}
    if name not in known:
        raise ConfigError(f"Unknown profile {name!r}.{suggest(name, list(known))}")
    spec = _read(known[name])
    _check_keys(known[name], spec, _PROFILE)
    return Profile(name, **spec)


def expand(table: Table, profile: Profile, present: Present) -> list[Wanted]:
    """Return every cell of ours in a table, in order.

    Args:
        table: What to measure.
        profile: With which effort.
        present: Tells the shapes of a datamodule that are at hand.
    """
    own = table.spec.get("profiles", {}).get(profile.name, {})
    cells = []
    for experiment in table.spec["experiments"]:
        if profile.name in experiment.get("only", [profile.name]):
            cells += _experiment(experiment, own, profile, present)
    return cells


def _experiment(spec: dict[str, Any], own: dict[str, Any], profile: Profile, present: Present) -> list[Wanted]:
    axes = {name: {str(k): v for k, v in values.items()} for name, values in spec.get("axes", {}).items()}
    for name in axes:
        axes[name].update({str(k): v for k, v in own.get("axes", {}).get(name, {}).items()})
    wanted = []
    for labels in itertools.product(*axes.values()):
        point = {name: (label, axes[name][label]) for name, label in zip(axes, labels, strict=True)}
        for cell in spec["cells"]:
            evaluation = _fill(cell.get("evaluate", spec.get("evaluate", "")), point, 1)
            # Settings may depend on what the field is for: `task={task}`.
            task = evaluation.split("/")[0] or "denoise"
            fits, reason, notes = _fits(spec, own, profile, present, {**point, "task": (task, task)})
            wanted.append(
                Wanted(
                    row=_fill(cell["row"], point, 0),
                    column=_fill(cell["column"], point, 0),
                    evaluation=evaluation,
                    value=_fill(cell["value"], point, 1),
                    scale=float(cell.get("scale", 1)),
                    by_class=cell.get("mean") == "class",
                    fits=fits,
                    reason=reason,
                    notes=[spec["note"], *notes] if "note" in spec else notes,
                )
            )
    return wanted


def _fits(
    spec: dict[str, Any], own: dict[str, Any], profile: Profile, present: Present, point: dict[str, tuple[str, Any]]
) -> tuple[list[Fit], str, list[str]]:
    """Return the fits at one point of the axes, or why there are none, and what a reader must know about them."""
    for _, value in point.values():
        if isinstance(value, dict):
            return [], str(value["skip"]), []
    datamodule = profile.datamodule or spec["datamodule"]
    names, missing = present(datamodule)
    pattern = "*" if profile.datamodule else _fill(str(spec.get("shapes", "*")), point, 1)
    names = [name for name in names if fnmatch(name, pattern)]
    wanted = own.get("shapes")
    notes = []
    if not names:
        return [], missing or f"{datamodule}: no shape {pattern} is here", []
    if missing and not profile.datamodule:
        notes.append(missing)
    if wanted and not profile.datamodule:
        names = [name for name in names if name in wanted]
        if not names:
            return [], f"{datamodule}: none of the shapes {', '.join(wanted)} is here", []
    names = names[: profile.shapes]
    settings = [*profile.settings, *own.get("settings", []), *spec.get("settings", [])]
    kept = _settings([_fill(text, point, 1) for text in settings], profile)
    method = spec.get("method", "n2n")
    return [Fit(method, datamodule, name, kept) for name in names], "", notes


def _settings(settings: list[str], profile: Profile) -> tuple[str, ...]:
    """Return each key once, the last word counting, within the profile's limits."""
    values = dict(text.split("=", 1) for group in settings for text in group.split())
    for key in list(values):
        if profile.datamodule and key.startswith("datamodule.") and key not in profile.keep:
            del values[key]
    for key, limit in profile.limits.items():
        if key in values and float(values[key]) > limit:
            values[key] = f"{limit:g}"
    return tuple(f"{key}={value}" for key, value in sorted(values.items()))


def _fill(text: str, point: dict[str, tuple[str, Any]], which: int) -> str:
    """Put labels (0) or values (1) of the axes in the place of `{axis}`."""
    for name, pair in point.items():
        text = text.replace("{" + name + "}", str(pair[which]))
    return text


def _match(name: str, known: list[str]) -> str:
    found = [k for k in known if k == name] or [k for k in known if k.lower().startswith(name.lower())]
    if len(found) != 1:
        raise ConfigError(f"Unknown table {name!r}.{suggest(name, known)}")
    return found[0]


def _read(path: Path) -> dict[str, Any]:
    try:
        spec = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: is not YAML ({' '.join(str(error).split())})") from error
    if not isinstance(spec, dict):
        raise ConfigError(f"{path}: holds no settings; see the other files of {path.parent}")
    return spec


def _check_keys(path: Path, spec: dict[str, Any], known: set[str]) -> None:
    for key in spec:
        if key not in known:
            raise ConfigError(f"{path}: Unknown key {key!r}.{suggest(key, sorted(known))}")
