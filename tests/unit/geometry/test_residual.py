"""The noise of points along the normals of a known surface."""

import math

import pytest
import torch

from n2n.geometry.residual import residual_noise

NOISE = 0.02


def _sphere(points):
    return points.norm(dim=-1) - 0.5, points / points.norm(dim=-1, keepdim=True)


def _plate(half):
    """Infinite plate |z| < half, its distance only half as steep as it should be."""

    def evaluate(points):
        z = points[:, 2]
        gradient = torch.zeros_like(points)
        gradient[:, 2] = 0.5 * z.sign()
        return 0.5 * (z.abs() - half), gradient

    return evaluate


def _noisy(points, seed=0):
    return points + NOISE * torch.randn(points.shape, generator=torch.Generator().manual_seed(seed))


def _on_plate(half, count=40_000):
    random = torch.Generator().manual_seed(1)
    points = torch.rand((count, 3), generator=random) - 0.5
    points[:, 2] = half * (torch.rand(count, generator=random) - 0.5).sign()
    return points


def test_on_a_sphere_it_is_the_noise():
    directions = torch.randn((40_000, 3), generator=torch.Generator().manual_seed(2))
    points = _noisy(0.5 * directions / directions.norm(dim=-1, keepdim=True))
    assert residual_noise(_sphere, points, 2 * NOISE) == pytest.approx(NOISE, rel=0.02)


def test_inside_a_thin_wall_nothing_is_measured():
    half = NOISE
    points = _noisy(_on_plate(half))
    naive = float((points[:, 2].abs() - half).square().mean().sqrt())
    assert naive < 0.85 * NOISE
    # What is left of the other side's points outside of this one's makes it a little less.
    assert residual_noise(_plate(half), points, 2 * NOISE) == pytest.approx(NOISE, rel=0.08)


def test_it_does_not_ask_for_a_true_distance():
    points = _noisy(_on_plate(0.2))
    assert residual_noise(_plate(0.2), points, 2 * NOISE) == pytest.approx(NOISE, rel=0.08)


def test_without_room_it_is_unknown():
    assert math.isnan(residual_noise(_sphere, 0.49 * torch.eye(3), 0.75))
