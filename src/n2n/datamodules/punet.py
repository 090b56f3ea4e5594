"""The PU-Net test shapes, as score-denoise set them up."""

from n2n.datamodules.benchmark import BenchmarkDataModule, check_count, is_missing, noisy_copies
from n2n.datamodules.catalog import dataset
from n2n.datamodules.clean import clean_cloud, in_unit, read_official
from n2n.datamodules.clean_layouts import PU_SHAPES, is_clean, punet, together
from n2n.datamodules.layouts import Part, data_folder, pick
from n2n.datamodules.origin import shown
from n2n.datamodules.reading import read_scan
from n2n.geometry.checks import MIN_POINTS
from n2n.geometry.frame import Frame


class PUDataModule(BenchmarkDataModule):
    """A PU-Net test shape: Poisson-disk points in the unit sphere of the clean cloud, noise added.

    The clean cloud is the official file where there is one of that many points, else it is sampled from the mesh. A
    shape without a mesh has its clean clouds, and what is thinned from them, as reference: no P2M.

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
        parts = punet(data_folder(root))
        name = pick(_known(parts), shape, dataset("pu").how()).name
        files = {part.label: scan for part in parts for scan in part.scans if scan.name == name}
        truth = read_scan(files["meshes"])[1] if "meshes" in files else None
        world, told = clean_cloud(files, points, seed, root, truth)
        frame = Frame.fit([world])
        clean = frame.to_unit(world)
        copies = noisy_copies(clean, noise, noise_model, seed, num_observations)
        if official:
            wanted = f"{points}_poisson_{noise:g}"
            copies[0] = frame.to_unit(read_official(files.get(wanted), f"{name}, {wanted}"))
            told += f"; first observation {shown(files[wanted].path, root)}, others"
        told += f"; {noise_model} noise {noise:g} of the radius, seed {seed}"
        if reference_points not in (None, points):
            dense, how = clean_cloud(files, reference_points, seed, root, truth)
            clean, told = frame.to_unit(dense), f"{told}; reference {how}"
        if truth is None:
            told += "; there is no mesh"
        super().__init__(name, copies, in_unit(frame, clean, truth), told, num_observations)

    @classmethod
    def names(cls, root: str | None = None) -> list[str]:
        return [scan.name for scan in _known(punet(data_folder(root))).scans]

    @classmethod
    def missing(cls, root: str | None = None) -> str | None:
        parts, how = punet(data_folder(root)), dataset("pu").how()
        present = [scan.name for scan in _known(parts).scans]
        bare = [name for name in present if name in parts[0].absent]
        lines = is_missing([name for name in PU_SHAPES if name not in present], "PU meshes", how)
        return "; ".join(filter(None, [lines, is_missing(bare, "PU meshes, for P2M,", how)])) or None


def _known(parts: list[Part]) -> Part:
    """Return the shapes of which there is a mesh or a clean cloud."""
    return together([parts[0], *(part for part in parts if is_clean(part.label))], PU_SHAPES)
