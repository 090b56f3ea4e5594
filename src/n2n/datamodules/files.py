"""Observations read from the user's own files."""

from collections.abc import Sequence

from n2n.datamodules.observations import ObservationsDataModule
from n2n.errors import InputError
from n2n.formats import read_cloud
from n2n.geometry.checks import check_cloud


class FilesDataModule(ObservationsDataModule):
    """Noisy observations in files.

    Args:
        paths: Files that are observations of one shape, or a list of such lists: one per shape, all held by one network
            through conditions.
        num_observations: N per shape; None uses all.
    """

    def __init__(self, paths: Sequence[str] | Sequence[Sequence[str]], num_observations: int | None = None) -> None:
        if isinstance(paths, str) or not paths:
            raise InputError("datamodule.paths must be a list of files, e.g. 'datamodule.paths=[a.ply,b.ply]'")
        shapes = [[p] if isinstance(p, str) else list(p) for p in paths]
        if all(isinstance(p, str) for p in paths):
            shapes = [list(paths)]
        super().__init__([[_read(path) for path in shape] for shape in shapes], num_observations)


def _read(path: str):
    cloud = read_cloud(path)
    return check_cloud(cloud.points[cloud.finite()], str(path))
