"""Points and surfaces coloured by their distance to the truth."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from n2n.metrics.nearest import nearest
from n2n.metrics.point_mesh import distances_to_mesh
from n2n.report.camera import Camera
from n2n.report.figures.request import Request, Subject
from n2n.report.figures.style import Panel, Scale, cloud_image, gallery, mesh_image
from n2n.tasks.field import Field


def denoising(request: Request) -> Figure:
    """Draw the noisy and the denoised points.

    Without a truth the distance to the fitted surface stands in for the error: it shows how far points are moved.
    """
    subject = request.subject()
    field = request.fit(subject)
    clean = field.denoise(subject.noisy)
    before, after = (point_errors(points, subject, field) for points in (subject.noisy, clean))
    scale = Scale(upper(before), f"{_what(subject)}\n[{subject.unit}]")
    camera = Camera.around(subject.extent, up=subject.up)
    panels = [
        Panel(cloud_image(points, scale(error), camera, request.size), summary(error, subject))
        for points, error in ((subject.noisy, before), (clean, after))
    ]
    return gallery([panels], ["noisy (do nothing)", "denoised"], scale=scale)


def reconstruction(request: Request) -> Figure:
    """Draw the noisy points and the surface, both coloured alike, and the true surface where there is one."""
    subject = request.subject()
    field = request.fit(subject)
    with request.progress("extracting the surface"):
        mesh = field.reconstruct(request.resolution)
    before, after = point_errors(subject.noisy, subject, field), surface_errors(mesh.vertices, subject)
    # The scale is the surface's own: next to the noise its errors would all look alike.
    scale = Scale(upper(after, 0.995), f"{_what(subject, surface=True)}\n[{subject.unit}]")
    camera = Camera.around(subject.extent, up=subject.up)
    noisy = Panel(cloud_image(subject.noisy, scale(before), camera, request.size), summary(before, subject))
    surface = mesh_image(mesh.vertices, mesh.faces, scale(after), camera, request.size)
    row, titles = [noisy, Panel(surface, summary(after, subject))], [f"{len(subject.noisy):,} noisy points", "surface"]
    if subject.vertices is not None:
        plain = np.broadcast_to(scale(np.zeros(1))[0], subject.vertices.shape)
        row.append(Panel(mesh_image(subject.vertices, subject.faces, plain, camera, request.size)))
        titles.append("truth")
    return gallery([row], titles, scale=scale)


def point_errors(points: NDArray[np.float64], subject: Subject, field: Field | None) -> NDArray[np.float64]:
    """Return distances (n,) to the true surface, or to the fitted one where the truth is not known."""
    if subject.vertices is None:
        return np.abs(field.sdf_at(points))
    return distances_to_mesh(points, subject.vertices, subject.faces)


def surface_errors(vertices: NDArray[np.float64], subject: Subject) -> NDArray[np.float64]:
    """Return distances (v,) to the true surface, or to the nearest point of the scan where it is not known."""
    vertices = np.asarray(vertices, np.float64)
    if subject.vertices is None:
        return nearest(vertices, subject.noisy)[0]
    return distances_to_mesh(vertices, subject.vertices, subject.faces)


def summary(errors: NDArray[np.float64], subject: Subject) -> str:
    """Return one line: root mean square and 95th percentile."""
    rms, high = np.sqrt((errors**2).mean()), np.quantile(errors, 0.95)
    unit = f" {subject.unit}" if len(subject.unit) < 4 else ""
    return f"rms {rms:.3g}{unit},  95 % below {high:.3g}{unit}"


def upper(errors: NDArray[np.float64], share: float = 0.98) -> float:
    """Return the end of a colour scale that a few large errors do not stretch; two digits."""
    value = max(float(np.quantile(errors, share)), 1e-12)
    step = 10 ** (np.floor(np.log10(value)) - 1)
    return float(np.ceil(value / step) * step)


def _what(subject: Subject, surface: bool = False) -> str:
    if subject.vertices is not None:
        return "distance to the true surface"
    return "distance to the nearest scan point" if surface else "distance to the fitted surface"
