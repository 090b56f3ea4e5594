"""LAS and LAZ through laspy: header, dimensions and coordinate system are kept; scale and offset fit the extent."""

import logging
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from n2n.formats.cloud import Cloud

_RANGE = 2.0**30  # LAS stores coordinates as 32-bit integers


def read(path: Path) -> Cloud:
    """Read all dimensions of all points."""
    import laspy

    # It logs what it raises too, which would stand beside our message.
    logging.getLogger("laspy").setLevel(logging.CRITICAL)
    file = laspy.read(path)
    points = np.stack([np.asarray(axis, np.float64) for axis in (file.x, file.y, file.z)], axis=1)
    names = [name for name in file.point_format.dimension_names if name not in ("X", "Y", "Z")]
    return Cloud(points, {name: np.asarray(file[name]) for name in names}, {"las_header": file.header})


def write(path: Path, cloud: Cloud) -> None:
    """Write with the header the cloud was read with, or a new one.

    A standard dimension holds whole numbers of a certain range; what does not fit becomes an extra dimension, with an
    underscore after its name.

    Warns:
        UserWarning: Rows are NaN or infinite, which LAS cannot store; they are written at the lower corner.
    """
    import laspy

    header = cloud.meta.get("las_header")
    if header is None:
        coloured = {"red", "green", "blue"} <= set(cloud.attributes)
        header = laspy.LasHeader(point_format=7 if coloured else 6, version="1.4")
    else:
        header = header.copy()
    finite = cloud.finite()
    header.offsets, header.scales = _quantisation(cloud.points[finite])
    if not finite.all():
        warnings.warn(
            f"{path.suffix[1:]} cannot store the {(~finite).sum():,} rows that are NaN or infinite; "
            "they are at the lower corner now",
            stacklevel=2,
        )
    columns = {}
    for name, values in cloud.columns().items():
        values = values.astype(np.float64) if values.dtype.kind == "b" or values.dtype == np.float16 else values
        standard = name in header.point_format.dimension_names
        fits = standard and _fits(header.point_format.dimension_by_name(name), values)
        name = name[:32] if fits or not standard else f"{name[:31]}_"
        if not fits:
            header.add_extra_dim(laspy.ExtraBytesParams(name=name, type=values.dtype))
        columns[name] = values
    file = laspy.LasData(header, laspy.ScaleAwarePointRecord.zeros(len(cloud), header=header))
    file.x, file.y, file.z = np.where(finite[:, None], cloud.points, header.offsets).T
    for name, values in columns.items():
        file[name] = values
    with path.open("wb") as stream:
        file.write(stream, do_compress=path.suffix.lower() == ".laz")


def _quantisation(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return offset and scale, round numbers that use the integers' range."""
    if not len(points):
        return np.zeros(3), np.full(3, 1e-3)
    digit = 10.0 ** np.floor(np.log10(max(float(np.ptp(points, axis=0).max()), 1e-9)))
    offsets = np.floor(points.min(axis=0) / digit) * digit
    reach = max(float((points - offsets).max()), 1e-9)
    return offsets, np.full(3, 10.0 ** np.ceil(np.log10(reach / _RANGE)))


def _fits(dimension: Any, values: NDArray[Any]) -> bool:
    """Tell whether a dimension of a point format can hold the values as they are."""
    if dimension.is_scaled or dimension.kind.name == "FloatingPoint":
        return True
    within = (values >= dimension.min) & (values <= dimension.max) & (values == np.round(values))
    return bool(within.all())
