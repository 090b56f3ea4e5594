"""One run of a sweep, done by whoever claims it."""

import os
import shutil
import socket
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from n2n.errors import N2NError
from n2n.formats.atomic import make_folder
from n2n.messages import unexpected
from n2n.sweeps.claims import claim
from n2n.sweeps.status import CLAIM, FIELD_FILE, Status, read_status

TAKEN = "taken"


def attempt(folder: Path, settings: list[str], fingerprint: Callable[[], str | None], fit: Callable[[], object]) -> str:
    """Fit a run unless it is done or another process is at it; keep in status.json what became of it.

    A run whose data are not those it was fitted to, or was being fitted to, starts anew. Data that cannot be read have
    not changed: what was fitted to them stays.

    Args:
        folder: Of the run; made here.
        settings: What the sweep varies, as `key=value`.
        fingerprint: Names the data by content; None where they cannot be read, which `fit` will complain about.
        fit: Does the work in `folder`; goes on from a checkpoint it finds there. Its last file is the field.

    Returns:
        `done`, `failed` or `taken`: another process has it.

    Raises:
        OutputError: The folder cannot be written.
    """
    make_folder(folder)
    with claim(folder / CLAIM) as mine:
        return _attempt(folder, settings, fingerprint, fit) if mine else TAKEN


def _attempt(
    folder: Path, settings: list[str], fingerprint: Callable[[], str | None], fit: Callable[[], object]
) -> str:
    before, field = read_status(folder), folder / FIELD_FILE
    is_done = before.get("state") == "done" and field.exists()
    start = time.perf_counter()
    now = Status(
        state="running",
        attempt=before.get("attempt", 0) + 1,
        host=socket.gethostname(),
        pid=os.getpid(),
        started=_now(),
        settings=settings,
        data=before.get("data"),
    )
    try:
        if not is_done:
            now.write(folder)  # before the data are read: that may already take more memory than there is
        data = fingerprint() or now.data
        if before and data != now.data:
            _clear(folder)
        now = replace(now, data=data)
        if field.exists():
            if not is_done:  # the process that fitted it ended between its last file and the status
                attempt, seconds = before.get("attempt", 1), before.get("seconds")
                replace(now, state="done", attempt=attempt, ended=_now(), seconds=seconds).write(folder)
            return "done"
        now.write(folder)
        fit()
        replace(now, state="done", ended=_now(), seconds=_since(start)).write(folder)
    except Exception as error:
        text = " ".join(message(error).split())
        replace(now, state="failed", ended=_now(), seconds=_since(start), error=text).write(folder)
        return "failed"
    return "done"


def give_up(folder: Path, settings: list[str], reason: str) -> None:
    """Write down that a run failed which could not do so itself; not where another process has it."""
    with claim(folder / CLAIM) as mine:
        if mine:
            before = read_status(folder)
            Status(
                state="failed",
                attempt=before.get("attempt", 0),
                host=before.get("host", ""),
                pid=before.get("pid", 0),
                started=before.get("started", _now()),
                settings=settings,
                data=before.get("data"),
                ended=_now(),
                error=reason,
            ).write(folder)


def message(error: Exception) -> str:
    """Say in one line what went wrong."""
    if isinstance(error, MemoryError):
        return "not enough memory; use fewer points, a smaller batch_size or fewer processes"
    return str(error) if isinstance(error, N2NError) else unexpected(error)


def _clear(folder: Path) -> None:
    """Remove what a fit of other data left."""
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif not path.name.startswith((f"{CLAIM}.", f".{CLAIM}-")):
            path.unlink(missing_ok=True)


def _now() -> str:
    return datetime.now().astimezone().isoformat(timespec="seconds")


def _since(start: float) -> float:
    return round(time.perf_counter() - start, 2)
