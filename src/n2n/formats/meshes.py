"""Meshes through trimesh: vertices as a cloud in, triangle meshes out."""

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from n2n.errors import InputError, OutputError
from n2n.formats import ply
from n2n.formats.atomic import atomic_path
from n2n.formats.cloud import Cloud

if TYPE_CHECKING:
    import trimesh

MESH_EXTENSIONS_WRITE = (".ply", ".obj", ".off", ".stl", ".glb")
_SINGLE_PRECISION = (".stl", ".glb")
_VISIBLE_LOSS = 1e-4  # of the extent


def read_vertices(path: Path) -> Cloud:
    """Read the vertices of an off, obj or stl file as a cloud."""
    import trimesh

    if path.suffix.lower() == ".off":
        return Cloud(_off_vertices(path))
    if path.suffix.lower() == ".obj":
        return Cloud(_obj_vertices(path))
    mesh = trimesh.load(path, process=False, force="mesh")
    if not len(mesh.vertices):
        raise InputError(f"{path}: holds no triangles, is cut off or is no STL file; check or re-export it")
    return Cloud(np.unique(np.asarray(mesh.vertices, np.float64), axis=0))


def _off_vertices(path: Path) -> np.ndarray:
    """Read the vertex lines only: OFF files of point clouds have no faces, which mesh libraries refuse."""
    words = (line.split("#")[0].split() for line in path.read_text(errors="replace").splitlines())
    rows = [row for row in words if row]
    if not rows or not rows[0][0].upper().endswith("OFF"):
        raise InputError(f"{path}: does not start with OFF, so it is no OFF file; check or re-export it")
    header = rows[0][1:]
    body = rows[1:]
    if not header:
        header, body = body[0], body[1:]
    count = int(header[0])
    if len(body) < count:
        raise InputError(f"{path}: the header promises {count} vertices, the file holds {len(body)}; it is cut off")
    return _positions(body[:count], path)


def _obj_vertices(path: Path) -> np.ndarray:
    words = (line.split() for line in path.read_text(errors="replace").splitlines())
    rows = [row[1:] for row in words if row and row[0] == "v"]
    if not rows:
        raise InputError(f"{path}: holds no vertices (no line starts with 'v ')")
    return _positions(rows, path)


def _positions(rows: list[list[str]], path: Path) -> np.ndarray:
    if any(len(row) < 3 for row in rows):
        raise InputError(f"{path}: has vertices of fewer than three coordinates; check or re-export it")
    return np.array([row[:3] for row in rows], np.float64).reshape(-1, 3)


def write_mesh(path: str | Path, mesh: "trimesh.Trimesh") -> None:
    """Write a triangle mesh; coordinates in full precision where the format has it (ply, obj, off).

    Warns:
        UserWarning: The format is single precision and the coordinates are too far from the origin for it.

    Raises:
        OutputError: Unknown extension, or writing failed.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in MESH_EXTENSIONS_WRITE:
        raise OutputError(f"{path}: unknown mesh type {kind!r}; choose one of: {', '.join(MESH_EXTENSIONS_WRITE)}")
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)
    if kind in _SINGLE_PRECISION:
        loss = np.abs(vertices - vertices.astype(np.float32)).max(initial=0)
        if loss > _VISIBLE_LOSS * np.ptp(vertices, axis=0).max(initial=0):
            warnings.warn(
                f"{path.name}: {kind[1:]} stores 32-bit coordinates, which moves vertices by up to {loss:.2g} here; "
                "write ply or obj to keep them",
                stacklevel=2,
            )
    with atomic_path(path) as temporary:
        if kind == ".ply":
            _write_ply(temporary, vertices, faces)
        elif kind in (".obj", ".off"):
            _write_text(temporary, vertices, faces, kind)
        else:
            temporary.write_bytes(mesh.export(file_type=kind[1:]))


def _write_ply(path: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    """Write binary PLY with float64 vertices (trimesh writes float32)."""
    ply.write(path, Cloud(vertices))
    content = path.read_bytes()
    head, body = content.split(b"end_header\n", 1)
    table = np.empty(len(faces), np.dtype([("count", "u1"), ("index", "<i4", (3,))]))
    table["count"], table["index"] = 3, faces
    element = f"element face {len(faces)}\nproperty list uchar int vertex_indices\n".encode()
    path.write_bytes(head + element + b"end_header\n" + body + table.tobytes())


def _write_text(path: Path, vertices: np.ndarray, faces: np.ndarray, kind: str) -> None:
    with path.open("w") as file:
        if kind == ".off":
            file.write(f"OFF\n{len(vertices)} {len(faces)} 0\n")
            np.savetxt(file, vertices, fmt="%.14g")
            np.savetxt(file, np.insert(faces, 0, 3, axis=1), fmt="%d")
        else:
            np.savetxt(file, vertices, fmt="v %.14g %.14g %.14g")
            np.savetxt(file, faces + 1, fmt="f %d %d %d")
