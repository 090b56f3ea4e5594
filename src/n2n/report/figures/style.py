"""How all figures look: colours, lettering, panels in rows and columns, one colour bar."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import PIL.Image
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from n2n.formats import atomic_path
from n2n.report.camera import Camera
from n2n.report.scene import Spheres, Surface, render

Image = NDArray[np.uint8]
Pixels = int | float

INK, FAINT = "#2b2f36", "#8a919c"
NOISY = np.array([0.80, 0.36, 0.22])
SURFACE = np.array([0.66, 0.74, 0.82])
# Grey-blue like the plain surface where all is well, then yellow, red, dark.
ERROR = LinearSegmentedColormap.from_list(
    "error", [(0.0, "#b9cbdc"), (0.22, "#e9dfa0"), (0.5, "#f0a03c"), (0.78, "#cf3a24"), (1.0, "#6b0f1a")]
)
# Inside blue, outside sand; the surface is the white between them.
SIGNED = LinearSegmentedColormap.from_list("signed", ["#274f7d", "#86abcc", "#ffffff", "#e6c58f", "#a5681f"])
QUERIES = ("#1b7f5c", "#7b4fa3", "#c4487a")

_DPI = 100
_TITLE, _CAPTION, _BAR, _SIDE, _GAP = 34, 24, 128, 30, 8  # pixels
_BALL = 0.42  # radius of a point's ball; times the picture's extent / sqrt(points)


class Panel(NamedTuple):
    """A picture and the line below it."""

    image: Image
    caption: str = ""


class Scale(NamedTuple):
    """What colours mean: 0 to `highest`, in the unit of `label`."""

    highest: float
    label: str
    colours: Colormap = ERROR

    def __call__(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return colours (n, 3) of values (n,)."""
        return self.colours(Normalize(0, self.highest)(values))[:, :3]


def cloud_image(points: NDArray[np.float64], colour: NDArray[np.float64], camera: Camera, size: int) -> Image:
    """Draw points (n, 3); `colour` is one (3,) or one for each (n, 3)."""
    radius = _BALL * max(camera.extent) / np.sqrt(len(points))
    return render([Spheres(points, colour, radius)], camera, size)


def mesh_image(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], colour: NDArray[np.float64], camera: Camera, size: int
) -> Image:
    """Draw a mesh; `colour` is one (3,) or one for each vertex (v, 3)."""
    return render([Surface(np.asarray(vertices, np.float64), np.asarray(faces, np.int64), colour)], camera, size)


def sheet(width: int, height: int) -> Figure:
    """Return an empty white figure of so many pixels, drawn without a display."""
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def gallery(
    rows: Sequence[Sequence[Panel | None]],
    titles: Sequence[str],
    sides: Sequence[str] = (),
    scale: Scale | None = None,
) -> Figure:
    """Arrange pictures of one size.

    Args:
        rows: Panels; None stays empty.
        titles: One for each column.
        sides: One for each row, written upwards at its left.
        scale: Gets a colour bar at the right.
    """
    height, width = next(panel for row in rows for panel in row if panel).image.shape[:2]
    left = _SIDE if sides else 0
    caption = _CAPTION if any(panel and panel.caption for row in rows for panel in row) else 0
    full_width = left + len(titles) * (width + _GAP) + (_BAR if scale else 0)
    full_height = _TITLE + len(rows) * (height + caption + _GAP)
    figure = sheet(full_width, full_height)
    for column, title in enumerate(titles):
        middle = left + column * (width + _GAP) + width / 2
        _write(figure, middle, _TITLE / 2, title, 12, INK)
        for number, row in enumerate(rows):
            top = _TITLE + number * (height + caption + _GAP)
            if column < len(row) and row[column]:
                axes = place(figure, middle - width / 2, top, width, height)
                axes.imshow(row[column].image, interpolation="none")
                axes.axis("off")
                _write(figure, middle, top + height + caption / 2, row[column].caption, 10, FAINT)
    for number, side in enumerate(sides):
        middle = _TITLE + number * (height + caption + _GAP) + height / 2
        _write(figure, left / 2, middle, side, 12, INK, rotation=90)
    if scale:
        bar = min(2 * height, full_height - 2 * _TITLE)
        colour_bar(figure, scale, full_width - _BAR + 8, (full_height - bar) / 2 + _TITLE / 2, bar)
    return figure


def place(figure: Figure, left: Pixels, top: Pixels, width: Pixels, height: Pixels) -> Axes:
    """Add axes at a place given in pixels from the upper left corner."""
    across, down = figure.get_size_inches() * _DPI
    return figure.add_axes((left / across, 1 - (top + height) / down, width / across, height / down))


def colour_bar(figure: Figure, scale: Scale, left: Pixels, top: Pixels, height: Pixels) -> None:
    """Add the bar that explains colours; what is off the scale has its last colour."""
    axes = place(figure, left, top, 14, height)
    bar = figure.colorbar(ScalarMappable(Normalize(0, scale.highest), scale.colours), cax=axes, extend="max")
    bar.set_label(scale.label, fontsize=10, color=INK)
    bar.ax.tick_params(labelsize=9, colors=INK)
    bar.outline.set_visible(False)


def save(path: Path, figure: Figure, colours: int | None = None) -> None:
    """Write a PNG, whole or not at all.

    Args:
        path: Of the file.
        figure: What to draw.
        colours: Most that the file has, up to 256: a third of its size, and read six times faster. None for all.
    """
    with atomic_path(path) as temporary:
        # The programs' versions would make equal figures differ.
        figure.savefig(temporary, format="png", metadata={"Software": None})
        if colours is not None:
            with PIL.Image.open(temporary) as image:
                few = image.convert("RGB").quantize(colours)
            few.save(temporary, "PNG")


def _write(figure: Figure, x: Pixels, y: Pixels, text: str, size: int, colour: str, rotation: int = 0) -> None:
    width, height = figure.get_size_inches() * _DPI
    figure.text(
        x / width, 1 - y / height, text, ha="center", va="center", fontsize=size, color=colour, rotation=rotation
    )
