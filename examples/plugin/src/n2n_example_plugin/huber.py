"""Earth mover's distance under Huber's cost."""

from torch import Tensor

from n2n.shapes import LeafIndex, Leaves
from n2n.transport.assignment import exact_assignment


class HuberEMD:
    """Exact one-to-one matching, measured by a cost that is squared near zero and linear far away.

    Args:
        delta: Distance at which the cost turns linear, unit coordinates, > 0.

    Source: Huber 1964, Robust Estimation of a Location Parameter.
    """

    def __init__(self, delta: float = 0.05) -> None:
        if not delta > 0:
            raise ValueError(f"delta must be > 0, got {delta}")
        self.delta = delta

    def match(self, moved: Leaves, target: Leaves) -> LeafIndex:
        """Return for each moved point the index of its target, (b, k)."""
        return exact_assignment(moved.detach(), target, 1)

    def __call__(self, moved: Leaves, target: Leaves, plan: LeafIndex | None = None) -> Tensor:
        """Return the mean Huber cost of the matched pairs, unit coordinates."""
        plan = self.match(moved, target) if plan is None else plan
        squared = (moved - target.gather(1, plan[..., None].expand(-1, -1, 3))).square().sum(-1)
        near = squared <= self.delta**2
        # The square root never sees zero, whose slope is infinite.
        length = squared.where(~near, 1.0).sqrt()
        return (squared / (2 * self.delta)).where(near, length - self.delta / 2).mean()
