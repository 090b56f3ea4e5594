"""Pictures, meshes and clouds of runs, made small enough for a page."""

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

PICTURE, MESH, POINTS = "level_sets.png", "mesh.glb", "points.npz"
_PICTURE_SIDE = 720  # pixels
_QUALITY, _EFFORT = 60, 1  # of WebP; more effort would take longer than all the rest of the page
_VERTICES = 8_000
_POINTS = 5_000
_STEPS = 65_535  # of a coordinate across the scene's box


def read_picture(folder: Path, problems: list[str]) -> str | None:
    """Return the picture of a folder, made smaller, as `data:image/webp;...`; None where there is none."""
    from PIL import Image, UnidentifiedImageError

    path = folder / PICTURE
    if not path.exists():
        return None
    try:
        with Image.open(path) as image:
            small = image.convert("RGB")
        small.thumbnail((_PICTURE_SIDE, _PICTURE_SIDE), Image.Resampling.HAMMING)
        packed = io.BytesIO()
        small.save(packed, "WEBP", quality=_QUALITY, method=_EFFORT)
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        problems.append(f"{path.name}: cannot be shown ({error})")
        return None
    return f"data:image/webp;base64,{base64.b64encode(packed.getvalue()).decode()}"


def read_scene(folder: Path, problems: list[str]) -> dict[str, Any] | None:
    """Return mesh.glb and points.npz of a folder for the page's 3D view; None where there is neither.

    Coordinates are 16-bit steps of the box `low`, `high`; arrays are base64 of little-endian numbers. `counts` says how
    much there was before anything was left out.
    """
    mesh = _read_mesh(folder / MESH, problems)
    cloud = _read_cloud(folder / POINTS, problems)
    everything = [part[0] for part in (mesh, cloud) if part is not None]
    if not everything:
        return None
    low = np.min([points.min(axis=0) for points in everything], axis=0)
    high = np.max([points.max(axis=0) for points in everything], axis=0)
    scene: dict[str, Any] = {"low": low.tolist(), "high": high.tolist(), "counts": {}}

    def packed(points: NDArray[np.float64]) -> str:
        steps = np.rint((points - low) / np.maximum(high - low, 1e-30) * _STEPS)
        return _encode(steps, "<u2")

    if mesh is not None:
        vertices, faces = simplify(*mesh, _VERTICES)
        scene["counts"]["faces"] = [len(faces), len(mesh[1])]
        scene |= {"vertices": packed(vertices), "faces": _encode(faces, "<u2")}
    if cloud is not None:
        points, error = cloud
        kept = np.random.default_rng(0).permutation(len(points))[:_POINTS]
        scene["counts"]["points"] = [len(kept), len(points)]
        scene["points"] = packed(points[kept])
        if error is not None and np.isfinite(error).any():
            # A few outliers would leave all others one colour.
            top = float(np.quantile(error[np.isfinite(error)], 0.98)) or 1.0
            scene["top"] = top
            scene["error"] = _encode(np.clip(np.nan_to_num(error[kept], nan=top) / top, 0, 1) * 255, "u1")
    return scene


def simplify(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Merge the vertices of every cell of a grid into their mean, with cells as small as `count` vertices allow.

    Args:
        vertices: (v, 3).
        faces: (f, 3).
        count: Most vertices of the result.
    """
    low, size = vertices.min(axis=0), max(float(np.ptp(vertices, axis=0).max()), 1e-30)
    cells = 1024
    while True:
        if len(vertices) <= count:
            return vertices, faces
        key = np.floor((vertices - low) / size * cells).astype(np.int64)
        flat = (key[:, 0] * (cells + 1) + key[:, 1]) * (cells + 1) + key[:, 2]
        _, group = np.unique(flat, return_inverse=True)
        total = int(group.max()) + 1
        if total <= count:
            break
        # The number of cells that a surface meets grows with the square of their number along an axis.
        cells = max(1, min(cells - 1, int(cells * (count / total) ** 0.5)))
    weight = np.bincount(group, minlength=total)
    merged = np.column_stack([np.bincount(group, vertices[:, axis], total) / weight for axis in range(3)])
    kept = group[faces]
    # Triangles within one cell are gone; two that became one are harmless.
    whole = (kept != np.roll(kept, 1, axis=1)).all(axis=1)
    return merged, kept[whole]


def _read_mesh(path: Path, problems: list[str]) -> tuple[NDArray[np.float64], NDArray[np.int64]] | None:
    import trimesh

    if not path.exists():
        return None
    try:
        mesh = trimesh.load(path, force="mesh", process=False)
        vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
        if not len(faces) or not np.isfinite(vertices).all():
            raise ValueError("no faces, or coordinates that are no numbers")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise ValueError("faces of vertices that are not there")
    except Exception as error:  # trimesh raises whatever its readers meet
        problems.append(f"{path.name}: cannot be shown ({_told(error)})")
        return None
    return vertices, faces


def _read_cloud(path: Path, problems: list[str]) -> tuple[NDArray[np.float64], NDArray[np.float64] | None] | None:
    if not path.exists():
        return None
    try:
        with np.load(path) as stored:
            points = np.asarray(stored["points"], np.float64)
            error = np.asarray(stored["error"], np.float64) if "error" in stored else None
        if points.ndim != 2 or points.shape[1] != 3 or not len(points) or not np.isfinite(points).all():
            raise ValueError("points must be finite and have 3 columns")
        if error is not None and error.shape != (len(points),):
            raise ValueError("error must have one number for each point")
    except Exception as error:  # a damaged archive raises whatever its parts do
        problems.append(f"{path.name}: cannot be shown ({_told(error)})")
        return None
    return points, error


def _told(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _encode(values: NDArray, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values.astype(kind)).tobytes()).decode()
