"""Paris-rue-Madame: a street in chunks of equal size."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from n2n.datamodules import layouts
from n2n.datamodules.benchmark import BenchmarkDataModule
from n2n.datamodules.catalog import dataset
from n2n.datamodules.layouts import Part, Scan, data_folder, pick
from n2n.datamodules.scans import ScanDataModule, describe
from n2n.errors import InputError
from n2n.formats import read_cloud
from n2n.geometry.checks import check_cloud
from n2n.geometry.reference import Reference


class ParisDataModule(ScanDataModule):
    """A chunk of the street.

    Args:
        shape: GT_Madame1_2 or GT_Madame1_3; None takes the first that is present.
        chunk: Which one, from 0, along the street.
        chunks: How many the street is cut into; the paper has 50 for 10 million points.
        file: Another street scan to cut instead, any readable cloud.
        root: Data folder; None takes the environment's N2N_DATA, else ./data.
        num_observations: N; there is one scan.

    Source: Serna et al. 2014.
    """

    dataset = "paris"

    def __init__(
        self,
        shape: str | None = None,
        chunk: int = 0,
        chunks: int = 50,
        file: str | None = None,
        root: str | None = None,
        num_observations: int | None = None,
    ) -> None:
        if not 0 <= chunk < chunks:
            raise InputError(f"datamodule.chunk={chunk} is out of range; give 0 to chunks - 1 = {chunks - 1}")
        if file is None:
            scan = pick(self.part(root), shape, dataset(self.dataset).how())
        else:
            scan = Scan(shape or Path(file).stem, Path(file), None, "any readable cloud")
        cloud = read_cloud(scan.path)
        street = cloud.points[cloud.finite()]
        name = f"{scan.name}_{chunk:0{len(str(chunks - 1))}d}of{chunks}"
        points = check_cloud(street[cut(street, chunks)[chunk]], f"{scan.path}, chunk {chunk} of {chunks}")
        source = f"{describe(scan, root)}; chunk {chunk} of {chunks} along the street"
        BenchmarkDataModule.__init__(self, name, [points], Reference(), source, num_observations)

    @classmethod
    def part(cls, root: str | None = None, variant: str | None = None) -> Part:
        return layouts.paris(data_folder(root))


def cut(points: NDArray[np.float64], chunks: int) -> list[NDArray[np.int64]]:
    """Cut a street across into chunks of equal counts.

    The street runs where its points spread most in the horizontal plane; towards east, or north if it leads there more.

    Args:
        points: (n, 3), z up.
        chunks: How many, at most n.

    Returns:
        Per chunk its rows, ascending; counts differ by one at most.
    """
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    along = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    along *= np.sign(along[np.abs(along).argmax()])
    order = np.argsort(flat @ along, kind="stable")
    return [np.sort(rows) for rows in np.array_split(order, chunks)]
