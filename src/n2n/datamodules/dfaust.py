"""D-FAUST: scans of moving people, the selection of SAP or raw."""

from n2n.datamodules import layouts
from n2n.datamodules.layouts import Part, data_folder
from n2n.datamodules.scans import ScanDataModule


class DFaustDataModule(ScanDataModule):
    """A scan, all of its points.

    Args:
        shape: Name of a file in dfaust/, or SUBJECT/ACTION/ACTION.FRAME of a raw scan; None takes the first.
        root: Data folder; None takes the environment's N2N_DATA, else ./data.
        num_observations: N; there is one scan.

    Source: Bogo et al. 2017, files of Shape As Points (Peng et al. 2021).
    """

    dataset = "dfaust"

    def __init__(self, shape: str | None = None, root: str | None = None, num_observations: int | None = None) -> None:
        super().__init__(self.part(root), shape, root, num_observations)

    @classmethod
    def part(cls, root: str | None = None, variant: str | None = None) -> Part:
        return layouts.dfaust(data_folder(root))
