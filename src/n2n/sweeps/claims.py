"""One owner at a time: of a run, of a table's fit; on one machine and on a folder that several share.

A claim on `run/claim` is a numbered file, `run/claim.1`, `run/claim.2`, ...; the highest number counts. To take what
is free, released or left by a dead owner is to create the next number, which a file system lets exactly one do. The
highest is never removed, so that numbers only grow and a slow taker, who finds a higher one than its own, withdraws.
"""

import contextlib
import errno
import json
import os
import socket
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from n2n.errors import OutputError

STALE_AFTER = 60.0
_BEATS = 4  # heartbeats within the time after which a silent owner counts as dead
_NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK}


@dataclass(frozen=True)
class Owner:
    """Who holds a claim, or held it.

    Attributes:
        machine: Where process numbers mean the same: host, boot and process namespace.
        pid: Process.
        born: When the process began, as its machine counts; tells it from a later one of that number. Empty if unknown.
        token: Different for each claim; empty once released.
    """

    machine: str
    pid: int
    born: str
    token: str


@contextmanager
def claim(path: Path, stale_after: float = STALE_AFTER) -> Iterator[bool]:
    """Own `path` while the block runs, unless a living process does.

    A thread touches the claim as long as the block runs. An owner on this machine is dead when its process is; one
    elsewhere, when it did not touch its claim for `stale_after` seconds by the clock of the file system.

    Args:
        path: Beside what is owned; its folder exists. Numbered files of this name appear there, and the last one stays.
        stale_after: Seconds.

    Yields:
        Whether this process owns it.

    Raises:
        OutputError: The folder cannot be written.
    """
    mine = _take(path, stale_after)
    if mine is None:
        yield False
        return
    stop = threading.Event()
    beat = threading.Thread(target=_beat, args=(mine, stop, stale_after / _BEATS), daemon=True)
    beat.start()
    try:
        yield True
    finally:
        stop.set()
        beat.join()
        _release(mine)


def is_held(path: Path, stale_after: float = STALE_AFTER) -> bool:
    """Return whether a living process owns `path`; looks without touching anything."""
    number = _newest(path)
    if not number:
        return False
    owner, touched = _read(_numbered(path, number))
    return owner is None or _is_alive(owner, time.time() - touched, stale_after)


def heartbeat_age(path: Path) -> float | None:
    """Return seconds since the last owner of `path` was heard of; None where nobody ever owned it."""
    number = _newest(path)
    try:
        return max(0.0, time.time() - _numbered(path, number).stat().st_mtime) if number else None
    except FileNotFoundError:
        return 0.0  # replaced this moment


def _take(path: Path, stale_after: float) -> Path | None:
    """Return our claim; None where somebody else's is valid."""
    candidate = path.with_name(f".{path.name}-{uuid.uuid4().hex}")
    owner = Owner(_machine(), os.getpid(), _born(os.getpid()), candidate.name)
    try:
        candidate.write_text(json.dumps(asdict(owner)))
    except OSError as error:
        raise OutputError(f"{path}: cannot write there ({error.strerror}); choose another folder") from error
    try:
        newest = _newest(path)
        if newest:
            # Both times are the file system's: clocks of machines differ.
            current, touched = _read(_numbered(path, newest))
            silent = candidate.stat().st_mtime - touched
            if current is None or _is_alive(current, silent, stale_after):
                return None
        mine = _numbered(path, newest + 1)
        if not _create(candidate, mine):
            return None
        if _newest(path) > newest + 1:
            mine.unlink(missing_ok=True)
            return None
        for number in _numbers(path):
            if number <= newest:
                _numbered(path, number).unlink(missing_ok=True)
        return mine
    finally:
        candidate.unlink(missing_ok=True)


def _create(candidate: Path, claimed: Path) -> bool:
    """Make the candidate the claim if there is none: with its content at once where the file system has hard links."""
    try:
        os.link(candidate, claimed)
    except FileExistsError:
        # The answer of a file server may be lost and the request repeated: then it is our own link that exists.
        return candidate.stat().st_nlink > 1
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise OutputError(f"{claimed}: cannot write there ({error.strerror}); choose another folder") from error
        try:
            with claimed.open("x") as file:
                file.write(candidate.read_text())
        except FileExistsError:
            return False
    return True


def _release(mine: Path) -> None:
    """Say that nobody owns it; silently not where another one took it meanwhile."""
    owner, _ = _read(mine)
    if owner is None:
        return
    released = mine.with_name(f".{owner.token or mine.name}-released")
    with contextlib.suppress(OSError):
        released.write_text(json.dumps({**asdict(owner), "token": ""}))
        released.replace(mine)


def _beat(mine: Path, stop: threading.Event, every: float) -> None:
    while not stop.wait(every):
        # A file server that is away for a moment must not end the heartbeat.
        with contextlib.suppress(OSError):
            os.utime(mine)


def _read(claimed: Path) -> tuple[Owner | None, float]:
    """Return the owner and the time it was heard of last; no owner where the claim is just being made or replaced."""
    try:
        # Opening a file on a server asks for its present time; `stat` alone may tell an old one.
        with claimed.open() as file:
            text, touched = file.read(), os.fstat(file.fileno()).st_mtime
    except OSError:
        return None, time.time()
    try:
        return Owner(**json.loads(text)), touched
    except (ValueError, TypeError):
        return Owner("", 0, "", "unreadable"), touched


def _is_alive(owner: Owner, silent: float, stale_after: float) -> bool:
    if not owner.token:
        return False
    if owner.machine == _machine():
        born = _born(owner.pid)
        if born != owner.born or not _exists(owner.pid):
            return False
        if born:
            return True
    return silent < stale_after


def _machine() -> str:
    """Name what process numbers belong to; two containers of one host number their processes apart."""
    parts = [socket.gethostname()]
    with contextlib.suppress(OSError):
        parts.append(Path("/proc/sys/kernel/random/boot_id").read_text().strip())
        parts.append(str(Path("/proc/self/ns/pid").readlink()))
    return " ".join(parts)


def _born(pid: int) -> str:
    """Return when a process began, in the kernel's ticks; empty where it is dead or the system does not say."""
    try:
        # The name, in brackets, may hold spaces and brackets. After it: state, 18 other numbers, start.
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return ""
    return "" if fields[0] in "ZX" else fields[19]


def _exists(pid: int) -> bool:
    if os.name == "nt":
        return True  # signal 0 is Ctrl-C there; the heartbeat has to tell
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    return True


def _numbered(path: Path, number: int) -> Path:
    return path.with_name(f"{path.name}.{number}")


def _numbers(path: Path) -> list[int]:
    prefix = f"{path.name}."
    try:
        names = [file.name for file in path.parent.iterdir()]
    except FileNotFoundError:
        return []
    return [int(end) for name in names if name.startswith(prefix) and (end := name[len(prefix) :]).isdecimal()]


def _newest(path: Path) -> int:
    return max(_numbers(path), default=0)
