"""The user's files, checked before anything expensive starts."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from n2n.errors import InputError
from n2n.formats import Cloud, read_cloud
from n2n.geometry.checks import count_distinct

_WHAT_HAPPENS = {"denoise": "they are kept as they are"}


@dataclass
class Input:
    """One input file.

    Attributes:
        path: Where it is.
        cloud: As read; rows that are not finite included.
        finite: Which rows are finite, (n,).
        repeated: How many of the finite rows are duplicates of others.
    """

    path: Path
    cloud: Cloud
    finite: NDArray[np.bool_]
    repeated: int = 0

    @property
    def points(self) -> NDArray[np.float64]:
        """The finite points, (m, 3)."""
        return self.cloud.points[self.finite]


def split_overrides(arguments: list[str]) -> tuple[list[Path], list[str]]:
    """Tell files from `key=value` settings; an existing file wins."""
    files, overrides = [], []
    for argument in arguments:
        is_override = "=" in argument or argument.startswith("~")
        (overrides if is_override and not _exists(argument) else files).append(argument)
    return [Path(name) for name in files], overrides


def _exists(argument: str) -> bool:
    try:
        return Path(argument).exists()
    except OSError:
        # A long list of terms is no name of a file.
        return False


def read_inputs(paths: list[Path], task: str) -> list[Input]:
    """Read and check every cloud.

    Raises:
        InputError: No input, or one that cannot be read or fitted.
    """
    if not paths:
        raise InputError(f"no input file given; e.g. n2n {task} scan.ply -o ...")
    inputs = []
    for path in paths:
        cloud = read_cloud(path)
        item = Input(path, cloud, cloud.finite())
        left_out = len(cloud) - len(item.points)
        name = f"{path} (without {left_out:,} NaN or infinite rows)" if left_out else str(path)
        item.repeated = len(item.points) - count_distinct(item.points, name)
        inputs.append(item)
    return inputs


def remarks(item: Input, task: str) -> list[str]:
    """Return one line for each thing about a cloud that its owner may not know."""
    lines, left_out = [], len(item.cloud) - len(item.points)
    if left_out:
        happens = _WHAT_HAPPENS.get(task, "they are left out")
        lines.append(f"{item.path}: {left_out:,} of {len(item.cloud):,} rows are NaN or infinite; {happens}")
    if item.repeated:
        lines.append(f"{item.path}: {item.repeated:,} of {len(item.points):,} points are duplicates; each counts once")
    return lines
