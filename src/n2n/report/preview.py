"""Before and after in one picture: noisy cloud, denoised cloud, mesh, from the same side."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from n2n.formats.atomic import atomic_path
from n2n.report.camera import Camera
from n2n.report.scene import Layer, Spheres, Surface, render

if TYPE_CHECKING:
    import trimesh

_NOISY = np.array([0.80, 0.36, 0.22])
_CLEAN = np.array([0.16, 0.42, 0.66])
_SURFACE = np.array([0.66, 0.74, 0.82])
_SIZE = 720
_WITH_LABEL = 1.07  # height of a panel with its label / without
_MAX_POINTS = 200_000
_BALL = 0.32  # radius of a point's ball; times the picture's extent / sqrt(points)


def draw_preview(
    path: Path,
    before: NDArray[np.float64] | None,
    after: NDArray[np.float64] | None,
    mesh: "trimesh.Trimesh | None",
    captions: tuple[str, str, str] | None = None,
    size: int = _SIZE,
) -> None:
    """Write a PNG with one panel for each thing given.

    Args:
        path: Output file.
        before: (n, 3) noisy points, or None.
        after: (m, 3) points on the surface, or None.
        mesh: The surface, or None.
        captions: For before, after and mesh; None counts what is shown.
        size: Pixels of a panel's side.
    """
    vertices = np.asarray(mesh.vertices) if mesh is not None else None
    everything = next(x for x in (after, vertices, before) if x is not None)
    camera = Camera.around(everything, up=up_axis(everything))
    labels = captions or (
        f"noisy: {0 if before is None else len(before):,} points",
        f"denoised: {0 if after is None else len(after):,} points",
        f"surface: {0 if mesh is None else len(mesh.faces):,} triangles",
    )
    panels: list[tuple[Layer, str]] = []
    for points, colour, label in ((before, _NOISY, labels[0]), (after, _CLEAN, labels[1])):
        if points is not None:
            shown = points[:: -(-len(points) // _MAX_POINTS)]
            radius = _BALL * max(camera.extent) / np.sqrt(len(shown))
            panels.append((Spheres(shown, colour, radius), label))
    if mesh is not None:
        panels.append((Surface(vertices, np.asarray(mesh.faces), _SURFACE), labels[2]))
    _save(path, [(render([layer], camera, size), label) for layer, label in panels])


def up_axis(points: NDArray[np.float64]) -> int:
    """Scans stand on z more often than not; flat ones lie on their thinnest axis."""
    extent = np.ptp(points, axis=0)
    thinnest = int(extent.argmin())
    return thinnest if extent[thinnest] < 0.5 * np.sort(extent)[1] else 2


def _save(path: Path, panels: list[tuple[NDArray[np.uint8], str]]) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    height, width = panels[0][0].shape[:2]
    figure = Figure(figsize=(width * len(panels) / 100, height * _WITH_LABEL / 100), dpi=100, facecolor="white")
    FigureCanvasAgg(figure)
    for index, (image, label) in enumerate(panels):
        axes = figure.add_axes((index / len(panels), 0.0, 1 / len(panels), 1 / _WITH_LABEL))
        axes.imshow(image, interpolation="none")
        axes.axis("off")
        figure.text((index + 0.5) / len(panels), 0.965, label, ha="center", va="center", fontsize=13, color="#333333")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png")
