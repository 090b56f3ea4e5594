"""Text clouds: one point per line, any delimiter, optional header or count line, further columns kept."""

import csv
import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from n2n.errors import InputError
from n2n.formats.cloud import Cloud

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*([eE][-+]?\d+)?|\.\d+([eE][-+]?\d+)?|nan|inf(inity)?)$", re.IGNORECASE)
_COMMENTS = ("#", "//")
# What stands before a comment; quoted texts may hold its marks.
_BEFORE_COMMENT = re.compile(r'(?:[^"#/]+|"[^"]*"|"|/(?!/))*')


@dataclass
class _Head:
    """What precedes the rows.

    Attributes:
        skipped: How many lines.
        first: The first row, without comment.
        count: The promised number of points, if there is such a line.
        header: The line of column names, if there is one.
        mark: What made that line a comment, e.g. "# "; empty where it is none.
    """

    skipped: int = 0
    first: str = ""
    count: int | None = None
    header: str | None = None
    mark: str = ""


def read(path: Path) -> Cloud:
    """Read x y z from the columns of that name, or the first three; the rest, numbers or texts, become attributes."""
    try:
        content = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: is not text (byte {error.start} cannot be decoded); "
            "binary clouds end in .ply, .npy, .pcd, .las or .bin"
        ) from error
    if "\x00" in content:
        raise InputError(f"{path}: is binary, not text; binary clouds end in .ply, .npy, .pcd, .las or .bin")
    head = _read_head(content, path)
    delimiter = _delimiter(head.first)
    names = _fields(head.header, delimiter) if head.header else []
    width = len(_fields(head.first, delimiter))
    if len(names) != width:
        names = []
    lowered = [name.lower() for name in names]
    axes = [lowered.index(name) for name in "xyz"] if set("xyz") <= set(lowered) else [0, 1, 2]
    try:
        table = np.loadtxt(
            io.StringIO(content), comments=_COMMENTS, delimiter=delimiter, skiprows=head.skipped, ndmin=2
        )
        columns = list(table.T)
    except ValueError:
        columns = _mixed_columns(content, head.skipped, delimiter, axes, path)
    if len(columns) < 3:
        raise InputError(f"{path}: {len(columns)} column(s) found, at least x y z are needed")
    found = len(columns[0])
    if head.count is not None and found < head.count:
        raise InputError(f"{path}: the first line promises {head.count} points, the file holds {found}; it is cut off")
    labels = _labels(names or [""] * width)
    attributes = {labels[i]: columns[i] for i in range(width) if i not in axes}
    meta = {"delimiter": delimiter, "axes": axes, "names": names, "mark": head.mark, "count": head.count is not None}
    return Cloud(np.column_stack([columns[i] for i in axes]), attributes, {"text": meta})


def write(path: Path, cloud: Cloud) -> None:
    """Write 9 significant digits, more where the coordinates are large; keep the layout of a cloud read from text."""
    meta = cloud.meta.get("text", {})
    is_csv = path.suffix.lower() == ".csv"
    delimiter = meta.get("delimiter") or ("," if is_csv else " ")
    axes = meta.get("axes", [0, 1, 2])
    rest = cloud.columns(texts=True)
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
    with path.open("w", encoding="utf-8") as file:
        if meta.get("count") or path.suffix.lower() == ".pts":
            file.write(f"{len(cloud)}\n")
        if meta.get("names") or is_csv:
            original = meta.get("names") or names
            titles = [_quoted(name, delimiter) for name in (original if len(original) == width else names)]
            # The first line of a .csv holds bare names, unless it was read with a mark.
            mark = "" if is_csv and not meta.get("delimiter") else meta.get("mark", "")
            file.write(mark + delimiter.join(titles) + "\n")
        np.savetxt(file, _table(columns, delimiter), fmt=formats, delimiter=delimiter)


def _table(columns: list[NDArray[Any]], delimiter: str) -> NDArray[Any]:
    """Return (n, columns) numbers, or objects where there are texts."""
    if all(values.dtype.kind != "U" for values in columns):
        return np.column_stack([np.asarray(values, np.float64) for values in columns])
    table = np.empty((len(columns[0]), len(columns)), object)
    for i, values in enumerate(columns):
        is_text = values.dtype.kind == "U"
        table[:, i] = [_quoted(text, delimiter) for text in values.tolist()] if is_text else values.astype(np.float64)
    return table


def _quoted(text: str, delimiter: str) -> str:
    """Return a text as one field: in quotes where it would be taken for several, for none or for a comment."""
    text = " ".join(text.splitlines())
    if delimiter == " ":
        plain = text and not any(mark.isspace() for mark in text)
    else:
        plain = delimiter not in text and text == text.strip()
    if plain and '"' not in text and not any(mark in text for mark in _COMMENTS):
        return text
    return '"' + text.replace('"', '""') + '"'


def _attribute_format(values: NDArray[Any]) -> str:
    if values.dtype.kind == "U":
        return "%s"
    whole = np.isfinite(values).all() and bool((values == np.round(values)).all())
    # 15 digits bring back what a person or another program wrote, GPS time included; float32 has no more than 9.
    return "%d" if whole else "%.9g" if values.dtype == np.float32 else "%.15g"


def _labels(names: list[str]) -> list[str]:
    """Return one name for each column: empty and repeated ones get the column's number."""
    return [
        name if name and names.count(name) == 1 else f"{name}_{i}" if name else f"column{i}"
        for i, name in enumerate(names)
    ]


def _read_head(content: str, path: Path) -> _Head:
    """Find the first row, and what precedes it."""
    head, lines = _Head(), content.splitlines()
    named = False
    for number, line in enumerate(lines):
        stripped = _before_comment(line)
        if not stripped:
            names = line.strip().lstrip("#/ \t")
            # Other comments are prose.
            if not named and set("xyz") <= {word.strip('"').lower() for word in _words(names)}:
                head.header, head.mark = names, line.strip().removesuffix(names)
            continue
        words = _words(stripped)
        if head.count is None and len(words) == 1 and words[0].isdigit():
            head.count = int(words[0])
            continue
        if all(map(_NUMBER.match, words)) or _is_mixed_row(stripped, lines[number + 1 :], named):
            head.skipped, head.first = number, stripped
            return head
        if named:
            raise InputError(f"{path}: line {number + 1} is not numbers ({stripped[:40]!r}); expected x y z per line")
        head.header, head.mark, named = stripped, "", True
    raise InputError(f"{path}: holds no points")


def _is_mixed_row(line: str, following: list[str], named: bool) -> bool:
    """Tell a row with texts in it from a title such as `scan of 2020 05 12`: the next row looks the same."""
    delimiter = _delimiter(line)

    def shape(text: str) -> tuple[int, bool]:
        fields = _fields(text, delimiter)
        return len(fields), sum(bool(_NUMBER.match(field)) for field in fields) >= 3

    if not shape(line)[1]:
        return False
    after = next(filter(None, map(_before_comment, following)), line)
    return named or shape(after) == shape(line)


def _mixed_columns(content: str, skipped: int, delimiter: str | None, axes: list[int], path: Path) -> list[NDArray]:
    """Return the columns of a table that numpy cannot read, texts as texts, or say what is wrong with it; slow."""
    lines = [(number, _before_comment(line)) for number, line in enumerate(content.splitlines()[skipped:], skipped + 1)]
    numbers = [number for number, line in lines if line]
    rows = [_fields(line, delimiter) for _, line in lines if line]
    wrong = next((i for i, row in enumerate(rows) if len(row) != len(rows[0])), None)
    if wrong is not None:
        raise InputError(
            f"{path}: line {numbers[wrong]} has another number of columns than the first; every line needs the same"
        )
    columns = []
    for i, texts in enumerate(zip(*rows, strict=True)):
        try:
            columns.append(np.array(texts, np.float64))
        except ValueError as error:
            if i in axes:
                k = next((k for k, text in enumerate(texts) if not _NUMBER.match(text)), 0)
                raise InputError(
                    f"{path}: line {numbers[k]} is not numbers ({texts[k]!r} in column {i + 1}, which is taken for "
                    f"{'xyz'[axes.index(i)]}); mend it, or name the columns in the first line, x y z among them"
                ) from error
            columns.append(np.array(texts, np.str_))
    return columns


def _before_comment(line: str) -> str:
    return _BEFORE_COMMENT.match(line).group().strip()


def _words(line: str) -> list[str]:
    return [word for word in re.split(r"[\s,;]+", line) if word]


def _delimiter(line: str) -> str | None:
    """Return the delimiter of a row; None is white space."""
    return next((mark for mark in (",", ";") if mark in line), None)


def _fields(line: str, delimiter: str | None) -> list[str]:
    """Split a line; quoted fields lose their quotes."""
    line = line if delimiter else " ".join(line.split())
    fields = next(csv.reader([line], delimiter=delimiter or " ", skipinitialspace=True))
    return [field.strip() for field in fields]
