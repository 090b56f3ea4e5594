"""One table from file extension to reader and writer, and one place where their failures become messages."""

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from n2n.errors import InputError, N2NError, OutputError
from n2n.formats import arrays, kitti, las, meshes, pcd, ply, text
from n2n.formats.atomic import atomic_path
from n2n.formats.cloud import Cloud
from n2n.registry import suggest

_READERS: dict[str, Callable[[Path], Cloud]] = {
    ".ply": ply.read,
    **dict.fromkeys((".xyz", ".txt", ".csv", ".pts", ".asc"), text.read),
    ".npy": arrays.read_npy,
    ".npz": arrays.read_npz,
    **dict.fromkeys((".off", ".obj", ".stl"), meshes.read_vertices),
    ".pcd": pcd.read,
    **dict.fromkeys((".las", ".laz"), las.read),
    ".bin": kitti.read,
}
_WRITERS: dict[str, Callable[[Path, Cloud], None]] = {
    ".ply": ply.write,
    **dict.fromkeys((".xyz", ".txt", ".csv", ".pts", ".asc"), text.write),
    ".npy": arrays.write_npy,
    ".npz": arrays.write_npz,
    ".pcd": pcd.write,
    **dict.fromkeys((".las", ".laz"), las.write),
}
_HOLD_TEXTS = (".xyz", ".txt", ".csv", ".pts", ".asc", ".npz")
CLOUD_EXTENSIONS_READ = tuple(_READERS)
CLOUD_EXTENSIONS_WRITE = tuple(_WRITERS)


def read_cloud(path: str | Path) -> Cloud:
    """Read a point cloud; a mesh file gives its vertices.

    Returns:
        The cloud; rows that are not finite are still there.

    Raises:
        InputError: Missing or empty file, unknown extension, or content that does not fit the extension.
    """
    path = Path(path)
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a folder; give a point cloud file")
        if not path.exists():
            raise InputError(f"{path}: no such file")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        hint = suggest(path.suffix.lower(), list(_READERS)).split(" Known")[0]
        raise InputError(
            f"{path}: unknown file type {path.suffix or 'without extension'!r};{hint} readable: {', '.join(_READERS)}"
        )
    try:
        if path.stat().st_size == 0:
            raise InputError(f"{path}: the file is empty")
        cloud = reader(path)
    except N2NError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except Exception as error:
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        raise InputError(
            f"{path}: is not a readable {path.suffix[1:]} file ({reason}); check or re-export it"
        ) from error
    if not len(cloud):
        raise InputError(f"{path}: holds no points")
    return cloud


def write_cloud(path: str | Path, cloud: Cloud) -> None:
    """Write a cloud in the format of the extension; the file appears whole or not at all.

    Warns:
        UserWarning: The format has no place for attributes that are texts.

    Raises:
        OutputError: Unknown extension, or writing failed.
    """
    path = Path(path)
    writer = _WRITERS.get(path.suffix.lower())
    if writer is None:
        raise OutputError(f"{path}: unknown file type {path.suffix!r}; choose one of: {', '.join(_WRITERS)}")
    with atomic_path(path) as temporary:
        writer(temporary, cloud)
    texts = [name for name, values in cloud.attributes.items() if np.asarray(values).dtype.kind == "U"]
    if texts and path.suffix.lower() not in _HOLD_TEXTS:
        warnings.warn(
            f"{path.suffix[1:]} cannot store texts: {', '.join(texts)} left out; write csv or npz to keep them",
            stacklevel=2,
        )
