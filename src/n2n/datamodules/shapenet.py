"""ShapeNet in the layout of Occupancy Networks."""

import numpy as np
from numpy.typing import NDArray

from n2n.datamodules.benchmark import CLEAN, BenchmarkDataModule, check_count, is_missing, noisy_copies
from n2n.datamodules.catalog import dataset
from n2n.datamodules.clean_layouts import shapenet
from n2n.datamodules.layouts import Part, Scan, data_folder, pick
from n2n.datamodules.origin import shown
from n2n.errors import InputError, N2NError
from n2n.formats import read_cloud
from n2n.geometry.checks import MIN_POINTS, check_cloud
from n2n.geometry.reference import Reference
from n2n.registry import suggest

# The classes of the benchmark, under the names of the paper's tables.
CLASSES = {
    "airplane": "02691156", "bench": "02828884", "cabinet": "02933112", "car": "02958343", "chair": "03001627",
    "display": "03211117", "lamp": "03636649", "speaker": "03691459", "rifle": "04090263", "sofa": "04256520",
    "table": "04379243", "telephone": "04401088", "vessel": "04530566",
}  # fmt: skip


class ShapeNetDataModule(BenchmarkDataModule):
    """A ShapeNet test shape: points drawn from the 100 000 stored ones, noise added; the stored frame is kept.

    Args:
        shape: `bench/ID` or `02828884/ID`; a class alone takes its first test shape, None the first of all.
        points: Points of the clean cloud under each observation, drawn with replacement.
        noise: Standard deviation in the stored unit cube: the longest edge of the original mesh is 1.
        noise_model: A name of `NOISE_MODELS`.
        seed: Of the draw and the noise.
        root: Data folder; None takes the environment's N2N_DATA, else ./data.
        num_observations: N noisy copies of the one clean cloud; None for one.

    Source: ConvONet, configs/pointcloud/shapenet_3plane.yaml and src/data/transforms.py.
    """

    def __init__(
        self,
        shape: str | None = None,
        points: int = 3000,
        noise: float = 0.005,
        noise_model: str = "gaussian",
        seed: int = 0,
        root: str | None = None,
        num_observations: int | None = None,
    ) -> None:
        check_count("points", points, MIN_POINTS)
        label, scan = _find(shape, shapenet(data_folder(root)))
        stored, normals = _read(scan)
        rows = np.random.default_rng([seed, *CLEAN]).integers(len(stored), size=points)
        copies = noisy_copies(stored[rows], noise, noise_model, seed, num_observations, normals[rows])
        told = f"{shown(scan.path, root)}, {points} points drawn with replacement"
        told += f"; {noise_model} noise {noise:g} of the unit cube, seed {seed}"
        reference = Reference(points=stored, normals=normals)
        super().__init__(f"{label}/{scan.name}", copies, reference, told, num_observations)

    @classmethod
    def names(cls, root: str | None = None) -> list[str]:
        parts = {part.label: part for part in shapenet(data_folder(root))}
        return [f"{name}/{scan.name}" for name, label in CLASSES.items() for scan in parts[label].scans]

    @classmethod
    def missing(cls, root: str | None = None) -> str | None:
        parts = {part.label: part for part in shapenet(data_folder(root))}
        gaps = {name: (len(parts[label].scans), parts[label].expected or 0) for name, label in CLASSES.items()}
        absent = [
            f"{name} ({CLASSES[name]})" if not found else f"{name} ({listed - found} of {listed} listed in test.lst)"
            for name, (found, listed) in gaps.items()
            if not found or found < listed
        ]
        return is_missing(absent, "ShapeNet classes", dataset("shapenet").how())


def _find(shape: str | None, parts: list[Part]) -> tuple[str, Scan]:
    """Return the English name of the class and the shape's files."""
    english = {label: name for name, label in CLASSES.items()}
    part_of = {part.label: part for part in parts}
    get = dataset("shapenet").how()
    if shape is None:
        found = next((part for part in parts if part.scans), parts[0])
        return english[found.label], pick(found, None, get)
    group, _, identity = str(shape).partition("/")
    label = CLASSES.get(group, group)
    if label not in part_of:
        raise InputError(f"ShapeNet has no class {group!r}.{suggest(group, [*CLASSES])}")
    return english[label], pick(part_of[label], identity or None, get)


def _read(scan: Scan) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the stored points and unit normals, (n, 3) each."""
    try:
        cloud = read_cloud(scan.path)
        normals = np.asarray(cloud.attributes.get("normals", ()), np.float64)
        if normals.shape != cloud.points.shape or len(cloud) != scan.count:
            raise InputError(f"{scan.path}: holds points {cloud.points.shape} and normals {normals.shape}")
        if not np.isfinite(normals).all():
            raise InputError(f"{scan.path}: holds normals that are NaN or infinite")
        points = check_cloud(cloud.points, str(scan.path))
        extent = float(np.ptp(points, axis=0).max())
        if scan.largest is not None and not extent < scan.largest:
            raise InputError(f"{scan.path}: the longest edge is {extent:.3g}, not 1; the cloud is not in the unit cube")
    except N2NError as error:
        raise InputError(f"{error}; expected {scan.layout}") from error
    return points, normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
