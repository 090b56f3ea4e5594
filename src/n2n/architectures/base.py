"""What every signed distance field offers to the losses and the tasks."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import torch
from torch import Tensor, nn
from torch.nn import functional

from n2n.shapes import Index, Points, Values

_ROUGHNESS_SAMPLES = 1024


class SDF(nn.Module):
    """A signed distance field f(q, c), inside negative, in unit coordinates.

    Subclasses implement `forward`; those that know their gradient in closed form override `value_and_gradient`.
    """

    def forward(self, points: Points, condition: Index | None = None) -> Values:
        """Return f at the points; `condition` is one shape index per point, None when the field holds one shape."""
        raise NotImplementedError

    def value_and_gradient(self, points: Points, condition: Index | None = None) -> tuple[Values, Points]:
        """Return f and grad f; differentiable with respect to the parameters while gradients are enabled.

        Works under `torch.no_grad()` too: the spatial gradient is always available (Eq. 3 needs it).
        """
        training = torch.is_grad_enabled()
        with torch.enable_grad():
            leaf = points.detach().requires_grad_(True) if not points.requires_grad else points
            value = self(leaf, condition)
            (gradient,) = torch.autograd.grad(value.sum(), leaf, create_graph=training)
        return (value, gradient) if training else (value.detach(), gradient.detach())

    @contextmanager
    def shared(self) -> Iterator[None]:
        """Let several evaluations at the same parameters share work; a plain network has none to share."""
        yield

    def start_from(self, distance: Callable[[Points], Values], condition: int = 0) -> None:
        """Start from an approximate signed distance, where that is cheap; a network starts from its sphere."""

    def set_band(self, points: Points, radius: float, condition: int = 0) -> None:
        """Say where the surface may lie: within `radius` of the points. `roughness` is measured there."""
        self._bands = {**getattr(self, "_bands", {}), condition: (points, radius)}

    def adapt_roughness(self) -> None:
        """Let `roughness` count less where the field bends now, where an architecture can tell; a network cannot."""

    def roughness(self, generator: torch.Generator | None = None) -> Tensor:
        """Return the integral of ||Hessian f||^2 over the band, estimated from differences of the gradient.

        Raises:
            RuntimeError: `set_band` was not called.
        """
        if not getattr(self, "_bands", None):
            raise RuntimeError("call set_band(points, radius) before roughness()")
        energy = 0.0
        for condition, (cloud, radius) in self._bands.items():
            points = cloud.to(next((p.device for p in self.parameters()), cloud.device))
            chosen = torch.randint(len(points), (_ROUGHNESS_SAMPLES,), generator=generator).to(points.device)
            offset = (2 * torch.rand(len(chosen), 3, generator=generator) - 1).to(points) * radius
            direction = functional.normalize(torch.randn(len(chosen), 3, generator=generator).to(points), dim=-1)
            here = points[chosen] + offset
            step = 0.1 * radius
            code = torch.full((len(chosen),), condition, dtype=torch.long, device=points.device)
            _, before = self.value_and_gradient(here, code)
            _, after = self.value_and_gradient(here + step * direction, code)
            # E |H d|^2 = ||H||^2 / 3 for a uniform direction d; the band's volume is counted in boxes of its radius.
            volume = len(torch.unique((points / radius).round(), dim=0)) * radius**3
            energy = energy + 3 * volume * ((after - before) / step).square().sum(-1).mean()
        return energy


class ConditionCode(nn.Module):
    """A learned code per shape, appended to the points (App. A; the released code uses a one-hot and a 128-wide layer).

    Args:
        num_conditions: Number of shapes in the network; 1 adds no code.
        width: Length of a code.
    """

    def __init__(self, num_conditions: int = 1, width: int = 128) -> None:
        super().__init__()
        self.width = width if num_conditions > 1 else 0
        self.codes = nn.Embedding(num_conditions, width) if num_conditions > 1 else None

    def append(self, points: Points, condition: Index | None) -> torch.Tensor:
        """Return (n, 3 + width)."""
        if self.codes is None:
            return points
        if condition is None:
            condition = torch.zeros(len(points), dtype=torch.long, device=points.device)
        return torch.cat([points, self.codes(condition)], dim=-1)
