"""The PU-Net test shapes, as score-denoise set them up."""

import numpy as np
from numpy.typing import NDArray

from n2n.datamodules.benchmark import BenchmarkDataModule, check_count, is_missing, noisy_copies, shown
from n2n.datamodules.catalog import dataset
from n2n.datamodules.clean import read_official, read_rows
from n2n.datamodules.clean_layouts import PU_SHAPES, punet
from n2n.datamodules.layouts import Scan, data_folder, pick
from n2n.datamodules.reading import read_scan
from n2n.geometry.checks import MIN_POINTS
from n2n.geometry.frame import Frame
from n2n.geometry.poisson import poisson_disk
from n2n.geometry.reference import Reference


class PUDataModule(BenchmarkDataModule):
    """A PU-Net test shape: Poisson-disk points in the unit sphere of the clean cloud, noise added.

    The clean cloud is the official file where there is one of that many points, else it is sampled from the mesh.

    Args:
        shape: One of the 20 names; None takes the first that is present.
        points: Points per observation.
        noise: Standard deviation relative to the radius of the clean cloud.
        noise_model: A name of `NOISE_MODELS`.
        official: Take the benchmark's noisy file as the first observation.
        reference_points: Points of the reference cloud, for up-sampling; None takes the clean cloud itself.
        seed: Of sampling and noise.
        root: Data folder; None takes the environment's N2N_DATA, else ./data.
        num_observations: N noisy copies; None for one.

    Source: score-denoise, utils/transforms.py (middle of the box, largest radius, then noise).
    """

    def __init__(
        self,
        shape: str | None = None,
        points: int = 10_000,
        noise: float = 0.01,
        noise_model: str = "gaussian",
        official: bool = False,
        reference_points: int | None = None,
        seed: int = 0,
        root: str | None = None,
        num_observations: int | None = None,
    ) -> None:
        check_count("points", points, MIN_POINTS)
        check_count("reference_points", reference_points, MIN_POINTS)
        parts = {part.label: part for part in punet(data_folder(root))}
        mesh = pick(parts["meshes"], shape, dataset("pu").how())
        files = {label: scan for label, part in parts.items() for scan in part.scans if scan.name == mesh.name}
        truth = read_scan(mesh)[1]
        world, told = _clean(mesh, files, truth, points, seed, root)
        frame = Frame.fit([world])
        clean = frame.to_unit(world)
        copies = noisy_copies(clean, noise, noise_model, seed, num_observations)
        if official:
            wanted = f"{points}_poisson_{noise:g}"
            copies[0] = frame.to_unit(read_official(files.get(wanted), f"{mesh.name}, {wanted}"))
            told += f"; first observation {shown(files[wanted].path, root)}, others"
        told += f"; {noise_model} noise {noise:g} of the radius, seed {seed}"
        if reference_points not in (None, points):
            dense, how = _clean(mesh, files, truth, reference_points, seed, root)
            clean, told = frame.to_unit(dense), f"{told}; reference {how}"
        reference = Reference(points=clean, vertices=frame.to_unit(truth.vertices), faces=truth.faces)
        super().__init__(mesh.name, copies, reference, told, num_observations)

    @classmethod
    def names(cls, root: str | None = None) -> list[str]:
        return [scan.name for scan in punet(data_folder(root))[0].scans]

    @classmethod
    def missing(cls, root: str | None = None) -> str | None:
        present = cls.names(root)
        return is_missing([name for name in PU_SHAPES if name not in present], "PU meshes", dataset("pu").how())


def _clean(
    mesh: Scan, files: dict[str, Scan], truth: Reference, points: int, seed: int, root: str | None
) -> tuple[NDArray[np.float64], str]:
    """Return the clean cloud in the coordinates of the mesh, (points, 3), and where it comes from."""
    scan = files.get(f"{points}_poisson")
    if scan is None:
        cloud = poisson_disk(truth.vertices, truth.faces, points, seed)
        return cloud, f"{shown(mesh.path, root)}, {points} Poisson-disk points, seed {seed}"
    return read_rows(scan), shown(scan.path, root)
