"""ABC and FAMOUS as published with Points2Surf: simulated time-of-flight scans and their meshes."""

from typing import ClassVar

from n2n.datamodules import layouts
from n2n.datamodules.layouts import Part, data_folder
from n2n.datamodules.scans import ScanDataModule
from n2n.errors import InputError
from n2n.registry import suggest


class Points2SurfDataModule(ScanDataModule):
    """A scan of one of the families.

    Args:
        shape: A name in `testset.txt`; None takes the first that is present.
        variant: Which noise and density.
        root: Data folder; None takes the environment's N2N_DATA, else ./data.
        num_observations: N; there is one scan.

    Source: Points2Surf (Erler et al. 2020).
    """

    variants: ClassVar[tuple[str, ...]]

    def __init__(
        self,
        shape: str | None = None,
        variant: str | None = None,
        root: str | None = None,
        num_observations: int | None = None,
    ) -> None:
        super().__init__(self.part(root, variant), shape, root, num_observations)

    @classmethod
    def part(cls, root: str | None = None, variant: str | None = None) -> Part:
        """Return the folder of a variant, named in full (`famous_dense`) or without the family (`dense`).

        Raises:
            InputError: Unknown variant.
        """
        full = cls.variants[0] if variant is None else variant
        full = full if full in cls.variants else f"{cls.dataset}_{full}"
        if full not in cls.variants:
            hint = suggest(str(variant), [*cls.variants])
            raise InputError(f"datamodule.variant={variant} of {cls.dataset} is unknown.{hint}")
        return layouts.points2surf(data_folder(root), full)


class ABCDataModule(Points2SurfDataModule):
    """Variants: abc (noise of the scanner varies, 0 to 5 % of the longest edge), abc_noisefree, abc_extra_noisy (5 %),
    abc_minimal (the three shapes that come with the code)."""

    dataset, variants = "abc", layouts.ABC


class FamousDataModule(Points2SurfDataModule):
    """Variants: famous_original (noise of 1 % of the longest edge), famous_noisefree, famous_dense, famous_sparse,
    famous_extra_noisy (5 %)."""

    dataset, variants = "famous", layouts.FAMOUS
