import torch

from n2n.geometry.pull import pull


def test_exact_distance_pulls_onto_the_sphere():
    points = torch.randn(200, 3, dtype=torch.float64)
    value, gradient = points.norm(dim=1) - 0.7, 3 * points  # the gradient's length must not matter
    assert torch.allclose(pull(points, value, gradient).norm(dim=1), torch.full((200,), 0.7, dtype=torch.float64))


def test_vanishing_gradient_stays_put_with_finite_slopes():
    points = torch.randn(4, 3)
    value, gradient = torch.ones(4, requires_grad=True), torch.zeros(4, 3, requires_grad=True)
    moved = pull(points, value, gradient)
    assert torch.equal(moved, points)
    moved.sum().backward()
    assert torch.isfinite(value.grad).all() and torch.isfinite(gradient.grad).all()


def test_slopes_match_finite_differences():
    inputs = (
        torch.randn(5, 3, dtype=torch.float64, requires_grad=True),
        torch.randn(5, dtype=torch.float64, requires_grad=True),
        torch.randn(5, 3, dtype=torch.float64, requires_grad=True),
    )
    assert torch.autograd.gradcheck(pull, inputs)
