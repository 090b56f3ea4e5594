"""What a figure is to be drawn of: settings, the shape with its truth or the user's scan, and the fit."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from n2n.compose import compose
from n2n.config import check_seed
from n2n.datamodules.clean_layouts import PU_SHAPES
from n2n.datamodules.generated import GeneratedDataModule
from n2n.datamodules.punet import PUDataModule
from n2n.errors import ConfigError
from n2n.formats import read_cloud
from n2n.geometry.checks import check_cloud
from n2n.geometry.shapes import SHAPES
from n2n.registry import suggest
from n2n.report.preview import up_axis
from n2n.tasks.api import fit_clouds

if TYPE_CHECKING:
    from n2n.report.figures import Figure
    from n2n.tasks.field import Field

Progress = Callable[[str], AbstractContextManager[Any]]
_LEAST = {"points": 100, "size": 50, "resolution": 8}
_UNITS = {"bracket": "mm", "torus": "outer radius = 0.95"}


@dataclass(frozen=True)
class Subject:
    """A noisy cloud and what is known of the true surface; world coordinates.

    Attributes:
        name: For titles.
        unit: Of lengths, for colour bars.
        noisy: (n, 3).
        vertices, faces: The true surface, (v, 3) and (f, 3); None for a scan of the user's own.
        up: Axis that points up, 0 to 2.
    """

    name: str
    unit: str
    noisy: NDArray[np.float64]
    vertices: NDArray[np.float64] | None = None
    faces: NDArray[np.int64] | None = None
    up: int = 2

    @property
    def extent(self) -> NDArray[np.float64]:
        """The points a picture must hold: the true surface, or the scan without it."""
        return self.noisy if self.vertices is None else self.vertices

    @cached_property
    def radius(self) -> float:
        """Bounding radius of the true surface, or of the scan without it."""
        low, high = self.extent.min(axis=0), self.extent.max(axis=0)
        return float(np.linalg.norm(self.extent - (low + high) / 2, axis=1).max())


@contextmanager
def silent(label: str) -> Iterator[None]:
    """Report nothing."""
    yield None


@dataclass(frozen=True)
class Request:
    """Settings of a figure.

    Attributes:
        shape: A generated shape, or one of the PU-Net test shapes where their data is present.
        scan: A file of the user's own instead.
        points: Of a scan of `shape`.
        noise: Its standard deviation relative to the bounding radius.
        seed: Of the scan and of the fit.
        size: Pixels of a panel's longer side.
        resolution: Voxels along the longest side of the surfaces that are shown.
        overrides: Settings of the fit.
        progress: Label -> context manager that yields a fit's `report`.
    """

    shape: str = "bracket"
    scan: str | None = None
    points: int = 10_000
    noise: float = 0.01
    seed: int = 0
    size: int = 480
    resolution: int = 128
    overrides: tuple[str, ...] = ()
    progress: Progress = field(default=silent)

    def subject(self, noise: float | None = None, model: str = "gaussian") -> Subject:
        """Return the scan; `noise` and `model` say what else than the request's own noise it has."""
        if self.scan:
            cloud = read_cloud(Path(self.scan))
            noisy = check_cloud(cloud.points[cloud.finite()], self.scan)
            return Subject(Path(self.scan).stem, "units of the scan", noisy, up=up_axis(noisy))
        generated = self.shape in SHAPES
        made = GeneratedDataModule if generated else PUDataModule
        noise = self.noise if noise is None else noise
        data = made(shape=self.shape, points=self.points, noise=noise, noise_model=model, seed=self.seed)
        unit = _UNITS.get(self.shape, "bounding radius = 1")
        # Most of the PU-Net meshes stand on their y axis.
        up = 2 if generated else 1
        return Subject(self.shape, unit, data.noisy, data.reference.vertices, data.reference.faces, up)

    def config(self, *settings: str) -> dict[str, Any]:
        """Return the configuration of a fit: `settings` of the figure, then those of the user."""
        return compose([f"seed={self.seed}", *settings, *self.overrides])

    def fit(self, subject: Subject, label: str = "fitting", *settings: str) -> "Field":
        """Fit a field to a subject's cloud, with a line of progress."""
        config = self.config(*settings)
        with self.progress(label) as report:
            return fit_clouds([subject.noisy], config, report=report)


def read_request(name: str, figure: "Figure", settings: list[str], progress: Progress = silent) -> Request:
    """Read `key=value` settings; what is no setting of the figure is kept for the fit.

    Raises:
        ConfigError: Not a setting, a value out of range, an unknown shape, or a scan where a truth is needed.
    """
    known = [f.name for f in fields(Request) if f.name not in ("overrides", "progress")]
    given, overrides = {}, []
    for text in settings:
        key, equals, value = text.partition("=")
        if not equals:
            raise ConfigError(f"cannot read the setting {text!r}; write key=value, e.g. shape=bracket or seed=1")
        if key in known:
            given[key] = _value(key, value)
        else:
            overrides.append(text)
    for key in ("shape", "points", "noise"):
        if "scan" in given and key in given:
            raise ConfigError(f"{key}={given[key]} has no effect on scan={given['scan']}; leave one of them out")
    if "scan" in given and not figure.own_scan:
        raise ConfigError(f"figure {name} adds noise to a clean shape; give shape=... instead of scan={given['scan']}")
    chosen = {**figure.defaults, **given}
    shape = chosen.get("shape", "bracket")
    if shape not in SHAPES and shape not in PU_SHAPES:
        raise ConfigError(f"unknown shape {shape!r}.{suggest(shape, [*SHAPES, *PU_SHAPES])}")
    request = replace(Request(progress=progress), **chosen, overrides=tuple(overrides))
    # Before anything expensive: are the settings of the fit ones?
    request.config()
    return request


def _value(key: str, text: str) -> Any:
    if key in ("shape", "scan"):
        return text
    try:
        value = float(text) if key == "noise" else int(text)
    except ValueError:
        kind = "number" if key == "noise" else "whole number"
        raise ConfigError(f"{key}={text} is not a {kind}") from None
    if key == "seed":
        check_seed(value)
    elif key == "noise" and not 0 <= value < 1:
        raise ConfigError(f"noise={text} is out of range; give a share of the bounding radius, e.g. 0.02")
    elif value < _LEAST.get(key, 0):
        raise ConfigError(f"{key}={text} is out of range; give {_LEAST[key]} or more")
    return value
