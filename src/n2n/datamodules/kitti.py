"""KITTI: single turns of a laser scanner on a car's roof."""

from n2n.datamodules import layouts
from n2n.datamodules.layouts import Part, data_folder
from n2n.datamodules.scans import ScanDataModule
from n2n.errors import InputError

SPLITS = ("training", "testing")


class KittiDataModule(ScanDataModule):
    """A frame: all points of one turn, in metres, the scanner at the origin.

    Args:
        frame: Its number.
        split: training | testing.
        root: Data folder; None takes the environment's N2N_DATA, else ./data.
        num_observations: N; there is one scan.

    Source: KITTI object benchmark (Geiger et al. 2012); the paper names no frame.
    """

    dataset = "kitti"

    def __init__(
        self,
        frame: int | str = 0,
        split: str = "training",
        root: str | None = None,
        num_observations: int | None = None,
    ) -> None:
        if not str(frame).isdecimal():
            raise InputError(f"datamodule.frame={frame} is no frame number; give a whole number such as 7 or 000007")
        super().__init__(self.part(root, split), f"{int(frame):06d}", root, num_observations)

    @classmethod
    def part(cls, root: str | None = None, variant: str | None = None) -> Part:
        """Return the folder of a split.

        Raises:
            InputError: Unknown split.
        """
        split = variant or SPLITS[0]
        if split not in SPLITS:
            raise InputError(f"datamodule.split={split} is unknown; choose one of: {', '.join(SPLITS)}")
        return layouts.kitti(data_folder(root), split)
