"""NumPy arrays: .npy with (n, >= 3) columns, .npz with a points array and further arrays per point."""

import zipfile
from pathlib import Path

import numpy as np

from n2n.errors import InputError
from n2n.formats.cloud import Cloud

_POINT_KEYS = ("points", "pos", "xyz", "noisy", "vertices")


def read_npy(path: Path) -> Cloud:
    """Read an (n, >= 3) array; columns after the third become attributes."""
    if path.read_bytes()[:6] != b"\x93NUMPY":
        raise InputError(f"{path}: is no .npy array; check or re-save it with numpy.save")
    array = np.load(path, allow_pickle=False)
    if array.ndim != 2 or array.shape[1] < 3 or not np.issubdtype(array.dtype, np.number):
        raise InputError(f"{path}: expected numbers of shape (n, 3 or more), got {array.dtype} {array.shape}")
    return Cloud(array[:, :3].astype(np.float64), {f"column{i}": array[:, i] for i in range(3, array.shape[1])})


def read_npz(path: Path) -> Cloud:
    """Read the array called points, pos, xyz, noisy or vertices, or the only (n, 3) one; the rest are attributes."""
    if not zipfile.is_zipfile(path):
        raise InputError(f"{path}: is no .npz archive, or cut off; check or re-save it with numpy.savez")
    with np.load(path, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    fitting = [name for name, a in arrays.items() if a.ndim == 2 and a.shape[1] == 3]
    key = next((name for name in _POINT_KEYS if name in fitting), fitting[0] if len(fitting) == 1 else None)
    if key is None:
        shapes = ", ".join(f"{name} {a.shape}" for name, a in arrays.items()) or "nothing"
        raise InputError(f"{path}: no array named {', '.join(_POINT_KEYS)} of shape (n, 3); it holds {shapes}")
    points = arrays.pop(key).astype(np.float64)
    attributes = {}
    for name, values in arrays.items():
        if values.ndim and len(values) == len(points) and values.ndim <= 2:
            attributes[name] = values
    return Cloud(points, attributes, {"npz_key": key})


def write_npy(path: Path, cloud: Cloud) -> None:
    """Write (n, 3 + attribute columns) float64."""
    with path.open("wb") as file:
        np.save(file, np.column_stack([cloud.points, *cloud.columns().values()]).astype(np.float64))


def write_npz(path: Path, cloud: Cloud) -> None:
    """Write the points under the name they were read with, attributes under theirs."""
    key = cloud.meta.get("npz_key", "points")
    with path.open("wb") as file:
        np.savez_compressed(file, **{key: cloud.points, **cloud.attributes})
