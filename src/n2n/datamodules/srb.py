"""Surface Reconstruction Benchmark: five simulated range scans, truth in dense clouds without normals."""

from n2n.datamodules import layouts
from n2n.datamodules.layouts import Part, data_folder
from n2n.datamodules.scans import ScanDataModule


class SRBDataModule(ScanDataModule):
    """A scan, all of its points.

    Args:
        shape: anchor, daratech, dc, gargoyle or lord_quas; None takes the first that is present.
        root: Data folder; None takes the environment's N2N_DATA, else ./data.
        num_observations: N; there is one scan.

    Source: Berger et al. 2013, files of Deep Geometric Prior (Williams et al. 2019).
    """

    dataset = "srb"

    def __init__(self, shape: str | None = None, root: str | None = None, num_observations: int | None = None) -> None:
        super().__init__(self.part(root), shape, root, num_observations)

    @classmethod
    def part(cls, root: str | None = None, variant: str | None = None) -> Part:
        return layouts.srb(data_folder(root))
