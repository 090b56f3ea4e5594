"""Predictions in files, and what identifies a file."""

import hashlib
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from n2n.datamodules.shape_files import read_shape


def read_prediction(path: str | Path) -> NDArray[np.float64] | trimesh.Trimesh:
    """Read predicted points (n, 3) or a predicted mesh; see `read_shape`."""
    shape = read_shape(path)
    return shape if isinstance(shape, trimesh.Trimesh) else shape.points


def fingerprint(path: str | Path) -> dict[str, str | int]:
    """Return what identifies a file: name, size in bytes and SHA-256."""
    path = Path(path)
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return {"path": str(path), "bytes": path.stat().st_size, "sha256": digest}
