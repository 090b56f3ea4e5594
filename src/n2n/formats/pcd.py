"""PCD v0.7 (Point Cloud Library): ascii, binary and binary_compressed are read, binary is written."""

import io
from pathlib import Path

import numpy as np

from n2n.errors import InputError
from n2n.formats.cloud import Cloud

_KINDS = {"F": "f", "I": "i", "U": "u"}
_LETTERS = {"f": "F", "i": "I", "u": "U"}


def read(path: Path) -> Cloud:
    """Read x y z and every further one-element field."""
    content = path.read_bytes()
    fields, start = _header(content, path)
    # Padding is called _, any number of times.
    names = [f"_{i}" if name == "_" else name for i, name in enumerate(fields["FIELDS"])]
    dtype = np.dtype(
        [
            (name, f"<{_KINDS[kind]}{size}", () if count == 1 else (count,))
            for name, size, kind, count in zip(names, *(fields[k] for k in ("SIZE", "TYPE", "COUNT")), strict=True)
        ]
    )
    points = fields["POINTS"]
    table = _table(content[start:], fields["DATA"], dtype, points, path)
    missing = [name for name in "xyz" if name not in dtype.names]
    if missing:
        raise InputError(f"{path}: has no field {missing[0]!r}; fields: {', '.join(dtype.names)}")
    position = np.stack([table[name].astype(np.float64) for name in "xyz"], axis=1)
    kept = [name for name in fields["FIELDS"] if name not in ("x", "y", "z", "_") and table[name].ndim == 1]
    return Cloud(position, {name: table[name].copy() for name in kept})


def write(path: Path, cloud: Cloud) -> None:
    """Write binary with 8-byte coordinates."""
    columns = {name: cloud.points[:, axis] for axis, name in enumerate("xyz")}
    for name, values in cloud.columns().items():
        known = values.dtype.kind in _LETTERS and values.dtype != np.float16
        columns[name.replace(" ", "_")] = values if known else values.astype(np.float64)
    dtype = np.dtype([(name, "<" + values.dtype.str[1:]) for name, values in columns.items()])
    table = np.empty(len(cloud), dtype)
    for name, values in columns.items():
        table[name] = values
    kinds = [dtype[name] for name in columns]
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {' '.join(columns)}\nSIZE {' '.join(str(k.itemsize) for k in kinds)}\n"
        f"TYPE {' '.join(_LETTERS[k.kind] for k in kinds)}\nCOUNT {' '.join('1' for _ in kinds)}\n"
        f"WIDTH {len(cloud)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(cloud)}\nDATA binary\n"
    )
    with path.open("wb") as file:
        file.write(header.encode("ascii", "replace"))
        file.write(table.tobytes())


def _header(content: bytes, path: Path) -> tuple[dict, int]:
    """Parse the header; return its entries and where the data starts."""
    fields: dict = {}
    position = 0
    while "DATA" not in fields:
        end = content.find(b"\n", position)
        if end < 0 or position > 65536:
            raise InputError(f"{path}: has no PCD header (no DATA line); check or re-export it")
        words = content[position:end].decode("ascii", "replace").split()
        position = end + 1
        if words and not words[0].startswith("#"):
            fields[words[0].upper()] = words[1:]
    fields["DATA"] = fields["DATA"][0].lower()
    for key in ("FIELDS", "SIZE", "TYPE"):
        if key not in fields:
            raise InputError(f"{path}: the PCD header has no {key} line; check or re-export it")
    fields["SIZE"] = [int(s) for s in fields["SIZE"]]
    fields["COUNT"] = [int(s) for s in fields.get("COUNT", ["1"] * len(fields["FIELDS"]))]
    width, height = int(fields.get("WIDTH", [0])[0]), int(fields.get("HEIGHT", [1])[0])
    fields["POINTS"] = int(fields["POINTS"][0]) if "POINTS" in fields else width * height
    return fields, position


def _table(body: bytes, kind: str, dtype: np.dtype, points: int, path: Path) -> np.ndarray:
    needed = points * dtype.itemsize
    if kind == "ascii":
        widths = {name: int(np.prod(dtype[name].shape, dtype=int)) for name in dtype.names}
        rows = np.loadtxt(io.BytesIO(body), ndmin=2) if body.strip() else np.empty((0, sum(widths.values())))
        if len(rows) != points:
            raise InputError(f"{path}: the header promises {points} points, the file holds {len(rows)}; it is cut off")
        if rows.shape[1] != sum(widths.values()):
            promised = f"{sum(widths.values())} values a point"
            raise InputError(
                f"{path}: the header promises {promised}, the lines hold {rows.shape[1]}; check or re-export it"
            )
        table, column = np.empty(points, dtype), 0
        for name, width in widths.items():
            table[name] = rows[:, column] if dtype[name].shape == () else rows[:, column : column + width]
            column += width
        return table
    if kind == "binary_compressed":
        packed, unpacked = np.frombuffer(body[:8], "<u4")
        body = _decompress(body[8 : 8 + int(packed)], int(unpacked))
    elif kind != "binary":
        raise InputError(f"{path}: DATA {kind} is no PCD encoding; known: ascii, binary, binary_compressed")
    if len(body) < needed:
        held = len(body) // dtype.itemsize
        raise InputError(f"{path}: the header promises {points} points, the file holds {held}; it is cut off")
    if kind == "binary":
        return np.frombuffer(body[:needed], dtype)
    # Compressed files store field after field instead of point after point.
    table, position = np.empty(points, dtype), 0
    for name in dtype.names:
        size = dtype[name].itemsize * points
        table[name] = np.frombuffer(body[position : position + size], dtype[name].base).reshape(table[name].shape)
        position += size
    return table


def _decompress(data: bytes, size: int) -> bytes:
    """LZF: runs of literals and back references."""
    out = bytearray()
    i = 0
    while i < len(data):
        control = data[i]
        i += 1
        if control < 32:
            out += data[i : i + control + 1]
            i += control + 1
            continue
        length = control >> 5
        if length == 7:
            length += data[i]
            i += 1
        start = len(out) - ((control & 31) << 8) - data[i] - 1
        i += 1
        length += 2
        if start < 0:
            raise ValueError("corrupt compressed data")
        if start + length <= len(out):
            out += out[start : start + length]
        else:
            for k in range(length):
                out.append(out[start + k])
    if len(out) != size:
        raise ValueError(f"{len(out)} bytes after decompression, {size} expected")
    return bytes(out)
