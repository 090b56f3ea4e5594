"""What a run folder says about its run: status.json, the claim, and the files a fit leaves."""

import contextlib
import json
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from n2n.formats.atomic import atomic_path, make_folder
from n2n.sweeps.claims import STALE_AFTER, is_held

FIELD_FILE = "field.ckpt"  # that of n2n.tasks.field, which imports torch
CLAIM = "claim"
_STATUS = "status.json"


@dataclass(frozen=True)
class Status:
    """The content of a run's status.json; times in ISO 8601."""

    state: str
    attempt: int
    host: str
    pid: int
    started: str
    settings: list[str]
    data: str | None
    ended: str | None = None
    seconds: float | None = None
    error: str | None = None

    def write(self, folder: Path) -> None:
        """Write it into a run folder."""
        write_json(folder / _STATUS, asdict(self))


def read_status(folder: Path) -> dict[str, Any]:
    """Return a run's status.json; empty where there is none."""
    return read_json(folder / _STATUS)


def read_json(path: Path) -> dict[str, Any]:
    """Return a JSON object; empty where the file is missing or damaged."""
    try:
        content = json.loads(path.read_text())
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def write_json(path: Path, content: Any) -> None:
    """Write JSON, whole or not at all; makes the folder.

    Raises:
        OutputError: The folder cannot be written.
    """
    make_folder(path.parent)
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n")


def run_state(folder: Path, told: str | None) -> str:
    """Return a run's state, given the one its status tells; a process that was killed could not change that.

    A folder without a status is that of a run of its own: its log says whether somebody is at it.
    """
    is_finished, is_owned = (folder / FIELD_FILE).exists(), is_held(folder / CLAIM)
    if told is None:
        if is_finished:
            return "done"
        if not folder.exists():
            return "pending"
        age = _log_age(folder)
        if age is None:
            return "running" if is_owned else "pending"
        return "running" if is_owned or age < STALE_AFTER else "stale"
    if told == "running":
        return "running" if is_owned else "stale"
    return "pending" if told == "done" and not is_finished else told


def _log_age(folder: Path) -> float | None:
    written = []
    for path in folder.glob("*.*"):
        if path.suffix in {".csv", ".ckpt"}:
            with contextlib.suppress(FileNotFoundError):  # a temporary file may be renamed meanwhile
                written.append(path.stat().st_mtime)
    return datetime.now().timestamp() - max(written) if written else None
