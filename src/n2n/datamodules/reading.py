"""Read the scans and truths of benchmarks; what does not fit its layout is one line. Imports no torch."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from n2n.datamodules.layouts import Scan
from n2n.datamodules.registration import extent, is_moved, middle, positions, same_frame, similarity
from n2n.errors import InputError, N2NError
from n2n.formats import read_cloud
from n2n.geometry.checks import check_cloud
from n2n.geometry.reference import Reference

_MESHES = (".ply", ".obj", ".off")


def read_scan(scan: Scan) -> tuple[NDArray[np.float64], Reference]:
    """Read a scan and its truth.

    Returns:
        The points, (n, 3) world coordinates; what is known of the surface, in the same coordinates.

    Raises:
        InputError: A file is missing, unreadable or not what the layout says, or the two are not in one frame.
    """
    try:
        if scan.is_mesh:
            reference = read_truth(scan.path)
            if reference.vertices is None:
                raise InputError(f"{scan.path}: holds no triangles")
            return reference.vertices, reference
        points = read_points(scan.path, scan.columns, scan.count)
        if scan.largest is not None and not extent(points) < scan.largest:
            raise InputError(f"{scan.path}: the longest edge is {extent(points):.3g}, not below {scan.largest}")
        reference = Reference() if scan.truth is None else read_truth(scan.truth)
    except N2NError as error:
        raise InputError(f"{error}; expected {scan.layout}") from error
    if scan.in_unit_box and not same_frame(points, reference):
        points = _out_of_unit_box(points, reference)
    if not same_frame(points, reference):
        raise InputError(
            f"{scan.path}: does not lie where its truth {scan.truth} lies (longest edges {extent(points):.3g} and "
            f"{extent(positions(reference)):.3g}); expected both in one frame, {scan.layout}"
        )
    if scan.truth is not None:
        _check_registered(scan, points, reference)
    return points, reference


def _check_registered(scan: Scan, points: NDArray[np.float64], reference: Reference) -> None:
    """Refuse a pair that another frame of the scan would fit much better: every error would measure that."""
    fit = similarity(points, reference)
    if is_moved(fit, reference):
        raise InputError(
            f"{scan.path}: is not in the frame of its truth {scan.truth}: the median distance is {fit.before:.2g}, and "
            f"{fit.after:.2g} after scaling by {fit.scale:.3f} and moving by {fit.shift:.2g}; expected both in one "
            f"frame, {scan.layout}"
        )


def read_points(path: Path, columns: int | None = None, count: int | None = None) -> NDArray[np.float64]:
    """Read the coordinates of a scan that a surface can be fitted to; normals and other attributes are left aside.

    Args:
        path: Any cloud, or a mesh: its vertices.
        columns: How many numbers each point must have.
        count: How many points there must be.
    """
    cloud = read_cloud(path)
    found = 3 + sum(1 if values.ndim == 1 else values.shape[1] for values in cloud.attributes.values())
    if columns is not None and found != columns:
        raise InputError(f"{path}: the points have {found} columns, not {columns}")
    if count is not None and len(cloud) != count:
        raise InputError(f"{path}: holds {len(cloud)} points, not {count}")
    return check_cloud(cloud.points[cloud.finite()], str(path))


def read_truth(path: Path) -> Reference:
    """Read a mesh, or a cloud with its normals if it has them."""
    cloud = read_cloud(path)
    if not cloud.finite().all():
        raise InputError(f"{path}: {int((~cloud.finite()).sum())} points are NaN or infinite")
    if path.suffix.lower() in _MESHES:
        vertices, faces = _triangles(path)
        if len(faces):
            return Reference(vertices=vertices, faces=faces)
    normals = [cloud.attributes.get(name) for name in ("nx", "ny", "nz")]
    if any(values is None for values in normals):
        return Reference(points=cloud.points)
    return Reference(points=cloud.points, normals=_unit(np.stack(normals, axis=1).astype(np.float64)))


def _out_of_unit_box(points: NDArray[np.float64], reference: Reference) -> NDArray[np.float64]:
    """Undo a normalisation by the truth's box, as the evaluation of the benchmark does.

    Source: CAP-UDF, evaluation/3dscene/eval_mesh.py.
    """
    truth = positions(reference)
    return points * extent(truth) + middle(truth)


def _triangles(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    import trimesh

    try:
        mesh = trimesh.load(path, process=False)
    except Exception as error:
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        raise InputError(f"{path}: is not a readable mesh ({reason})") from error
    vertices = np.asarray(getattr(mesh, "vertices", np.empty((0, 3))), np.float64)
    faces = np.asarray(getattr(mesh, "faces", np.empty((0, 3))), np.int64).reshape(-1, 3)
    if len(faces) and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise InputError(f"{path}: has faces of vertices that do not exist; it is cut off or damaged")
    return vertices, faces


def _unit(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.maximum(lengths, np.finfo(float).tiny)
