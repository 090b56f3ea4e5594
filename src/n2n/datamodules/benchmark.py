"""Shapes of benchmarks: observations together with what is known of the true surface."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from n2n.datamodules.observations import ObservationsDataModule
from n2n.errors import InputError
from n2n.geometry.noise import add_noise, check_model
from n2n.geometry.reference import Reference
from n2n.registry import suggest

# Follows the seed where something else than a noisy copy is drawn: copies use [seed, k], and a sequence that is
# filled up with zeros, [seed], would repeat copy 0.
CLEAN = (0, 1)


class BenchmarkDataModule(ObservationsDataModule):
    """One shape of a benchmark with its truth.

    Attributes:
        name: Of the shape, as `names` lists it.
        reference: What is known of the true surface, in the coordinates of the observations.
        noisy: The first observation, (n, 3) float64 world coordinates, outliers included: what is to be denoised.
        source: One line: which files, how sampled, which seed.

    Args:
        name: As above.
        observations: (n_i, 3) float64 each, world coordinates.
        reference: As above.
        source: As above.
        num_observations: N; None uses all.
    """

    def __init__(
        self,
        name: str,
        observations: list[NDArray[np.float64]],
        reference: Reference,
        source: str,
        num_observations: int | None = None,
    ) -> None:
        super().__init__([observations], num_observations)
        self.name, self.reference, self.source = name, reference, source
        self.noisy = observations[0]

    @classmethod
    def names(cls, root: str | None = None) -> list[str]:
        """Return the shapes that are present below `root`, in official order."""
        raise NotImplementedError

    @classmethod
    def missing(cls, root: str | None = None) -> str | None:
        """Say in one line what is not present and where to get it; None if all is."""
        raise NotImplementedError

    @classmethod
    def check_present(cls, shape: str, root: str | None = None) -> str:
        """Return the shape's name if it is present.

        Raises:
            InputError: It is not; says what is, and where to get the rest.
        """
        present = cls.names(root)
        if shape in present:
            return shape
        known = suggest(str(shape), present) if present else " None is."
        raise InputError(f"shape {shape!r} is not present.{known} {cls.missing(root) or ''}".rstrip())


def noisy_copies(
    clean: NDArray[np.float64],
    noise: float,
    model: str,
    seed: int,
    count: int | None,
    normals: NDArray[np.float64] | None = None,
) -> list[NDArray[np.float64]]:
    """Return independent noisy copies of one clean cloud; copy k is the same for every count.

    Args:
        clean: (n, 3).
        noise: Standard deviation, in the units of `clean`.
        model: A name of `NOISE_MODELS`.
        seed: Copy k is drawn with the generator [seed, k].
        count: How many; None for one.
        normals: (n, 3) unit normals, for the models that look at the surface; None where unknown.
    """
    check_model(model, noise)
    return [add_noise(clean, model, noise, np.random.default_rng([seed, k]), normals) for k in range(count or 1)]


def check_count(name: str, value: int | None, least: int = 1) -> None:
    """Raise InputError unless the number of points asked for is a whole number in range."""
    if value is not None and (isinstance(value, bool) or not isinstance(value, int) or value < least):
        raise InputError(f"datamodule.{name}={value} is out of range; give a whole number >= {least}")


def is_missing(absent: Iterable[str], what: str, where: str) -> str | None:
    """Return one line that lists what is absent and where to get it; None if nothing is."""
    absent = list(absent)
    if not absent:
        return None
    shown = ", ".join(absent[:20]) + (f", ... ({len(absent)} in all)" if len(absent) > 20 else "")
    return f"{what} not present: {shown}; {where}"
