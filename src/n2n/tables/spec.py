"""A table as data: which fits, on which shapes, measured how, become which cells (conf/table, conf/profile)."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from n2n.compose import conf_dir
from n2n.errors import ConfigError
from n2n.evaluation.options import find_options
from n2n.registry import suggest
from n2n.tables.check import check_profile, check_table

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml, where it was built in, is ten times faster


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

    def described(self) -> dict[str, Any]:
        """Return what a record says about itself."""
        return {
            "id": self.id,
            "method": self.method,
            "datamodule": self.datamodule,
            "shape": self.shape,
            "settings": list(self.settings),
        }

    def failed(self, error: str) -> dict[str, Any]:
        """Return the record of a fit that came to nothing."""
        return {**self.described(), "status": "failed", "error": error}

    def damaged(self, error: str) -> dict[str, Any]:
        """Return what stands for a record that cannot be read."""
        return {**self.described(), "status": "damaged", "error": error}


@dataclass
class Wanted:
    """A cell of ours before it is measured.

    Attributes:
        row, column: Where it stands.
        method: As of its fits.
        evaluation: `task/protocol`, e.g. `denoise/sbp`; empty where only the cost of the fit counts.
        value: Which value of the evaluation: `p2m`, `oracle.cd_sum2` (a floor), `cost.minutes` (of the fit).
        scale: Factor to the table's unit.
        fits: One per shape; the cell is the mean over them.
        by_class: Mean over classes (what stands before the `/` of a shape's name) of the means over their shapes.
        whole: The shapes are all of the dataset, so that the number can be set against one for the dataset.
        reason: Why it must stay blank; empty otherwise.
        notes: Footnotes.
    """

    row: str
    column: str
    evaluation: str
    value: str
    scale: float
    method: str = "n2n"
    by_class: bool = False
    whole: bool = True
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
    limits: dict[str, int | float] = field(default_factory=dict)
    samples: int | None = None


def load_tables(names: Sequence[str] = (), folder: Path | None = None) -> list[Table]:
    """Read tables: ours (conf/table), those of installed packages, those of a folder.

    Args:
        names: Which, by name or by how it begins (`T01`); empty: all.
        folder: With further tables.

    Raises:
        ConfigError: Unknown name, or a table that says what no table may say.
    """
    tables = []
    for name, path in {**find_options("table"), **own_tables(folder)}.items():
        spec = _read(path)
        check_table(str(path), spec)
        tables.append(Table(name, spec))
    return choose(tables, names)


def choose(tables: list[Table], names: Sequence[str]) -> list[Table]:
    """Return the tables of some names, or of how they begin, each once; without names all.

    Raises:
        ConfigError: Unknown name, or one that may be several tables.
    """
    known = {table.name: table for table in tables}
    chosen = dict.fromkeys(_match(name, list(known)) for name in names) or known
    return [known[name] for name in chosen]


def own_tables(folder: Path | None) -> dict[str, Path]:
    """Return the tables of a folder: name -> file.

    Raises:
        ConfigError: There are none, or one is called like a table of n2n or of a plugin.
    """
    if folder is None:
        return {}
    found = {path.stem: path for path in sorted(folder.glob("*.yaml"))}
    if not found:
        raise ConfigError(f"{folder}: no table found there; a table is a file *.yaml like those of {conf_dir()}/table")
    for name in sorted(found.keys() & find_options("table").keys()):
        raise ConfigError(f"{found[name]}: a table {name!r} exists already; give yours another name")
    return found


def load_profile(name: str) -> Profile:
    """Read a profile of conf/profile, or of an installed package."""
    known = find_options("profile")
    if name not in known:
        raise ConfigError(f"Unknown profile {name!r}.{suggest(name, list(known))}")
    spec = _read(known[name])
    check_profile(str(known[name]), spec)
    return Profile(name, **spec)


def _match(name: str, known: list[str]) -> str:
    found = [k for k in known if k == name] or [k for k in known if k.lower().startswith(name.lower())]
    if len(found) > 1:
        raise ConfigError(f"table {name!r} may be any of {', '.join(found)}; write more of the name")
    if not found:
        raise ConfigError(f"Unknown table {name!r}.{suggest(name, known)}")
    return found[0]


def _read(path: Any) -> dict[str, Any]:
    try:
        spec = yaml.load(path.read_text(encoding="utf-8"), _LOADER)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: is not YAML ({' '.join(str(error).split())})") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from error
    if not isinstance(spec, dict):
        raise ConfigError(f"{path}: holds no settings; see the other files of {conf_dir()}/table")
    return spec
