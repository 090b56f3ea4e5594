"""`n2n.fit`: arrays in, a field out."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from n2n.compose import compose
from n2n.datamodules.observations import ObservationsDataModule
from n2n.fitting.callbacks import Report
from n2n.fitting.fit import fit as fit_data
from n2n.geometry.checks import check_cloud
from n2n.tasks.field import Field


def fit(
    points: NDArray[np.float64] | Sequence[NDArray[np.float64]],
    recipe: str = "fast",
    device: str = "auto",
    seed: int = 0,
    overrides: Sequence[str] = (),
    run_dir: str | Path | None = None,
    report: Report | None = None,
) -> Field:
    """Learn a signed distance field from one or several noisy observations of one shape.

    Args:
        points: (n, 3) world coordinates, n >= 100, or a list of such arrays (point counts may differ).
        recipe: `fast` (seconds) or `paper` (the paper's settings; days on a CPU).
        device: auto | cpu | cuda | mps.
        seed: Seed of everything random.
        overrides: Further `key=value` settings, as on the command line.
        run_dir: Keep checkpoints and the field there; an unfinished fit found there is resumed.
        report: Called as report(done, total, values) during the fit.

    Raises:
        InputError: A cloud is too small, flat on a line, or not finite.
        ConfigError: An unknown recipe or setting.
    """
    clouds = [points] if isinstance(points, np.ndarray) and points.ndim == 2 else list(points)
    clouds = [check_cloud(np.asarray(cloud, np.float64), f"points[{i}]") for i, cloud in enumerate(clouds)]
    config = compose([f"recipe={recipe}", f"device={device}", f"seed={seed}", *overrides])
    return fit_clouds(clouds, config, run_dir, report)


def fit_clouds(
    clouds: list[NDArray[np.float64]],
    config: dict[str, Any],
    run_dir: str | Path | None = None,
    report: Report | None = None,
) -> Field:
    """Fit one shape's observations, already checked, with a composed configuration."""
    data = ObservationsDataModule([clouds], config["num_observations"])
    result = Field.of(fit_data(data, config, Path(run_dir) if run_dir else None, report))
    if run_dir:
        result.save(run_dir)
    return result
