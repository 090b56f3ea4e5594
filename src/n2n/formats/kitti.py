"""KITTI velodyne scans: little-endian float32 rows x y z reflectance."""

from pathlib import Path

import numpy as np

from n2n.errors import InputError
from n2n.formats.cloud import Cloud

# Metres: the largest coordinate of a scan lies between a millimetre and 1000 km; text read as floats is near zero.
_LEAST, _MOST = 1e-3, 1e6


def read(path: Path) -> Cloud:
    """Read a scan."""
    size = path.stat().st_size
    if size % 16:
        raise InputError(
            f"{path}: {size} bytes are no whole number of 16-byte KITTI points (x y z reflectance, float32)"
        )
    rows = np.fromfile(path, "<f4").reshape(-1, 4)
    finite = rows[:, :3][np.isfinite(rows[:, :3])]
    if not _LEAST < np.abs(finite).max(initial=0) < _MOST:
        raise InputError(
            f"{path}: the bytes are no KITTI points (all at the origin, or beyond 1000 km); is it another kind of .bin?"
        )
    return Cloud(rows[:, :3].astype(np.float64), {"reflectance": rows[:, 3].copy()})
