"""The signed distance in three plane cuts, with level lines, beside the surface."""

import numpy as np
import trimesh
from matplotlib.colors import TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from n2n.report.camera import Camera
from n2n.report.figures.request import Request, Subject
from n2n.report.figures.slices import Slice, draw_truth, draw_zero
from n2n.report.figures.style import INK, SIGNED, SURFACE, mesh_image, place, sheet
from n2n.tasks.field import Field

_LINES = 14
_SAMPLES = 240
_TITLE, _GAP, _BAR, _BELOW = 34, 14, 92, 14
_AXES = "xyz"


def draw(request: Request) -> Figure:
    """Draw cuts across z, y and x through the middle, and the zero level set as a surface."""
    subject = request.subject()
    field = request.fit(subject)
    return level_sets(field, subject, field.reconstruct(request.resolution), request.size)


def level_sets(field: Field, subject: Subject, mesh: trimesh.Trimesh, size: int) -> Figure:
    """Draw the same of a field that is there; `size` is the longer side of the surface's picture in pixels."""
    cuts = [Slice.through(np.asarray(mesh.vertices), axis) for axis in (2, 1, 0)]
    values = [cut.values(field, _SAMPLES) for cut in cuts]
    height = round(0.8 * size)
    widths = [round(height * cut.aspect) for cut in cuts]
    picture = mesh_image(
        mesh.vertices, mesh.faces, SURFACE, Camera.around(np.asarray(mesh.vertices), up=subject.up), size
    )
    shown = round(height * picture.shape[1] / picture.shape[0])
    figure = sheet(sum(widths) + shown + 4 * _GAP + _BAR, height + _TITLE + _BELOW)
    lowest, highest = min(v.min() for *_, v in values), max(v.max() for *_, v in values)
    colours = TwoSlopeNorm(0.0, min(lowest, -1e-9), max(highest, 1e-9))
    levels = MaxNLocator(_LINES).tick_values(lowest, highest)

    axes = place(figure, 0, _TITLE, shown, height)
    axes.imshow(picture, interpolation="antialiased")
    axes.axis("off")
    axes.set_title("zero level set", fontsize=12, color=INK)
    left = shown + _GAP
    for cut, width, (x, y, f) in zip(cuts, widths, values, strict=True):
        axes = place(figure, left, _TITLE, width, height)
        image = axes.pcolormesh(x, y, f, cmap=SIGNED, norm=colours, shading="gouraud", rasterized=True)
        axes.contour(x, y, f, levels=levels[levels != 0], colors=[INK], linewidths=0.5, alpha=0.6, linestyles="solid")
        draw_zero(axes, x, y, f)
        if subject.vertices is not None:
            draw_truth(axes, cut.cut(subject.vertices, subject.faces))
        cut.prepare(axes)
        axes.set_title(f"cut across {_AXES[cut.axis]}", fontsize=12, color=INK)
        left += width + _GAP
    shown_levels = levels[(levels >= lowest) & (levels <= highest)]
    bar = figure.colorbar(
        image, cax=place(figure, left, _TITLE, 14, height), ticks=shown_levels, spacing="proportional"
    )
    bar.set_label(f"signed distance  [{subject.unit}]", fontsize=10, color=INK)
    bar.ax.tick_params(labelsize=9, colors=INK)
    bar.outline.set_visible(False)
    return figure
