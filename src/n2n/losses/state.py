"""What a regulariser may look at in one optimiser step."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from n2n.shapes import Index, Points, Values


@dataclass(frozen=True)
class Guide:
    """What the data says about inside and outside before any learning.

    Attributes:
        points, normals: Oriented samples of the surface (normals outwards), (s, 3) each.
        far_points: Positions of the box that are clearly off the surface, (m, 3).
        far_signs: -1 inside, +1 outside, (m,).
        area: Surface area.
        far_lids: Distances of the far points to where the surface is closed without data, (m,); infinite for nowhere.
    """

    points: Points
    normals: Points
    far_points: Float[Tensor, "m 3"]
    far_signs: Float[Tensor, " m"]
    area: float
    far_lids: Float[Tensor, " m"] | None = None


@dataclass
class FieldState:
    """The batch of one optimiser step, evaluated.

    Attributes:
        field: The SDF; terms may evaluate it elsewhere.
        queries: n, unit coordinates.
        value, gradient: f(n) and grad f(n).
        pulled: F(n), Eq. 3.
        targets: Noisy points the queries are matched to.
        condition: Index of the shape the batch is from.
        denoised: A larger denoised set of the same shape, detached; for terms with a true attribute `needs_denoised`,
            else perhaps None.
        guide: Oriented surface samples and signs far from the surface, or None.
        far: Positions off the surface and their signed distances to the denoised set, or None.
        progress: Finished share of the fit, 0 to 1.
        generator: CPU generator of this step.
    """

    field: Any
    queries: Points
    value: Values
    gradient: Points
    pulled: Points
    targets: Float[Tensor, "t 3"]
    condition: int = 0
    denoised: Float[Tensor, "m 3"] | None = None
    guide: Guide | None = None
    far: tuple[Tensor, Tensor] | None = None
    progress: float = 0.0
    generator: torch.Generator = field(default_factory=torch.Generator)

    def evaluate(self, points: Points) -> tuple[Tensor, Tensor]:
        """Return f and grad f of this batch's shape at other points."""
        return self.field.value_and_gradient(points, self.codes(len(points)))

    def codes(self, count: int) -> Index:
        """Return the condition as one index per point."""
        return torch.full((count,), self.condition, dtype=torch.long, device=self.queries.device)

    @cached_property
    def at_targets(self) -> tuple[Tensor, Tensor]:
        """f and grad f at the targets, evaluated once per step however many terms ask."""
        return self.evaluate(self.targets)
