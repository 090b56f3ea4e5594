"""The user's arguments, checked before anything expensive starts."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from n2n.cli.console import say
from n2n.errors import InputError, OutputError
from n2n.formats import Cloud, check_writable, read_cloud
from n2n.geometry.checks import check_cloud


@dataclass
class Input:
    """One input file.

    Attributes:
        path: Where it is.
        cloud: As read; rows that are not finite included.
        finite: Which rows are finite, (n,).
    """

    path: Path
    cloud: Cloud
    finite: NDArray[np.bool_]

    @property
    def points(self) -> NDArray[np.float64]:
        """The finite points, (m, 3)."""
        return self.cloud.points[self.finite]


def split_overrides(arguments: list[str]) -> tuple[list[Path], list[str]]:
    """Tell files from `key=value` settings; an existing file wins."""
    files, overrides = [], []
    for argument in arguments:
        is_override = "=" in argument and not Path(argument).exists()
        (overrides if is_override or argument.startswith("~") else files).append(argument)
    return [Path(name) for name in files], overrides


def read_inputs(paths: list[Path], quiet: bool) -> list[Input]:
    """Read and check every cloud; say what is unusual about it."""
    if not paths:
        raise InputError("no input file given; e.g. n2n reconstruct scan.ply -o mesh.ply")
    inputs = []
    for path in paths:
        cloud = read_cloud(path)
        finite = cloud.finite()
        if not finite.all():
            say(f"{path}: {int((~finite).sum())} of {len(cloud)} rows are NaN or infinite; they are left out", quiet)
        item = Input(path, cloud, finite)
        check_cloud(item.points, str(path))
        distinct = len(np.unique(item.points, axis=0))
        if distinct < len(item.points):
            say(f"{path}: {len(item.points) - distinct} of {len(item.points)} points are duplicates", quiet)
        inputs.append(item)
    return inputs


def plan_outputs(output: str, paths: list[Path], extensions: tuple[str, ...], per_input: bool) -> list[Path]:
    """Decide which files will be written, and check that they can be.

    Args:
        output: What the user gave to -o: a file, or a folder (existing, or ending in a separator).
        paths: The inputs.
        extensions: What this task can write.
        per_input: A folder gets one result per input; otherwise one result, named after the first.
    """
    folder = Path(output)
    if not (output.endswith(("/", "\\")) or folder.is_dir()):
        check_writable(folder, extensions)
        return [folder]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be created ({error.strerror}); choose another folder with -o") from error
    named = paths if per_input else paths[:1]
    targets = [folder / (p.name if p.suffix.lower() in extensions else f"{p.stem}{extensions[0]}") for p in named]
    if len(set(targets)) < len(targets):
        raise OutputError(f"{folder}: two inputs have the same file name, so their results would overwrite each other")
    for target, path in zip(targets, named, strict=True):
        if target.resolve() == path.resolve():
            raise OutputError(f"{target}: is the input itself; choose another folder with -o")
        check_writable(target, extensions)
    return targets
