"""Unpack zip and tar archives of strangers: nothing outside the folder, every file whole or absent."""

import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from n2n.errors import InputError, OutputError
from n2n.formats import atomic_path

Report = Callable[[int, int], None]
_BLOCK = 1 << 20
_DAMAGE = (zipfile.BadZipFile, tarfile.TarError, zlib.error, EOFError)


def unpack(archive: Path, folder: Path, report: Report | None = None) -> int:
    """Unpack all files of an archive below a folder; files that are there in the same size stay as they are.

    Args:
        archive: .zip or .tar, compressed or not; told by its content.
        folder: Made if missing.
        report: Called with the bytes done and the bytes in all.

    Returns:
        How many files the archive holds.

    Raises:
        InputError: No archive, damaged, or with members that point out of the folder or are links; then nothing is
            written.
        OutputError: The folder cannot be written to.
    """
    report = report or (lambda done, total: None)
    try:
        if zipfile.is_zipfile(archive):
            with zipfile.ZipFile(archive) as file:
                members = _checked(archive, [(m.filename, m.file_size, _plain(m), m) for m in file.infolist()])
                _write(members, folder, file.open, report)
        elif tarfile.is_tarfile(archive):
            with tarfile.open(archive) as file:
                infos = [(m.name, m.size, m.isfile() or m.isdir(), m) for m in file if not m.isdir()]
                members = _checked(archive, infos)
                _write(members, folder, file.extractfile, report)
        else:
            raise InputError(f"{archive}: is no zip or tar archive; the server may have sent a web page instead")
    except _DAMAGE as error:
        raise InputError(f"{archive}: is damaged ({error}); delete it and download it again") from error
    except NotImplementedError as error:
        raise InputError(f"{archive}: cannot be unpacked here ({error}); unpack it yourself in {folder}") from error
    except OSError as error:
        raise OutputError(f"{folder}: unpacking failed ({error.strerror or error})") from error
    return len(members)


def _plain(member: zipfile.ZipInfo) -> bool:
    """Tell files from links and devices, which zip marks in the Unix mode."""
    kind = member.external_attr >> 28
    return member.is_dir() or kind in (0, 0o10)


def _checked(archive: Path, members: list[tuple]) -> list[tuple]:
    """Return the files among (name, size, plain, member); refuse names that lead elsewhere."""
    files = []
    for name, size, plain, member in members:
        path = PurePosixPath(name.replace("\\", "/"))
        if path.is_absolute() or ".." in path.parts or PureWindowsPath(name).drive:
            raise InputError(f"{archive}: the member {name!r} leads out of the folder; nothing was unpacked")
        if not plain:
            raise InputError(f"{archive}: the member {name!r} is a link or a device, no file; nothing was unpacked")
        if not name.endswith("/"):
            files.append((path, size, member))
    return files


def _write(members: list[tuple], folder: Path, open_member: Callable[..., Any], report: Report) -> None:
    done, total = 0, sum(size for _, size, _ in members)
    for path, size, member in members:
        target = folder / path
        if not (target.is_file() and target.stat().st_size == size):
            _inside(target, folder).parent.mkdir(parents=True, exist_ok=True)
            with atomic_path(target) as temporary, open_member(member) as source, temporary.open("wb") as file:
                for block in _blocks(source):
                    file.write(block)
        done += size
        report(done, total)


def _inside(target: Path, folder: Path) -> Path:
    """Refuse to follow a link that stands in the folder already and leads out of it."""
    if not target.parent.resolve().is_relative_to(folder.resolve()):
        raise OutputError(f"{target}: a link in {folder} leads elsewhere; remove the link, then unpack again")
    return target


def _blocks(source: Any) -> Iterator[bytes]:
    """Read a member; what cannot be read is damage, unlike what cannot be written."""
    while True:
        try:
            block = source.read(_BLOCK)
        except OSError as error:
            raise EOFError(str(error)) from error
        if not block:
            return
        yield block
