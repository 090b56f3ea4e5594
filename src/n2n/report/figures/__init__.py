"""The figures of the paper, drawn from fits of one's own: `n2n figure NAME -o FILE.png`."""

from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from n2n.errors import ConfigError
from n2n.registry import suggest


class Figure(NamedTuple):
    """Where a figure is drawn, what it shows, and what it draws unless told otherwise.

    Attributes:
        path: `module:function`; the function takes a `Request` and returns a matplotlib figure.
        summary: One line.
        defaults: Settings of the request that differ from the usual ones.
        own_scan: Whether it can be drawn of a scan without a truth.
    """

    path: str
    summary: str
    defaults: dict[str, Any] = {}  # noqa: RUF012 (never changed)
    own_scan: bool = True


FIGURES = {
    "optimisation": Figure(
        "n2n.report.figures.optimisation:draw",
        "a slice during the fit: zero level set, three queries, their targets",
        {"shape": "torus", "noise": 0.03},
    ),
    "level_sets": Figure("n2n.report.figures.level_sets:draw", "slices of the signed distance with level lines"),
    "denoising": Figure("n2n.report.figures.errors:denoising", "noisy and denoised points, coloured by error"),
    "reconstruction": Figure("n2n.report.figures.errors:reconstruction", "the surface, coloured by error"),
    "noise_types": Figure(
        "n2n.report.figures.noise:kinds", "every model of noise: scan and surface", {"noise": 0.015}, own_scan=False
    ),
    "large_noise": Figure(
        "n2n.report.figures.noise:amounts",
        "noise of 2 to 10 % of the radius: scan and surface",
        {"shape": "torus"},
        own_scan=False,
    ),
    "distances": Figure(
        "n2n.report.figures.distances:draw", "Chamfer distance against earth mover's distance", {"noise": 0.02}
    ),
}


def draw_figure(name: str, path: Path, settings: list[str], progress: Any = None) -> None:
    """Draw a figure and write it as a PNG.

    Args:
        name: One of `FIGURES`.
        path: Output file.
        settings: `key=value`; what is no setting of the figure is one of the fit.
        progress: Label -> context manager that yields a fit's `report`; None is silent.

    Raises:
        ConfigError: Unknown figure or setting.
        InputError: The shape or scan cannot be used.
    """
    from n2n.report.figures.request import read_request, silent
    from n2n.report.figures.style import save

    figure = find(name)
    request = read_request(name, figure, settings, progress or silent)
    module, _, function = figure.path.partition(":")
    save(path, getattr(import_module(module), function)(request))


def find(name: str) -> Figure:
    """Return a figure by name.

    Raises:
        ConfigError: Unknown; names the nearest.
    """
    if name not in FIGURES:
        raise ConfigError(f"Unknown figure {name!r}.{suggest(name, list(FIGURES))}")
    return FIGURES[name]
