"""Curvature of surfaces whose curvature is known in closed form, and where noise carries their points."""

import math

import pytest
import torch

from n2n.geometry.curvature import curvature as _curvature
from n2n.geometry.curvature import noise_shift


def _generator(seed=0):
    return torch.Generator().manual_seed(seed)


def _normal(*shape, seed=0):
    return torch.randn(*shape, generator=_generator(seed), dtype=torch.float64)


def _sphere(radius, count=200, seed=0):
    return radius * torch.nn.functional.normalize(_normal(count, 3, seed=seed), dim=1)


def _slope(field):
    """The gradient of a field, by autograd."""

    def gradient(points):
        leaf = points.detach().requires_grad_()
        return torch.autograd.grad(field(leaf).sum(), leaf)[0]

    return gradient


def curvature(gradient, points, step):
    return _curvature(gradient, points, torch.nn.functional.normalize(gradient(points), dim=1), step)


def _graph(height):
    """The field z - height(x, y): inside is below."""
    return lambda points: points[:, 2] - height(points[:, 0], points[:, 1])


def _on_graph(height, count=100):
    x, y = _normal(count, seed=1), _normal(count, seed=2)
    return torch.stack([x, y, height(x, y)], 1)


@pytest.mark.parametrize("radius", [0.2, 1.0, 3.0])
def test_a_sphere_has_two_over_its_radius(radius):
    found = curvature(lambda points: points, _sphere(radius), 1e-3 * radius)
    assert torch.allclose(found, torch.full_like(found, 2 / radius), rtol=1e-5)


def test_it_is_the_level_set_through_each_point_that_counts():
    points = torch.cat([_sphere(0.3), _sphere(0.9, seed=1)])
    found = curvature(_slope(lambda p: p.norm(dim=1) - 0.5), points, 1e-4)
    assert torch.allclose(found, 2 / points.norm(dim=1), rtol=1e-5)


def test_a_cylinder_has_one_over_its_radius_and_a_plane_none():
    points = 0.5 * _normal(200, 3) + torch.tensor([2.0, 0, 0])
    axis = torch.nn.functional.normalize(torch.tensor([1.0, -2, 0.5], dtype=torch.float64), dim=0)

    def off_axis(p):
        return (p - (p @ axis)[:, None] * axis).norm(dim=1)

    assert torch.allclose(curvature(_slope(off_axis), points, 1e-4), 1 / off_axis(points), rtol=1e-5)
    assert curvature(lambda p: axis.expand_as(p), points, 1e-3).abs().max() < 1e-9


def test_a_torus_bulges_outside_and_less_in_its_hole():
    wide, thin = 1.0, 0.3
    angle, around = (2 * math.pi * torch.rand(100, generator=_generator(s), dtype=torch.float64) for s in (0, 1))
    ring = wide + thin * angle.cos()
    points = torch.stack([ring * around.cos(), ring * around.sin(), thin * angle.sin()], 1)
    field = _slope(lambda p: ((p[:, :2].norm(dim=1) - wide).square() + p[:, 2].square()).sqrt() - thin)
    assert torch.allclose(curvature(field, points, 1e-4), 1 / thin + angle.cos() / ring, rtol=1e-5)


@pytest.mark.parametrize(("a", "b"), [(0.7, -0.7), (1.0, -0.4), (-0.5, -0.8)])
def test_a_saddle_and_a_bowl_follow_the_formula_of_a_graph(a, b):
    def height(x, y):
        return (a * x**2 + b * y**2) / 2

    points = _on_graph(height)
    u, v = a * points[:, 0], b * points[:, 1]
    expected = -((1 + v**2) * a + (1 + u**2) * b) / (1 + u**2 + v**2) ** 1.5
    found = curvature(_slope(_graph(height)), points, 1e-4)
    assert torch.allclose(found, expected, atol=1e-5)
    assert torch.allclose(
        curvature(_slope(_graph(height)), torch.zeros(1, 3, dtype=torch.float64), 1e-4),
        torch.tensor([-(a + b)], dtype=torch.float64),
        atol=1e-6,
    )


def test_seen_from_the_other_side_it_changes_sign():
    points = _sphere(0.5)
    assert torch.allclose(curvature(lambda p: -p, points, 1e-3), torch.full((200,), -4.0).double(), rtol=1e-4)


def test_the_length_of_the_gradient_does_not_matter():
    points = _sphere(0.5)

    def stretched(p):
        return p * (2 + (7 * p).sin().sum(1, keepdim=True)).exp()

    expected = curvature(lambda p: p, points, 0.05)
    assert torch.allclose(curvature(stretched, points, 0.05), expected, rtol=1e-10)


def test_bends_shorter_than_the_step_are_averaged_over():
    # A ripple of exactly two steps: the normals ahead and behind are the same.
    field = _slope(_graph(lambda x, y: 0.02 * torch.sin(2 * math.pi * x / 0.1)))
    points = torch.tensor([[0.025, 0.3, 0.02], [0.075, 0, -0.02]], dtype=torch.float64)
    assert curvature(field, points, 1e-3)[0] > 50
    assert curvature(field, points, 0.05).abs().max() < 1e-9


def _mean_shift(dimensions, radius, noise):
    """How far outwards noise moves points at a radius, on average over many draws."""
    start = torch.zeros(dimensions, dtype=torch.float64)
    start[0] = radius
    moved = noise * _normal(400_000, dimensions)
    # Draws in pairs of opposite sign: what is left is second order.
    return ((start + moved).norm(dim=1) + (start - moved).norm(dim=1)).mean().item() / 2 - radius


@pytest.mark.parametrize("radius", [0.02, 0.05, 0.1])
def test_of_a_thin_part_only_the_near_side_counts(radius):
    # A plate: along the normal, a step of 0.05 would compare both of its sides.
    plate = _slope(lambda p: p[:, 2].abs() - radius)
    points = torch.tensor([[0.3, 0.1, radius], [0.2, 0.4, -radius]], dtype=torch.float64)
    assert curvature(plate, points, 0.05).abs().max() < 1e-9


@pytest.mark.parametrize("noise", [0.05, 0.1, 0.2, 0.26, 0.65, 1.3, 2.6])
@pytest.mark.parametrize(("dimensions", "directions"), [(3, 2), (2, 1)])
def test_noise_lies_outside_of_spheres_and_cylinders_by_the_shift(dimensions, directions, noise):
    radius = 1.3
    expected = _mean_shift(dimensions, radius, noise)
    assert expected > 0
    tolerance = 0.005 if dimensions == 2 else 0.03 if noise <= 0.1 else 0.12
    assert noise_shift(torch.tensor([directions / radius]), noise).item() == pytest.approx(expected, rel=tolerance)


def test_the_shift_has_the_sign_of_the_curvature_and_ends_at_the_noise_of_a_line():
    most = 0.1 * math.sqrt(math.pi / 2)
    shift = noise_shift(torch.tensor([-1e6, -0.4, 0.0, 0.4, 1e6]), 0.1)
    assert shift.tolist() == pytest.approx([-most, -0.002, 0, 0.002, most], rel=1e-3)
    assert not noise_shift(torch.tensor([-3.0, 5.0]), 0.0).any()


def test_the_shift_grows_without_a_jump():
    shift = noise_shift(torch.linspace(0, 40, 100_001, dtype=torch.float64), 0.1)
    assert (shift.diff() >= 0).all()
    assert shift.diff().max() < 5e-6
