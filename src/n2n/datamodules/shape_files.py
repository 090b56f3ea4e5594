"""Shapes and references in files: a file with faces is a mesh, any other a cloud."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from n2n.errors import InputError
from n2n.formats import Cloud, read_cloud
from n2n.geometry.reference import Reference

_MESHES = (".ply", ".off", ".obj", ".stl")
_NORMALS = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))


def read_shape(path: str | Path) -> Cloud | trimesh.Trimesh:
    """Read a mesh, where the file has faces, or a cloud.

    Raises:
        InputError: Unreadable, cut off, or rows that are not finite.
    """
    path = Path(path)
    cloud = read_cloud(path)
    if count := int(np.count_nonzero(~cloud.finite())):
        raise InputError(f"{path}: {count:,} of {len(cloud):,} rows are NaN or infinite; take them out first")
    if path.suffix.lower() not in _MESHES or not (promised := _promised_faces(path)):
        return cloud
    try:
        mesh = trimesh.load(path, process=False, force="mesh")
    except Exception as error:
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        raise InputError(f"{path}: its faces cannot be read ({reason}); check or re-export it") from error
    faces = np.asarray(getattr(mesh, "faces", ()))
    # Polygons become several triangles, never fewer.
    if len(faces) < promised:
        raise InputError(f"{path}: promises {promised:,} faces, {len(faces):,} could be read; it is cut off or damaged")
    if faces.min() < 0 or faces.max() >= len(mesh.vertices):
        raise InputError(f"{path}: its faces name vertices that are not there; check or re-export it")
    if path.suffix.lower() == ".stl":
        mesh.merge_vertices()  # the format has no shared ones
    return mesh


def read_reference(paths: Sequence[str | Path]) -> Reference:
    """Read a clean cloud, a mesh, or both from two files.

    Raises:
        InputError: Two clouds, two meshes, more than two files; or as for `read_shape`.
    """
    clouds, meshes = [], []
    for path in paths:
        shape = read_shape(path)
        (meshes if isinstance(shape, trimesh.Trimesh) else clouds).append((path, shape))
    for kind, found in (("clouds", clouds), ("meshes", meshes)):
        if len(found) > 1:
            raise InputError(
                f"{found[0][0]} and {found[1][0]} are both {kind}; give one clean cloud, one mesh or one of each"
            )
    cloud = clouds[0][1] if clouds else None
    mesh = meshes[0][1] if meshes else None
    return Reference(
        points=None if cloud is None else cloud.points,
        normals=None if cloud is None else normals_of(cloud),
        vertices=None if mesh is None else np.asarray(mesh.vertices, np.float64),
        faces=None if mesh is None else np.asarray(mesh.faces, np.int64),
    )


def normals_of(cloud: Cloud) -> NDArray[np.float64] | None:
    """Return the normals (n, 3) a cloud was stored with, under one of the usual names."""
    whole = cloud.attributes.get("normals")
    if whole is not None and np.shape(whole) == (len(cloud), 3):
        return np.asarray(whole, np.float64)
    for names in _NORMALS:
        if all(name in cloud.attributes for name in names):
            return np.column_stack([np.asarray(cloud.attributes[name], np.float64) for name in names])
    return None


def _promised_faces(path: Path) -> int:
    """Return how many faces the file announces; 0 for a cloud."""
    kind = path.suffix.lower()
    if kind == ".stl":
        return 1
    if kind == ".ply":
        with path.open("rb") as file:
            for line in file:
                words = line.split()
                if words[:2] == [b"element", b"face"]:
                    return int(words[2])
                if words[:1] == [b"end_header"]:
                    break
        return 0
    lines = (line.split("#")[0].split() for line in path.read_text(errors="replace").splitlines())
    if kind == ".obj":
        return sum(words[:1] == ["f"] for words in lines)
    rows = (row for row in lines if row)
    first = next(rows)
    return int((first[1:] or next(rows))[1])
