"""What the data modules of scans share: one scan as it is in the files, one observation."""

from typing import ClassVar

from n2n.datamodules.benchmark import BenchmarkDataModule, is_missing
from n2n.datamodules.catalog import dataset
from n2n.datamodules.layouts import Part, Scan, absent, pick
from n2n.datamodules.origin import shown
from n2n.datamodules.reading import read_scan


class ScanDataModule(BenchmarkDataModule):
    """A scan of a benchmark, in the coordinates of its file.

    Args:
        part: The folder that was found.
        shape: Name of the scan; None takes the first.
        root: Data folder.
        num_observations: N; there is one scan, so 1 or None.
    """

    dataset: ClassVar[str]

    def __init__(self, part: Part, shape: str | None, root: str | None, num_observations: int | None) -> None:
        scan = pick(part, shape, dataset(self.dataset).how())
        points, reference = read_scan(scan)
        super().__init__(scan.name, [points], reference, describe(scan, root), num_observations)

    @classmethod
    def part(cls, root: str | None = None, variant: str | None = None) -> Part:
        """Return the folder of a variant, present or not."""
        raise NotImplementedError

    @classmethod
    def names(cls, root: str | None = None, variant: str | None = None) -> list[str]:
        """Return the scans that are present below `root`, in official order."""
        return [scan.name for scan in cls.part(root, variant).scans]

    @classmethod
    def missing(cls, root: str | None = None, variant: str | None = None) -> str | None:
        """Say in one line what is not present and where to get it; None if all is."""
        part, how = cls.part(root, variant), dataset(cls.dataset).how()
        if not part.scans or (not part.absent and len(part.scans) < (part.expected or 0)):
            return absent(part, how)
        bare = [scan.name for scan in part.scans if scan.truth is None or not scan.truth.is_file()]
        lines = [is_missing(part.absent, f"{part.folder}: scans", how)]
        lines += [is_missing(bare, f"{part.folder}: ground truth", how)] if part.with_truth else []
        return "; ".join(filter(None, lines)) or None


def describe(scan: Scan, root: str | None) -> str:
    """Say in one line where a scan and its truth come from."""
    truth = "no ground truth" if scan.truth is None else f"truth {shown(scan.truth, root)}"
    return f"{shown(scan.path, root)} as stored, normals ignored; {truth}"
