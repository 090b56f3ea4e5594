"""Normal consistency: do the normals of nearest points agree?"""

import numpy as np
from numpy.typing import NDArray

from n2n.errors import InputError
from n2n.metrics.nearest import as_points, nearest


def normal_consistency(
    pred_pts: NDArray[np.float64],
    pred_normals: NDArray[np.float64],
    ref_pts: NDArray[np.float64],
    ref_normals: NDArray[np.float64],
    inflated: bool = False,
) -> float:
    """Return the mean of |n . n'| over nearest points, averaged over both directions; orientation is ignored.

    Args:
        pred_pts, pred_normals: (n, 3) each; normals of any length but zero.
        ref_pts, ref_normals: (m, 3) each.
        inflated: Sum |n_k n'_k| over the components, as the released code of Ma et al. does. Never smaller than the
            standard value: 0.75 instead of 0.5 for random directions.

    Returns:
        In [0, 1], 1 is best.

    Raises:
        InputError: Normals and points do not pair up, or a normal has no direction.

    Source: ConvONet src/eval.py:77,183-196; inflated: Noise2NoiseMapping noise2noise.py:103-104.

    >>> x, tilted = np.array([[1.0, 0, 0]]), np.array([[1.0, 1, 0]])
    >>> round(normal_consistency(x, tilted, x, x), 4)
    0.7071
    """
    for name, normals, points in (("predicted", pred_normals, pred_pts), ("reference", ref_normals, ref_pts)):
        if len(normals) != len(points):
            raise InputError(f"{name} normals: {len(normals)} for {len(points)} points; every point needs its own")
    forth, back = nearest(pred_pts, ref_pts)[1], nearest(ref_pts, pred_pts)[1]
    return normal_consistency_of(pred_normals, ref_normals, forth, back, inflated)


def normal_consistency_of(
    pred_normals: NDArray[np.float64],
    ref_normals: NDArray[np.float64],
    forth: NDArray[np.int64],
    back: NDArray[np.int64],
    inflated: bool = False,
) -> float:
    """Return the normal consistency from the indices of the nearest points, as `nearest` gives them.

    Args:
        pred_normals, ref_normals: (n, 3) and (m, 3), of any length but zero.
        forth: Nearest reference point of every predicted one, (n,).
        back: Nearest predicted point of every reference point, (m,).
        inflated: See `normal_consistency`.
    """
    ours, theirs = _unit(pred_normals, "predicted normals"), _unit(ref_normals, "reference normals")
    agreement = _inflated if inflated else _cosine
    return float(0.5 * (agreement(ours, theirs[forth]).mean() + agreement(theirs, ours[back]).mean()))


def _cosine(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.abs((a * b).sum(axis=1))


def _inflated(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.abs(a * b).sum(axis=1)


def _unit(normals: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    normals = as_points(normals, name)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    zero = int((length == 0).sum())
    if zero:
        raise InputError(f"{name}: {zero} of {len(normals)} normals have length zero; remove their points first")
    return normals / length
