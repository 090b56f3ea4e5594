"""Sweeps on disk: `sweeps/NAME/sweep.json`, `sweeps/NAME/runs/HASH/`, and what became of each run."""

import csv
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from n2n.errors import ConfigError, InputError, N2NError
from n2n.formats.atomic import make_folder
from n2n.registry import suggest
from n2n.sweeps.claims import claim, heartbeat_age
from n2n.sweeps.status import CLAIM, read_json, read_status, run_state, write_json

SWEEPS = Path("sweeps")
STATES = ("done", "running", "stale", "failed", "pending")
_SWEEP = "sweep.json"
_WAIT = 0.05  # seconds


@dataclass(frozen=True)
class RunInfo:
    """One run as its folder shows it.

    Attributes:
        hash: Name of its folder.
        settings: What the sweep varies, e.g. {"seed": "1"}; empty for a run of its own.
        folder: Where it is, or will be.
        state: pending, running, stale (its process has gone; to be resumed), done or failed.
        error: Why it failed, in one line.
        seconds: The last attempt took, once it has ended.
        attempt: How often it was begun.
        heartbeat: Seconds since its process was heard of; None if never.
        data: Fingerprint of its data.
    """

    hash: str
    settings: dict[str, str]
    folder: Path
    state: str
    error: str | None = None
    seconds: float | None = None
    attempt: int = 0
    heartbeat: float | None = None
    data: str | None = None

    @classmethod
    def read(cls, folder: Path, settings: list[str] | None = None) -> "RunInfo":
        """Read a run folder, of a sweep or of its own; `settings` are those planned, where it has none yet."""
        status, age = read_status(folder), heartbeat_age(folder / CLAIM)
        return cls(
            hash=folder.name,
            settings=as_dict(settings or status.get("settings", [])),
            folder=folder,
            state=run_state(folder, status.get("state")),
            error=status.get("error"),
            seconds=status.get("seconds"),
            attempt=status.get("attempt", 0),
            heartbeat=age,
            data=status.get("data"),
        )

    @property
    def label(self) -> str:
        """The settings in one line."""
        return " ".join(f"{key}={value}" for key, value in self.settings.items()) or self.hash

    def iteration(self) -> int | None:
        """Return how far the fit is known to be: its end, or the last line of the log."""
        summary = read_json(self.folder / "summary.json")
        if self.state == "done" and "iterations" in summary:
            return int(summary["iterations"])
        steps = [row["step"] for row in _last_rows(self.folder) if row.get("step")]
        return max((int(float(step)) for step in steps), default=None)


@dataclass(frozen=True)
class Sweep:
    """Many runs of one command.

    Attributes:
        folder: sweeps/NAME.
        command: Arguments of `n2n fit`.
        created: When, ISO 8601.
        axes: What is varied and its values.
        planned: Settings of each run, by hash; an optimiser plans as it goes.
        earlier: Commands that the sweep had before it was extended by `command`.
    """

    folder: Path
    command: list[str]
    created: str
    axes: dict[str, list[str]]
    planned: dict[str, list[str]]
    earlier: list[list[str]] = field(default_factory=list)

    @property
    def name(self) -> str:
        return self.folder.name

    @property
    def commands(self) -> list[list[str]]:
        return [*self.earlier, self.command]

    @property
    def runs(self) -> list[RunInfo]:
        """All runs as they are now: those planned, in order, then others found."""
        there = self.folder / "runs"
        found = sorted(path.parent.name for path in there.glob("*/status.json")) if there.is_dir() else []
        return [RunInfo.read(there / name, self.planned.get(name)) for name in dict.fromkeys([*self.planned, *found])]

    def run_dir(self, name: str) -> Path:
        """Return the folder of the run called `name`."""
        return self.folder / "runs" / name

    @classmethod
    def open(cls, name_or_path: str | Path) -> "Sweep":
        """Read a sweep, given by name or folder.

        Raises:
            ConfigError: There is none; with the nearest known name.
            InputError: Its file is damaged.
        """
        folder = _find(name_or_path)
        try:
            record = json.loads((folder / _SWEEP).read_text())
            return cls(
                folder=folder,
                command=record["command"],
                created=record["created"],
                axes=record["axes"],
                planned={name: run["settings"] for name, run in record["runs"].items()},
                earlier=record.get("earlier", []),
            )
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(
                f"{folder / _SWEEP}: is damaged ({error}); the command of the sweep, with sweep={folder.name}, makes it"
                " anew"
            ) from error

    @classmethod
    def plan(cls, name: str, command: list[str], axes: dict[str, list[str]], planned: dict[str, list[str]]) -> "Sweep":
        """Write down what a sweep is; one of this name that is there already is extended."""
        folder = SWEEPS / name
        make_folder(folder)
        with _turn(folder / CLAIM):
            created, earlier = datetime.now().astimezone().isoformat(timespec="seconds"), []
            if (folder / _SWEEP).exists():
                before = cls.open(folder)
                created = before.created
                earlier = [one for one in before.commands if one != command]
                planned = {**before.planned, **planned}
                axes = {
                    key: list(dict.fromkeys([*before.axes.get(key, []), *axes.get(key, [])]))
                    for key in dict.fromkeys([*before.axes, *axes])
                }
            sweep = cls(folder, command, created, axes, planned, earlier)
            sweep._write()
        return sweep

    def _write(self) -> None:
        write_json(
            self.folder / _SWEEP,
            {
                "name": self.name,
                "command": self.command,
                "earlier": self.earlier,
                "created": self.created,
                "axes": self.axes,
                "runs": {run: {"settings": settings} for run, settings in self.planned.items()},
            },
        )


def all_sweeps() -> tuple[list[Sweep], list[N2NError]]:
    """Return the sweeps of this folder, oldest first, and what is wrong with those that cannot be read."""
    found, damaged = [], []
    for path in sorted(SWEEPS.glob(f"*/{_SWEEP}")):
        try:
            found.append(Sweep.open(path.parent))
        except N2NError as error:
            damaged.append(error)
    return sorted(found, key=lambda sweep: sweep.created), damaged


def as_dict(settings: list[str]) -> dict[str, str]:
    """Turn `key=value` lines into a mapping.

    >>> as_dict(["seed=1", "++terms.zero_level.weight=0.1"])
    {'seed': '1', 'terms.zero_level.weight': '0.1'}
    """
    pairs = (text.lstrip("+").partition("=") for text in settings)
    return {key: value for key, _, value in pairs}


@contextmanager
def _turn(path: Path) -> Iterator[None]:
    """Wait until nobody else owns `path`, then own it: of two commands that extend a sweep one would be forgotten."""
    while True:
        with claim(path) as mine:
            if mine:
                yield
                return
        time.sleep(_WAIT)


def _last_rows(folder: Path) -> list[dict[str, str]]:
    try:
        with (folder / "metrics.csv").open(newline="") as file:
            return list(csv.DictReader(file))
    except OSError:
        return []


def _find(name_or_path: str | Path) -> Path:
    for folder in (SWEEPS / name_or_path, Path(name_or_path)):
        if (folder / _SWEEP).is_file():
            return folder
    known = sorted(path.parent.name for path in SWEEPS.glob(f"*/{_SWEEP}"))
    hint = suggest(Path(name_or_path).name, known) or f" There are none in {SWEEPS.absolute()}."
    raise ConfigError(f"Unknown sweep {str(name_or_path)!r}.{hint} `n2n fit -m` makes one")
