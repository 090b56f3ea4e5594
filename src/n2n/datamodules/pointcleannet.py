"""The PointCleanNet test shapes."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from n2n.datamodules.benchmark import BenchmarkDataModule, check_count, is_missing, noisy_copies
from n2n.datamodules.catalog import dataset
from n2n.datamodules.clean import clean_cloud, in_unit, read_official, read_rows
from n2n.datamodules.clean_layouts import PC_SHAPES, is_clean, pcnet, together
from n2n.datamodules.layouts import Part, Scan, data_folder, pick
from n2n.datamodules.origin import is_made, shown
from n2n.datamodules.reading import read_scan
from n2n.datamodules.registration import on_surface
from n2n.errors import InputError
from n2n.geometry.checks import MIN_POINTS
from n2n.geometry.frame import Frame
from n2n.geometry.poisson import thin
from n2n.geometry.reference import Reference


class PCDataModule(BenchmarkDataModule):
    """A PointCleanNet test shape: its 100 000 clean points thinned evenly, in the unit sphere, noise added.

    The clean cloud is score-denoise's file where there is one of that many points. Meshes are used where they are
    present and the cloud lies on them; else the reference is a cloud: no P2M.

    Args:
        shape: One of the 10 names; None takes the first that is present.
        points: Points per observation, at most 100 000.
        noise: Standard deviation relative to the radius of the clean cloud; with `official` of PointCleanNet, to the
            longest edge of the box.
        noise_model: A name of `NOISE_MODELS`.
        official: Take a noisy file as the first observation: score-denoise's example if there is one of these points
            and noise, relative to the radius, else the rows of PointCleanNet's, whose level is relative to the longest
            edge of the box: 0.0025, 0.005, 0.01, 0.015 or 0.025. Other observations have the same level.
        reference_points: Points of the reference cloud, for up-sampling; None takes the clean cloud itself.
        seed: Of thinning and noise.
        root: Data folder; None takes the environment's N2N_DATA, else ./data.
        num_observations: N noisy copies; None for one.

    Differs: score-denoise sampled its 10 000 and 50 000 points from meshes; here they are thinned by Poisson disks
        from the points that everybody has, where its files are not present.
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
        parts = pcnet(data_folder(root))
        name = pick(_known(parts), shape, dataset("pc").how()).name
        files = {part.label: scan for part in parts for scan in part.scans if scan.name == name}
        twin = _twin(files, points, noise, root) if official else None
        first, edge = None, None
        if twin is not None:
            files = {label: scan for label, scan in files.items() if not label.endswith("_poisson")}
            world, first, edge, told = _twin_rows(files["clean"], twin, points, seed, root)
        else:
            world, told = clean_cloud(files, points, seed, root)
            if official:
                example = files.get(f"{points}_poisson_{noise:g}")
                first = read_official(example, f"{name}, noise {noise:.2e}")
                told += f"; first observation {shown(example.path, root)}, others"
        frame = Frame.fit([world])
        clean = frame.to_unit(world)
        deviation, unit = (noise, "the radius") if edge is None else (noise * edge / frame.scale, "the longest edge")
        copies = noisy_copies(clean, deviation, noise_model, seed, num_observations)
        if first is not None:
            copies[0] = frame.to_unit(first)
        told += f"; {noise_model} noise {noise:g} of {unit}, seed {seed}"
        if reference_points not in (None, points):
            stored = files.get(f"{points}_poisson")
            dense, how = clean_cloud(files, reference_points, seed, root, beside=stored.path if stored else None)
            clean, told = frame.to_unit(dense), f"{told}; reference {how}"
        mesh, remark = _mesh(files.get("meshes"), world, root)
        super().__init__(name, copies, in_unit(frame, clean, mesh), told + remark, num_observations)

    @classmethod
    def names(cls, root: str | None = None) -> list[str]:
        return [scan.name for scan in _known(pcnet(data_folder(root))).scans]

    @classmethod
    def missing(cls, root: str | None = None) -> str | None:
        present = cls.names(root)
        return is_missing([name for name in PC_SHAPES if name not in present], "PC clouds", dataset("pc").how())


def _known(parts: list[Part]) -> Part:
    """Return the shapes of which there is a clean cloud."""
    return together([part for part in parts if is_clean(part.label)], PC_SHAPES)


def _twin(files: Mapping[str, Scan], points: int, noise: float, root: str | None) -> Scan | None:
    """Return PointCleanNet's noisy file, unless there is one of score-denoise, whose level is of another length."""
    example, label = files.get(f"{points}_poisson_{noise:g}"), f"noise {noise:.2e}"
    if (example and not is_made(example.path, root)) or "clean" not in files or float(label.split()[1]) != noise:
        return None
    return files.get(label)


def _twin_rows(
    scan: Scan, twin: Scan, points: int, seed: int, root: str | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], float, str]:
    """Return the same rows of the clean and the noisy cloud, (points, 3), the clean box's longest edge, and a word."""
    clean, noisy = read_rows(scan), read_rows(twin)
    if points > len(clean):
        raise InputError(f"{scan.path}: holds {len(clean)} points, {points} were asked for; lower datamodule.points")
    rows = thin(clean, points, seed)
    told = f"{shown(scan.path, root)}, {points} of {len(clean)} points by Poisson disks, seed {seed}"
    told += f"; first observation the same rows of {shown(twin.path, root)}, others"
    return clean[rows], noisy[rows], float(np.ptp(clean, axis=0).max()), told


def _mesh(scan: Scan | None, clean: NDArray[np.float64], root: str | None) -> tuple[Reference | None, str]:
    """Return the mesh of a shape if the clean cloud lies on it, and a word for `source`."""
    if scan is None:
        return None, ""
    try:
        mesh = read_scan(scan)[1]
    except InputError:
        return None, f"; {shown(scan.path, root)} left aside, it cannot be read"
    if not on_surface(clean, mesh):
        return None, f"; {shown(scan.path, root)} left aside, the cloud does not lie on it"
    return mesh, f"; mesh {shown(scan.path, root)}"
