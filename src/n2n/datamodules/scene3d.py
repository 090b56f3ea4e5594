"""3D Scene: indoor scans sampled at 1000 points per square metre."""

from n2n.datamodules import layouts
from n2n.datamodules.layouts import Part, data_folder
from n2n.datamodules.scans import ScanDataModule


class Scene3DDataModule(ScanDataModule):
    """A scan, all of its points.

    Args:
        shape: lounge, copyroom, ...; None takes the first that is present.
        root: Data folder; None takes the environment's N2N_DATA, else ./data.
        num_observations: N; there is one scan.

    Source: Zhou and Koltun 2013, files of CAP-UDF.
    """

    dataset = "scene3d"

    def __init__(self, shape: str | None = None, root: str | None = None, num_observations: int | None = None) -> None:
        super().__init__(self.part(root), shape, root, num_observations)

    @classmethod
    def part(cls, root: str | None = None, variant: str | None = None) -> Part:
        return layouts.scene3d(data_folder(root))
