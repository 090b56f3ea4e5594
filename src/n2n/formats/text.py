"""Text clouds: one point per line, any delimiter, optional header or count line, further columns kept."""

import io
import re
from pathlib import Path

import numpy as np

from n2n.errors import InputError
from n2n.formats.cloud import Cloud

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*([eE][-+]?\d+)?|\.\d+([eE][-+]?\d+)?|nan|inf(inity)?)$", re.IGNORECASE)


def read(path: Path) -> Cloud:
    """Read x y z from the columns of that name, or the first three; the rest become attributes."""
    try:
        content = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: is not text (byte {error.start} cannot be decoded); "
            "binary clouds end in .ply, .npy, .pcd, .las or .bin"
        ) from error
    if "\x00" in content:
        raise InputError(f"{path}: is binary, not text; binary clouds end in .ply, .npy, .pcd, .las or .bin")
    skipped, count, header, first = _leading_lines(content, path)
    delimiter = next((mark for mark in (",", ";") if mark in first), None)
    names = _split(header, delimiter) if header else []
    try:
        table = np.loadtxt(io.StringIO(content), comments=("#", "//"), delimiter=delimiter, skiprows=skipped, ndmin=2)
    except ValueError as error:
        raise InputError(f"{path}: {_explain(str(error), skipped)}") from error
    if table.shape[1] < 3:
        raise InputError(f"{path}: {table.shape[1]} column(s) found, at least x y z are needed")
    if count is not None and len(table) < count:
        raise InputError(f"{path}: the first line promises {count} points, the file holds {len(table)}; it is cut off")
    if len(names) != table.shape[1]:
        names = []
    lowered = [name.lower() for name in names]
    axes = [lowered.index(name) for name in "xyz"] if set("xyz") <= set(lowered) else [0, 1, 2]
    labels = _labels(names or [""] * table.shape[1])
    attributes = {labels[i]: table[:, i] for i in range(table.shape[1]) if i not in axes}
    meta = {"delimiter": delimiter, "axes": axes, "names": names, "count_line": count is not None}
    return Cloud(np.ascontiguousarray(table[:, axes]), attributes, {"text": meta})


def write(path: Path, cloud: Cloud) -> None:
    """Write 9 significant digits, more where the coordinates are large; keep the layout of a cloud read from text."""
    meta = cloud.meta.get("text", {})
    delimiter = meta.get("delimiter") or ("," if path.suffix.lower() == ".csv" else " ")
    axes = meta.get("axes", [0, 1, 2])
    rest = cloud.columns()
    width = 3 + len(rest)
    axes = axes if max(axes) < width else [0, 1, 2]
    others = [i for i in range(width) if i not in axes]
    names, columns = [""] * width, [np.empty(0)] * width
    for axis, i in enumerate(axes):
        names[i], columns[i] = "xyz"[axis], cloud.points[:, axis]
    for name, i in zip(rest, others, strict=True):
        names[i], columns[i] = name, rest[name]
    magnitude = float(np.nanmax(np.abs(cloud.points), initial=1.0, where=np.isfinite(cloud.points)))
    digits = 9 + max(0, int(np.ceil(np.log10(magnitude))))
    formats = [f"%.{digits}g" if i in axes else _attribute_format(columns[i]) for i in range(width)]
    wants_header = bool(meta.get("names")) or path.suffix.lower() == ".csv"
    with path.open("w", encoding="utf-8") as file:
        if meta.get("count_line") or path.suffix.lower() == ".pts":
            file.write(f"{len(cloud)}\n")
        if wants_header:
            original = meta.get("names") or names
            file.write(delimiter.join(original if len(original) == width else names) + "\n")
        table = np.column_stack([np.asarray(c, np.float64) for c in columns])
        np.savetxt(file, table, fmt=formats, delimiter=delimiter)


def _attribute_format(values: np.ndarray) -> str:
    whole = np.isfinite(values).all() and bool((values == np.round(values)).all())
    # 15 digits bring back what a person or another program wrote, GPS time included; float32 has no more than 9.
    return "%d" if whole else "%.9g" if values.dtype == np.float32 else "%.15g"


def _labels(names: list[str]) -> list[str]:
    """Return one name for each column: empty and repeated ones get the column's number."""
    return [
        name if name and names.count(name) == 1 else f"{name}_{i}" if name else f"column{i}"
        for i, name in enumerate(names)
    ]


def _leading_lines(content: str, path: Path) -> tuple[int, int | None, str | None, str]:
    """Return how many lines precede the numbers, the point count and the header among them, and the first row."""
    header, count = None, None
    for number, line in enumerate(content.splitlines()):
        stripped = re.split(r"#|//", line, maxsplit=1)[0].strip()
        if not stripped:
            candidate = line.strip().lstrip("#/ ")
            if candidate and all(not _NUMBER.match(word) for word in re.split(r"[\s,;]+", candidate)):
                header = candidate
            continue
        words = [word for word in re.split(r"[\s,;]+", stripped) if word]
        if count is None and len(words) == 1 and words[0].isdigit():
            count = int(words[0])
            continue
        if all(_NUMBER.match(word) for word in words):
            return number, count, header, stripped
        if header is None or number == 0:
            header = stripped
            if number < 2:
                continue
        raise InputError(f"{path}: line {number + 1} is not numbers ({stripped[:40]!r}); expected x y z per line")
    raise InputError(f"{path}: holds no points")


def _split(line: str, delimiter: str | None) -> list[str]:
    return [word.strip().strip('"') for word in (line.split(delimiter) if delimiter else line.split())]


def _explain(message: str, skipped: int) -> str:
    """Turn numpy's message into one that counts lines as an editor does."""
    row = re.search(r"row (\d+)", message)
    if "columns" in message:
        # Here numpy counts rows from one, below from zero.
        where = f"line {int(row.group(1)) + skipped}" if row else "a line"
        return f"{where} has another number of columns than the first; every line needs the same"
    where = f"line {int(row.group(1)) + skipped + 1}" if row else "a line"
    return f"{where} is not numbers ({message.split(' at row')[0]}); expected x y z per line"
