"""Pictures and 3D models of a finished fit: drawn once into the run folder, then shown by whatever logger is in use."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from n2n.evaluation.runs import noisy_points
from n2n.formats import atomic_path, write_mesh
from n2n.formats.atomic import make_folder
from n2n.metrics.nearest import nearest
from n2n.metrics.point_mesh import distances_to_mesh
from n2n.report.figures.errors import upper
from n2n.report.figures.level_sets import level_sets
from n2n.report.figures.request import Subject
from n2n.report.figures.style import Scale, save
from n2n.report.preview import up_axis
from n2n.tasks.field import Field

FOLDER = "media"
_RESOLUTION = 96  # voxels along the longest side
_POINTS = 20_000
_SIZE = 360  # pixels
_COLOURS = 256  # of the picture: a page holds hundreds


@dataclass
class Media:
    """What there is to see of a field; of several shapes the first.

    Attributes:
        picture: File of the level sets in three cuts.
        model: File of the mesh.
        mesh: The surface; like the points in world units, but with the shape's centre at the origin: viewers compute in
            single precision.
        points: Denoised points, (n, 3), n <= 20 000.
        error: Their distances (n,) to the true surface, world units; None where it is not known.
    """

    picture: Path
    model: Path
    mesh: trimesh.Trimesh
    points: NDArray[np.float64]
    error: NDArray[np.float64] | None

    @property
    def colours(self) -> NDArray[np.uint8]:
        """Colours of the points, (n, 3): by error, else all alike."""
        error = np.zeros(len(self.points)) if self.error is None else self.error
        return np.round(255 * Scale(upper(error), "")(error)).astype(np.uint8)


def draw_media(field: Field, data: Any, run_dir: Path) -> Media:
    """Write media/level_sets.png, media/mesh.glb and media/points.npz into a run folder.

    Raises:
        SurfaceError: The field has no surface to show.
        OutputError: The folder cannot be written.
    """
    folder = run_dir / FOLDER
    mesh = field.reconstruct(_RESOLUTION)
    make_folder(folder)
    noisy, reference = noisy_points(data), getattr(data, "reference", None)
    truth = (reference.vertices, reference.faces) if reference else (None, None)
    subject = Subject(run_dir.name, "units of the data", noisy, *truth, up=up_axis(noisy))
    save(folder / "level_sets.png", level_sets(field, subject, mesh, _SIZE), _COLOURS)

    some = np.random.default_rng(0).permutation(len(noisy))[:_POINTS]
    points = field.denoise(noisy[np.sort(some)])
    error = _errors(points, reference)
    centre = np.asarray(field.frames[0].centre)
    points, mesh.vertices = points - centre, mesh.vertices - centre
    write_mesh(folder / "mesh.glb", mesh)
    arrays = {"points": points.astype(np.float32), "centre": centre}
    if error is not None:
        arrays["error"] = error.astype(np.float32)
    with atomic_path(folder / "points.npz") as temporary:
        np.savez_compressed(temporary, **arrays)
    return Media(folder / "level_sets.png", folder / "mesh.glb", mesh, points, error)


def _errors(points: NDArray[np.float64], reference: Any) -> NDArray[np.float64] | None:
    if reference is None:
        return None
    if reference.vertices is not None:
        return distances_to_mesh(points, reference.vertices, reference.faces)
    return None if reference.points is None else nearest(points, reference.points)[0]
