"""The PointCleanNet test shapes."""

from n2n.datamodules.benchmark import BenchmarkDataModule, check_count, is_missing, noisy_copies, shown
from n2n.datamodules.catalog import dataset
from n2n.datamodules.clean import read_official, read_rows
from n2n.datamodules.clean_layouts import PC_SHAPES, pcnet
from n2n.datamodules.layouts import data_folder, pick
from n2n.errors import InputError
from n2n.geometry.checks import MIN_POINTS
from n2n.geometry.frame import Frame
from n2n.geometry.poisson import thin
from n2n.geometry.reference import Reference


class PCDataModule(BenchmarkDataModule):
    """A PointCleanNet test shape: its 100 000 clean points thinned evenly, in the unit sphere, noise added.

    There are no meshes: the reference is a cloud.

    Args:
        shape: One of the 10 names; None takes the first that is present.
        points: Points per observation, at most 100 000.
        noise: Standard deviation relative to the radius of the clean cloud.
        noise_model: A name of `NOISE_MODELS`.
        official: Take the rows of the benchmark's noisy file as the first observation; its level, that is `noise`, is
            relative to the longest edge of the box there: 0.01 or one of its other files.
        reference_points: Points of the reference cloud, for up-sampling; None takes the clean cloud itself.
        seed: Of thinning and noise.
        root: Data folder; None takes the environment's N2N_DATA, else ./data.
        num_observations: N noisy copies; None for one.

    Differs: score-denoise sampled its 10 000 and 50 000 points from meshes; here they are thinned by Poisson disks
        from the points that everybody has.
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
        parts = {part.label: part for part in pcnet(data_folder(root))}
        scan = pick(parts["clean"], shape, dataset("pc").how())
        world = read_rows(scan)
        most = max(points, reference_points or points)
        if most > len(world):
            raise InputError(f"{scan.path}: holds {len(world)} points, {most} were asked for; lower datamodule.points")
        rows = thin(world, points, seed)
        frame = Frame.fit([world[rows]])
        clean = frame.to_unit(world[rows])
        copies = noisy_copies(clean, noise, noise_model, seed, num_observations)
        told = f"{shown(scan.path, root)}, {points} of {len(world)} points by Poisson disks, seed {seed}"
        if official:
            wanted = f"noise {noise:.2e}"
            twins = [twin for twin in getattr(parts.get(wanted), "scans", ()) if twin.name == scan.name]
            twin = twins[0] if twins else None
            noisy = frame.to_unit(read_official(twin, f"{scan.name}, {wanted}"))
            copies[0] = noisy[rows]
            told += f"; first observation the same rows of {shown(twin.path, root)}, others"
        told += f"; {noise_model} noise {noise:g} of the radius, seed {seed}"
        if reference_points not in (None, points):
            clean = frame.to_unit(world[thin(world, reference_points, seed)])
            told += f"; reference {reference_points} points"
        super().__init__(scan.name, copies, Reference(points=clean), told, num_observations)

    @classmethod
    def names(cls, root: str | None = None) -> list[str]:
        return [scan.name for scan in pcnet(data_folder(root))[0].scans]

    @classmethod
    def missing(cls, root: str | None = None) -> str | None:
        present = cls.names(root)
        return is_missing([name for name in PC_SHAPES if name not in present], "PC clouds", dataset("pc").how())
