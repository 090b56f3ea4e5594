"""Observations read from the user's own files."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from n2n.datamodules.observations import ObservationsDataModule
from n2n.datamodules.shape_files import read_reference
from n2n.errors import InputError
from n2n.formats import read_cloud
from n2n.geometry.checks import check_cloud


class FilesDataModule(ObservationsDataModule):
    """Noisy observations in files.

    Attributes:
        name: Of the shape; of the first one, where there are several.
        reference: The true surface where it was given, else None; coordinates of the observations.
        noisy: The first observation, (n, 3) float64 world coordinates.
        source: Which files, in one line.

    Args:
        paths: Files that are observations of one shape, or a list of such lists: one per shape, all held by one network
            through conditions.
        reference: What is known of the true surface of one shape: a clean cloud, a mesh, or one of each.
        shape: What to call it; None: as its first file.
        num_observations: N per shape; None uses all.
    """

    def __init__(
        self,
        paths: Sequence[str] | Sequence[Sequence[str]],
        reference: Sequence[str] | None = None,
        shape: str | None = None,
        num_observations: int | None = None,
    ) -> None:
        if isinstance(paths, str) or not paths:
            raise InputError("datamodule.paths must be a list of files, e.g. 'datamodule.paths=[a.ply,b.ply]'")
        if isinstance(reference, str):
            raise InputError("datamodule.reference must be a list of files, e.g. 'datamodule.reference=[true.off]'")
        files = [[p] if isinstance(p, str) else list(p) for p in paths]
        if all(isinstance(p, str) for p in paths):
            files = [list(paths)]
        if reference and len(files) > 1:
            raise InputError(f"datamodule.reference is the truth of one shape, but datamodule.paths hold {len(files)}")
        clouds = [[_read(path) for path in observations] for observations in files]
        super().__init__(clouds, num_observations)
        self.name = shape or Path(files[0][0]).stem
        self.reference = read_reference(reference) if reference else None
        self.noisy = clouds[0][0]
        truth = f"; truth: {', '.join(reference)}" if reference else ""
        self.source = f"files {', '.join(files[0][:num_observations])}{truth}"


def _read(path: str) -> NDArray[np.float64]:
    cloud = read_cloud(path)
    return check_cloud(cloud.points[cloud.finite()], str(path))
