"""What a regulariser may look at in one optimiser step."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import torch
from torch import Tensor

from n2n.shapes import Index, Points, Values


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
        denoised: A larger denoised set of the same shape, detached, or None.
        progress: Finished share of the fit, 0 to 1.
        generator: CPU generator of this step.
    """

    field: Any
    queries: Points
    value: Values
    gradient: Points
    pulled: Points
    targets: Points
    condition: int = 0
    denoised: Points | None = None
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
