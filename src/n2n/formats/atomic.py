"""Results appear whole or not at all."""

import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from n2n.errors import OutputError
from n2n.registry import suggest

ELSEWHERE = "choose another folder with -o"


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder; rename it to `path` at the end, remove it on failure.

    Raises:
        OutputError: The folder is missing, not writable or full.
    """
    path = Path(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise OutputError(f"{path}: cannot write there ({error.strerror}); {ELSEWHERE}") from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes files private; results follow the user's umask like any other file.
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        temporary.replace(path)
    except OSError as error:
        raise OutputError(f"{path}: writing failed ({error.strerror or error}); nothing was left there") from error
    finally:
        temporary.unlink(missing_ok=True)


def make_folder(folder: Path, advice: str = "choose another one") -> Path:
    """Make a folder, and those it lies in, unless it is there; return it.

    Args:
        folder: The folder.
        advice: What to do where that cannot be, for the message.

    Raises:
        OutputError: It cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot make this folder ({error.strerror}); {advice}") from error
    return folder


def check_writable(path: str | Path, extensions: Iterable[str], new_folder: bool = False) -> None:
    """Find out before a long computation whether a result can be written.

    Args:
        path: Output file.
        extensions: What can be written, with dots, lower case.
        new_folder: Whether a missing folder will be made by then; found out is then whether it can be.

    Raises:
        OutputError: Unknown extension, missing folder, a folder in the way, or no permission.
    """
    path, extensions = Path(path), sorted(extensions)
    if path.suffix.lower() not in extensions:
        known = ", ".join(extensions)
        hint = suggest(path.suffix.lower(), extensions).split(" Known")[0]
        raise OutputError(
            f"{path}: cannot write files ending in {path.suffix or 'nothing'!r};{hint} choose one of: {known}"
        )
    try:
        if path.is_dir():
            raise OutputError(f"{path}: is a folder; give a file name")
        folder = path.parent
        if new_folder:
            folder = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
            if not folder.is_dir():
                raise OutputError(f"{path}: {folder} is a file, not a folder; {ELSEWHERE}")
        elif not folder.is_dir():
            raise OutputError(f"{path}: the folder {folder} does not exist; create it first")
        with tempfile.TemporaryFile(dir=folder):
            pass
        is_locked = path.exists() and not os.access(path, os.W_OK)
    except OSError as error:
        raise OutputError(f"{path}: cannot write there ({error.strerror}); {ELSEWHERE}") from error
    if is_locked:
        raise OutputError(f"{path}: exists and is read-only; choose another name")
