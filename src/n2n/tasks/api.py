"""`n2n.fit`: arrays in, a field out."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from n2n.compose import compose
from n2n.datamodules.observations import ObservationsDataModule
from n2n.errors import InputError
from n2n.fitting.callbacks import Report
from n2n.fitting.fit import fit as fit_data
from n2n.geometry.checks import check_cloud
from n2n.tasks.field import Field

_EXPECTED = "an array of shape (n, 3), or a list of such arrays"


def fit(
    points: ArrayLike | Sequence[ArrayLike],
    recipe: str = "fast",
    device: str = "auto",
    seed: int = 0,
    overrides: Sequence[str] = (),
    run_dir: str | Path | None = None,
    report: Report | None = None,
) -> Field:
    """Learn a signed distance field from one or several noisy observations of one shape.

    Args:
        points: (n, 3) world coordinates, n >= 100, or a list of such arrays (point counts may differ). Arrays, torch
            tensors and lists of numbers are arrays here.
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
    clouds = [check_cloud(cloud, f"points[{i}]") for i, cloud in enumerate(_clouds(points))]
    config = compose([f"recipe={recipe}", f"device={device}", f"seed={seed}", *overrides])
    return fit_clouds(clouds, config, run_dir, report)


def _clouds(points: Any) -> list[NDArray[np.float64]]:
    """Return the observations as arrays, one or several."""
    try:
        if hasattr(points, "__array__"):
            whole = _array(points)
            clouds = [whole] if whole.ndim == 2 else list(whole)
        else:
            clouds = [_array(part) for part in points]
            if clouds and all(part.ndim == 1 for part in clouds):
                clouds = [_stacked(clouds)]
    except (ValueError, TypeError) as error:
        raise InputError(f"points: cannot be read as numbers ({error}); give {_EXPECTED}") from error
    odd = next((cloud for cloud in clouds if cloud.ndim != 2), None)
    if odd is not None:
        got = (
            f"a list of {len(clouds)} parts, one of shape {odd.shape}" if odd.ndim else f"{len(clouds)} single numbers"
        )
        raise InputError(f"points: got {got}; give {_EXPECTED}")
    return clouds


def _stacked(rows: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    lengths = sorted({len(row) for row in rows})
    if len(lengths) > 1:
        raise InputError(f"points: got rows of {lengths[0]} to {lengths[-1]} numbers; give {_EXPECTED}")
    return np.array(rows)


def _array(part: Any) -> NDArray[np.float64]:
    part = part.detach().cpu() if isinstance(part, torch.Tensor) else part
    return np.asarray(part, np.float64)


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
