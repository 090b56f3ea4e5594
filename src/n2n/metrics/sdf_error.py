"""How far a signed distance is from the true one."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from n2n.errors import ConfigError, InputError


class SDFErrors(NamedTuple):
    """Errors over the queries whose true distance is within the band.

    Attributes:
        mean_absolute: Mean |predicted - true|, unit of the distances.
        relative: `mean_absolute` over the mean |true|: 0 is exact, 1 is what f = 0 gets.
        sign_errors: Share of queries on the wrong side; a query exactly on either surface is on no wrong side.
    """

    mean_absolute: float
    relative: float
    sign_errors: float


def sdf_error(predicted: NDArray[np.float64], true: NDArray[np.float64], band: float) -> SDFErrors:
    """Compare signed distances, negative inside.

    Args:
        predicted, true: At the same queries, (n,).
        band: Queries with |true| <= band count, unit of the distances; `inf` counts all.

    Raises:
        InputError: The counts differ, values are not finite, or nothing is in the band but zeros.
        ConfigError: The band is not positive.

    >>> sdf_error(np.array([0.5, -0.5, 9]), np.array([1.0, 1.0, 5.0]), band=1.0)
    SDFErrors(mean_absolute=1.0, relative=1.0, sign_errors=0.5)
    """
    check_band(band)
    if predicted.shape != true.shape or true.ndim != 1:
        raise InputError(f"signed distances: expected two arrays of shape (n,), got {predicted.shape}, {true.shape}")
    if not (np.isfinite(predicted).all() and np.isfinite(true).all()):
        raise InputError("signed distances: some are NaN or infinite; leave those queries out")
    near = np.abs(true) <= band
    predicted, true = predicted[near], true[near]
    scale = float(np.abs(true).mean()) if len(true) else 0.0
    if not scale:
        raise InputError(f"signed distances: no query off the surface within band={band}; widen it or ask elsewhere")
    mean_absolute = float(np.abs(predicted - true).mean())
    return SDFErrors(mean_absolute, mean_absolute / scale, float((predicted * true < 0).mean()))


def check_band(band: float) -> None:
    """Raise ConfigError unless the band is a positive distance."""
    if not band > 0:
        raise ConfigError(f"band={band} must be a positive distance")
