"""Clean clouds, and the noisy files that benchmarks ship with them: every row counts."""

import numpy as np
from numpy.typing import NDArray

from n2n.datamodules.layouts import Scan
from n2n.datamodules.reading import read_scan
from n2n.errors import InputError


def read_rows(scan: Scan) -> NDArray[np.float64]:
    """Read a cloud of which no row may be missing, (n, 3).

    Raises:
        InputError: It is not readable, not in the frame of its truth, has another number of points than its layout
            says, or rows that are NaN.
    """
    points = read_scan(scan)[0]
    if scan.count is not None and len(points) != scan.count:
        lost = scan.count - len(points)
        raise InputError(f"{scan.path}: {lost} of {scan.count} points are NaN or infinite; expected {scan.layout}")
    return points


def read_official(scan: Scan | None, wanted: str) -> NDArray[np.float64]:
    """Read a noisy file of the benchmark, (n, 3).

    Args:
        scan: Where it is; None if it is nowhere.
        wanted: What it is, for messages.
    """
    if scan is None:
        raise InputError(f"no official noisy file for {wanted}; leave out datamodule.official to draw the noise")
    return read_rows(scan)
