"""LAS and LAZ through laspy: dimensions, scale, offset and coordinate system of the input are kept."""

from pathlib import Path

import numpy as np

from n2n.formats.cloud import Cloud

_RANGE = 2.0**30  # LAS stores coordinates as 32-bit integers


def read(path: Path) -> Cloud:
    """Read all dimensions of all points."""
    import laspy

    file = laspy.read(path)
    points = np.stack([np.asarray(axis, np.float64) for axis in (file.x, file.y, file.z)], axis=1)
    names = [name for name in file.point_format.dimension_names if name not in ("X", "Y", "Z")]
    return Cloud(points, {name: np.asarray(file[name]) for name in names}, {"las_header": file.header})


def write(path: Path, cloud: Cloud) -> None:
    """Write with the header the cloud was read with, or one made for its extent."""
    import laspy

    header = cloud.meta.get("las_header")
    if header is None:
        coloured = {"red", "green", "blue"} <= set(cloud.attributes)
        header = laspy.LasHeader(point_format=7 if coloured else 6, version="1.4")
    else:
        header = laspy.LasHeader(point_format=header.point_format, version=header.version)
        header.vlrs = cloud.meta["las_header"].vlrs
    finite = cloud.points[cloud.finite()]
    header.offsets = np.floor(finite.min(axis=0)) if len(finite) else np.zeros(3)
    extent = float(np.ptp(finite, axis=0).max()) if len(finite) else 1.0
    step = 10.0 ** np.ceil(np.log10(max(extent, 1e-9) / _RANGE))
    header.scales = np.full(3, min(step, 1e-4) if extent < 1e-4 * _RANGE else step)
    standard = set(header.point_format.dimension_names)
    columns = {name[:32]: values for name, values in cloud.columns().items()}
    for name, values in columns.items():
        if name not in standard:
            header.add_extra_dim(laspy.ExtraBytesParams(name=name, type=values.dtype))
    file = laspy.LasData(header)
    file.x, file.y, file.z = np.nan_to_num(cloud.points, nan=float(header.offsets[0])).T
    for name, values in columns.items():
        file[name] = values
    with path.open("wb") as stream:
        file.write(stream, do_compress=path.suffix.lower() == ".laz")
