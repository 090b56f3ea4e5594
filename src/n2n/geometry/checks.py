"""Can this cloud be fitted? Checked before anything expensive starts."""

import numpy as np
from numpy.typing import NDArray

from n2n.errors import InputError
from n2n.geometry.outliers import first_of_equal

MIN_POINTS = 100
_FLATNESS = 1e-5  # of the extent; a line stored in single precision, or with six digits, is this crooked


def check_cloud(points: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    """Return the points if a surface can be fitted to them.

    Args:
        points: (n, 3) world coordinates, finite.
        name: What to call the cloud in messages.

    Raises:
        InputError: Wrong shape, not finite, fewer than 100 distinct points, all equal, or on one line.
    """
    count_distinct(points, name)
    return points


def count_distinct(points: NDArray[np.float64], name: str) -> int:
    """Check as `check_cloud` does; return how many different points there are."""
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"{name}: expected an array of shape (n, 3), got {points.shape}")
    if not np.isfinite(points).all():
        count = int((~np.isfinite(points).all(axis=1)).sum())
        raise InputError(f"{name}: {count} of {len(points)} points are NaN or infinite; remove them first")
    if len(points) < MIN_POINTS:
        raise InputError(f"{name}: {len(points)} points are too few for a surface; at least {MIN_POINTS} are needed")
    distinct = int(first_of_equal(points).sum())
    if distinct == 1:
        raise InputError(f"{name}: all {len(points)} points are equal; this is not a surface")
    if distinct < MIN_POINTS:
        raise InputError(
            f"{name}: only {distinct} of {len(points)} points are distinct; at least {MIN_POINTS} are needed"
        )
    extent = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if extent[1] <= _FLATNESS * extent[0]:
        raise InputError(f"{name}: all points lie on one line; a surface needs points in two directions at least")
    return distinct
