"""Kinds and amounts of noise: what comes in and what comes out."""

import numpy as np
from matplotlib.figure import Figure

from n2n.geometry.noise import NOISE_MODELS
from n2n.report.camera import Camera
from n2n.report.figures.errors import summary, surface_errors, upper
from n2n.report.figures.request import Request, Subject
from n2n.report.figures.style import NOISY, Panel, Scale, cloud_image, gallery, mesh_image

_AMOUNTS = (0.02, 0.04, 0.06, 0.08, 0.10)
_PANEL = 0.6  # of the request's size: these figures have many panels
_TITLES = {"gaussian": "Gaussian", "laplace": "Laplace", "range": "range (along the ray)", "outliers": "5 % outliers"}


def kinds(request: Request) -> Figure:
    """Draw scan and surface for every model of noise, all of the same standard deviation."""
    subjects = {_TITLES.get(model, model): request.subject(model=model) for model in NOISE_MODELS}
    return _columns(request, subjects)


def amounts(request: Request) -> Figure:
    """Draw scan and surface for Gaussian noise of 2 to 10 % of the bounding radius."""
    return _columns(request, {f"{100 * amount:g} %": request.subject(noise=amount) for amount in _AMOUNTS})


def _columns(request: Request, subjects: dict[str, Subject]) -> Figure:
    # The noisiest scan needs the widest view.
    widest = max(subjects.values(), key=_spread)
    size, camera = round(_PANEL * request.size), Camera.around(widest.noisy, up=widest.up)
    scans, meshes, errors = [], [], []
    for number, (title, subject) in enumerate(subjects.items(), 1):
        scans.append(Panel(cloud_image(subject.noisy, NOISY, camera, size)))
        field = request.fit(subject, f"fitting {number} of {len(subjects)}: {title}")
        meshes.append(field.reconstruct(request.resolution))
        errors.append(surface_errors(meshes[-1].vertices, subject))
    # One surface that goes wrong does not take the colour off all others.
    scale = Scale(
        float(np.median([upper(error) for error in errors])), f"distance to the true surface\n[{subject.unit}]"
    )
    surfaces = [
        Panel(mesh_image(mesh.vertices, mesh.faces, scale(error), camera, size), summary(error, subject).split(",")[0])
        for mesh, error in zip(meshes, errors, strict=True)
    ]
    return gallery([scans, surfaces], list(subjects), ["noisy", "surface"], scale)


def _spread(subject: Subject) -> float:
    """Return how far points reach, but for the 1 % farthest: these may be outliers."""
    return float(np.quantile(np.linalg.norm(subject.noisy - np.median(subject.noisy, axis=0), axis=1), 0.99))
