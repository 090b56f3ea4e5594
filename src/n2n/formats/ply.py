"""PLY: read through trimesh, written as binary with float64 coordinates."""

from pathlib import Path

import numpy as np

from n2n.errors import InputError
from n2n.formats.cloud import Cloud

_TYPES = {
    "f4": "float",
    "f8": "double",
    "i1": "char",
    "u1": "uchar",
    "i2": "short",
    "u2": "ushort",
    "i4": "int",
    "u4": "uint",
}


def read(path: Path) -> Cloud:
    """Read the vertices with all their properties; faces are ignored."""
    from trimesh.exchange.ply import load_ply

    with path.open("rb") as file:
        if not file.read(3).startswith(b"ply"):
            raise InputError(f"{path}: does not start with 'ply', so it is no PLY file; check or re-export it")
        file.seek(0)
        try:
            elements = load_ply(file)["metadata"]["_ply_raw"]
        except KeyError as error:
            if error.args[0] not in ("x", "y", "z"):
                raise
            raise InputError(f"{path}: has no vertex property {error}; x, y and z are needed") from error
    if "vertex" not in elements or not elements["vertex"]["length"]:
        raise InputError(f"{path}: holds no vertices")
    data = elements["vertex"]["data"]
    names = list(data.dtype.names) if isinstance(data, np.ndarray) else list(data)
    missing = [name for name in "xyz" if name not in names]
    if missing:
        raise InputError(f"{path}: the vertices have no property {missing[0]!r}; properties: {', '.join(names)}")
    count, kinds = elements["vertex"]["length"], elements["vertex"]["properties"]
    columns = {name: np.asarray(data[name]) for name in names if "$LIST" not in kinds[name]}
    # Rows that end early make columns of objects, or short ones.
    if any(values.size != count or values.dtype == object for values in columns.values()):
        raise InputError(f"{path}: the header promises {count} whole vertices, the file holds fewer; it is cut off")
    columns = {name: values.reshape(count).astype(values.dtype.newbyteorder("=")) for name, values in columns.items()}
    points = np.stack([columns.pop(name).astype(np.float64) for name in "xyz"], axis=1)
    return Cloud(points, columns)


def write(path: Path, cloud: Cloud) -> None:
    """Write binary little-endian; attributes become vertex properties."""
    columns = {name: cloud.points[:, axis] for axis, name in enumerate("xyz")}
    for name, values in cloud.columns().items():
        code = values.dtype.str[1:]
        columns[name.replace(" ", "_")] = values if code in _TYPES else values.astype(np.float64)
    dtype = np.dtype([(name, "<" + np.asarray(values).dtype.str[1:]) for name, values in columns.items()])
    table = np.empty(len(cloud), dtype)
    for name, values in columns.items():
        table[name] = values
    properties = "".join(f"property {_TYPES[dtype[name].str[1:]]} {name}\n" for name in columns)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(cloud)}\n{properties}end_header\n"
    with path.open("wb") as file:
        file.write(header.encode("ascii", "replace"))
        file.write(table.tobytes())
