"""The regulariser R of Eq. 7 and its variants: pure terms that look at one `FieldState`."""

from typing import Any

import torch
from jaxtyping import Float
from scipy.spatial import cKDTree
from torch import Tensor

from n2n.losses.state import FieldState
from n2n.shapes import Points


def nearest_distance(points: Points, cloud: Float[Tensor, "m 3"]) -> Tensor:
    """Return the distance of each point to its nearest cloud point; differentiable in both, finite slope at zero."""
    index = _nearest(points.detach(), cloud.detach())
    return (points - cloud[index]).square().sum(-1).clamp_min(1e-20).sqrt()


def _nearest(points: Tensor, cloud: Tensor, chunk: int = 4096) -> Tensor:
    """Return the index of the nearest cloud point: by a tree on CPUs, where all pairs of a batch take seconds."""
    if points.device.type == "cpu":
        # A field that has diverged is reported with its loss, not here.
        tree = cKDTree(cloud.nan_to_num().numpy())
        return torch.as_tensor(tree.query(points.nan_to_num().numpy(), workers=torch.get_num_threads())[1])
    return torch.cat([torch.cdist(part, cloud).argmin(dim=1) for part in points.split(chunk)])


class NoRegulariser:
    """R = 0."""

    def __call__(self, state: FieldState) -> Tensor:
        return state.value.new_zeros(())


class Consistency:
    """Geometric consistency: mean over queries of max(0, |f(n)| - distance of n to the denoised points).

    F(n) lies exactly |f(n)| from n, so the excess is never negative and measures by how much another denoised point is
    closer than the one n was pulled to.

    Args:
        against: `batch` (the pulled batch, as printed) or `larger` (the batch and the larger denoised set).

    Source: Ma et al. 2023, Eq. 6.
    """

    def __init__(self, against: str = "batch") -> None:
        if against not in ("batch", "larger"):
            raise ValueError(f"against must be 'batch' or 'larger', got {against!r}")
        self.against = against
        self.needs_denoised = against == "larger"

    def __call__(self, state: FieldState) -> Tensor:
        cloud = state.pulled
        if self.against == "larger" and state.denoised is not None:
            cloud = torch.cat([cloud, state.denoised])
        return (state.value.abs() - nearest_distance(state.queries, cloud)).relu().mean()


class ConsistencyTarget:
    """The released code's variant: mean distance of each denoised point to the nearest noisy target.

    Source: script released with Ma et al. 2023. Differs from Eq. 6, which measures queries against denoised points.
    """

    def __call__(self, state: FieldState) -> Tensor:
        return nearest_distance(state.pulled, state.targets).mean()


class ZeroLevel:
    """Mean |f(F(n))|: pulled points lie on the zero level set. Offered by the released code as more robust."""

    def __call__(self, state: FieldState) -> Tensor:
        return state.evaluate(state.pulled)[0].abs().mean()


class Eikonal:
    """Mean (||grad f|| - 1)^2: f is a distance.

    Args:
        at: `queries` or `targets`.

    Source: Gropp et al. 2020, Implicit Geometric Regularization, Eq. 2.
    """

    def __init__(self, at: str = "queries") -> None:
        if at not in ("queries", "targets"):
            raise ValueError(f"at must be 'queries' or 'targets', got {at!r}")
        self.at = at

    def __call__(self, state: FieldState) -> Tensor:
        gradient = state.gradient if self.at == "queries" else state.at_targets[1]
        norm = gradient.square().sum(-1).clamp_min(1e-20).sqrt()
        return (norm - 1).square().mean()


class OnSurface:
    """Mean f(t)^2 over the noisy targets.

    This is the noise-to-noise distance of a cloud to itself (Eq. 5 allows i = j): every F(t) is matched to its own t,
    which costs |F(t) - t| = |f(t)|.
    """

    def __call__(self, state: FieldState) -> Tensor:
        return state.at_targets[0].square().mean()


class Smoothness:
    """Thin-plate energy of the field around the surface: the integral of ||Hessian f||^2 over the field's band.

    Args:
        adapt_from: Share of the fit after which the energy counts less where the field bends already, so that edges
            stay and flat parts become flat; 1 for never. Known to the grid only.
    """

    def __init__(self, adapt_from: float = 1.0) -> None:
        self.adapt_from = adapt_from

    def begin(self, field: Any, progress: float) -> None:
        """Look at the field anew, once per matching."""
        if progress >= self.adapt_from:
            field.adapt_roughness()

    def __call__(self, state: FieldState) -> Tensor:
        return state.field.roughness(state.generator)
