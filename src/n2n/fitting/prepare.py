"""What is found out about the data before the first optimiser step: scales, scaffolds, every `auto`."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from n2n.architectures.base import SDF
from n2n.datamodules.observations import ObservationsDataModule
from n2n.fitting.auto import Chosen, choose, fill, measure
from n2n.geometry.scaffold import Scaffold
from n2n.geometry.scale import Scales
from n2n.losses.state import Guide


@dataclass
class Shape:
    """One shape's observations, measured.

    Attributes:
        observations: (n_i, 3) each, unit coordinates.
        scales: Their noise and spacing, as measured.
        chosen: What these decided.
        sample: (m, 3), some of all their points.
        scaffold: Oriented local fit, where the recipe wants one.
    """

    observations: list[torch.Tensor]
    scales: Scales
    chosen: Chosen
    sample: NDArray[np.float64]
    scaffold: Scaffold | None

    def start(self, field: SDF, condition: int) -> None:
        """Tell a new field where the surface may lie and, from the scaffold, where inside is."""
        field.set_band(torch.cat(self.observations[:50]), self.chosen.band, condition)
        if self.scaffold is not None:
            field.start_from(_as_tensors(self.scaffold.distance), condition)

    def guide(self, device: torch.device, seed: int) -> Guide | None:
        """Return what the terms of the loss may ask about inside and outside."""
        if self.scaffold is None:
            return None
        chosen, scaffold = self.chosen, self.scaffold
        far, signs, lids = scaffold.far_field(self.sample, chosen.lower, chosen.upper, chosen.margin, seed)
        points, normals, far, signs, lids = (
            torch.as_tensor(x, dtype=torch.float32, device=device)
            for x in (scaffold.points, scaffold.normals, far, signs, lids)
        )
        return Guide(points, normals, far, signs, chosen.area, lids)


def prepare(data: ObservationsDataModule, config: dict[str, Any]) -> list[Shape]:
    """Measure every shape on a sample of its points, and build a scaffold of it where the recipe wants one."""
    shapes = []
    for clouds in data.shapes:
        arrays = [cloud.double().numpy() for cloud in clouds]
        scales, sample = measure(arrays, config["seed"])
        scaffold = Scaffold.build(sample, scales, config["seed"]) if config["scaffold"] else None
        shapes.append(Shape(clouds, scales, choose(scales, arrays), sample, scaffold))
    return shapes


def fill_config(config: dict[str, Any], shapes: list[Shape], device: torch.device) -> dict[str, Any]:
    """Replace every `auto`; shapes that share one network share the finest choice.

    Raises:
        ConfigError: An `auto` where nothing can be chosen from the data.
    """
    chosen = [shape.chosen for shape in shapes]
    finest = min(chosen, key=lambda choice: choice.voxel)
    box = {
        "architecture.lower": [min(c.lower[a] for c in chosen) for a in range(3)],
        "architecture.upper": [max(c.upper[a] for c in chosen) for a in range(3)],
    }
    return fill(config, {**finest.values(config), **box, "device": str(device)})


def _as_tensors(function: Callable[[np.ndarray], np.ndarray]) -> Callable[[torch.Tensor], torch.Tensor]:
    return lambda points: torch.as_tensor(function(points.double().cpu().numpy()))
