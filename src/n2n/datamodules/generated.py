"""Noisy scans of analytic shapes: data with a known truth and no download."""

from n2n.datamodules.observations import ObservationsDataModule
from n2n.geometry.shapes import SHAPES, scan


class GeneratedDataModule(ObservationsDataModule):
    """Scans of a shape whose distance is known in closed form.

    Args:
        shape: bracket | sphere | torus.
        points: Points per observation.
        noise: Standard deviation of the Gaussian noise relative to the shape's bounding radius.
        observations: Independent scans.
        seed: Of points and noise.
        num_observations: N; None uses all.
    """

    def __init__(
        self,
        shape: str = "bracket",
        points: int = 10_000,
        noise: float = 0.01,
        observations: int = 1,
        seed: int = 0,
        num_observations: int | None = None,
    ) -> None:
        if shape not in SHAPES:
            raise ValueError(f"unknown shape {shape!r}; known: {', '.join(SHAPES)}")
        super().__init__([[scan(shape, points, noise, seed + i) for i in range(observations)]], num_observations)
