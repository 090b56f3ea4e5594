"""The denoising function F: move a point along the field's gradient onto the zero level set."""

from n2n.shapes import Points, Values


def pull(points: Points, value: Values, gradient: Points) -> Points:
    """Pull points onto the surface.

    Args:
        points: Query positions n, unit coordinates.
        value: Signed distances f(n), inside negative.
        gradient: grad f(n), any length.

    Returns:
        F(n) = n - f(n) * grad f(n) / ||grad f(n)||. Where the gradient vanishes the point stays where it is, and the
        backward pass is finite there too.

    Source: Ma et al. 2023, Eq. 3.
    """
    squared = gradient.square().sum(-1, keepdim=True)
    moving = squared > 1e-24
    direction = gradient * squared.where(moving, 1).rsqrt() * moving
    return points - value.unsqueeze(-1) * direction
