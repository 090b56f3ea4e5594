"""Terms that tell the field where inside is: pure terms that look at one `FieldState` and its guide."""

from torch import Tensor

from n2n.losses.state import FieldState


class ScaffoldFit:
    """Fit the field to the oriented scaffold during the first part of the fit, then leave it alone.

    Gradient descent would find the shape from a sphere too, but not reliably the right sign inside thin walls.

    Args:
        until: Share of the fit after which the term is silent, 0 to 1.
        normal_weight: Weight of |grad f - n|^2 relative to f^2, in unit^2; larger trusts the normals more.
    """

    def __init__(self, until: float = 0.2, normal_weight: float = 1e-3) -> None:
        self.until, self.normal_weight = until, normal_weight

    def __call__(self, state: FieldState) -> Tensor:
        if state.guide is None or state.progress >= self.until:
            return state.value.new_zeros(())
        value, gradient = state.evaluate(state.guide.points)
        return value.square().mean() + self.normal_weight * (gradient - state.guide.normals).square().sum(-1).mean()


class FarField:
    """Mean squared relative error of f against the signed distance to the denoised cloud, away from the surface.

    Relative, so that near and far points count alike. The loss of Eq. 5 only sees queries near the data; without this
    term sheets appear inside the shape and blobs outside it.
    """

    def __call__(self, state: FieldState) -> Tensor:
        if state.far is None:
            return state.value.new_zeros(())
        points, distance = state.far
        value, _ = state.evaluate(points)
        return ((value - distance) / distance.abs().clamp_min(1e-6)).square().mean()
