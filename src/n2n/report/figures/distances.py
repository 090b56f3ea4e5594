"""Chamfer distance against earth mover's distance, each without and with R: the same cloud, the same fit, another loss.

R is the geometric consistency of Eq. 6 with the paper's weight.
"""

from matplotlib.figure import Figure

from n2n.report.camera import Camera
from n2n.report.figures.errors import point_errors, summary, surface_errors, upper
from n2n.report.figures.request import Request
from n2n.report.figures.style import SURFACE, Panel, Scale, cloud_image, gallery, mesh_image

_DISTANCES = {"CD": "distance=cd", "EMD": "distance=emd_squared"}
_REGULARISERS = {"": ("regulariser=none",), " + R": ("regulariser=consistency", "regulariser_weight=0.1")}


def draw(request: Request) -> Figure:
    """Draw denoised points and surface under both distances, without and with R, beside the scan and the truth."""
    subject = request.subject()
    camera = Camera.around(subject.extent, up=subject.up)
    fields = {
        name + with_r: request.fit(subject, f"fitting with {name}{with_r}", distance, *regulariser)
        for name, distance in _DISTANCES.items()
        for with_r, regulariser in _REGULARISERS.items()
    }
    moved = [field.denoise(subject.noisy) for field in fields.values()]
    meshes = [field.reconstruct(request.resolution) for field in fields.values()]
    noise = point_errors(subject.noisy, subject, list(fields.values())[-1])
    errors = [point_errors(points, subject, field) for points, field in zip(moved, fields.values(), strict=True)]
    misses = [surface_errors(mesh.vertices, subject) for mesh in meshes]
    known = subject.vertices is not None
    scale = Scale(max(map(upper, errors)), f"distance to the {'true' if known else 'fitted'} surface\n[{subject.unit}]")

    def cloud(points, error):
        return Panel(cloud_image(points, scale(error), camera, request.size), summary(error, subject))

    # Without a truth a surface has no error.
    surfaces = [
        Panel(
            mesh_image(mesh.vertices, mesh.faces, scale(miss) if known else SURFACE, camera, request.size),
            summary(miss, subject) if known else "",
        )
        for mesh, miss in zip(meshes, misses, strict=True)
    ]
    truth = (
        Panel(mesh_image(subject.vertices, subject.faces, SURFACE, camera, request.size), "truth") if known else None
    )
    rows = [[cloud(subject.noisy, noise), *map(cloud, moved, errors)], [truth, *surfaces]]
    return gallery(rows, ["noisy", *fields], ["points", "surface"], scale)
