"""Denoised and upsampled points of an exact sphere."""

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from n2n.architectures.base import SDF
from n2n.errors import InputError
from n2n.geometry.frame import Frame
from n2n.tasks import points as module
from n2n.tasks.field import Field
from n2n.testing import Ball

UTM = np.array([5e5, 5e6, 100.0])


class Sloped(Ball):
    """The distance to a sphere times a slope: what a fit gives, a distance to first order."""

    def __init__(self, slope: float) -> None:
        super().__init__(0.5)
        self.slope = slope

    def forward(self, points, condition=None):
        return self.slope * super().forward(points)


class Spheres(SDF):
    """Shape k is a sphere of radius 0.2 + 0.2 k."""

    def __init__(self) -> None:
        super().__init__()
        self.radii = torch.nn.Parameter(torch.tensor([0.2, 0.4, 0.6]))

    def forward(self, points, condition=None):
        return points.norm(dim=-1) - self.radii[condition]


def _radius(points, centre=0.0):
    return np.linalg.norm(points - centre, axis=1)


def test_denoised_points_lie_on_the_sphere(ball, noisy):
    clean = ball.denoise(noisy)
    assert clean.dtype == np.float64 and clean.shape == noisy.shape
    assert np.abs(_radius(clean) - 1).max() < 1e-6


def test_denoised_points_keep_their_order_and_move_straight_to_the_surface(ball, noisy):
    clean = ball.denoise(noisy)
    assert np.abs(clean - noisy / _radius(noisy)[:, None]).max() < 1e-6
    order = np.random.default_rng(1).permutation(len(noisy))
    assert np.allclose(ball.denoise(noisy[order]), clean[order], atol=1e-6)


def test_utm_coordinates_come_back_to_a_tenth_of_a_millimetre(far_ball, noisy):
    clean = far_ball.denoise(UTM + 20 * noisy)
    assert np.abs(_radius(clean, UTM) - 20).max() < 1e-4
    assert np.abs(clean - (UTM + 20 * noisy / _radius(noisy)[:, None])).max() < 1e-4


def test_a_field_of_wrong_slope_is_pulled_more_than_once(noisy):
    # One pull would leave a tenth of the way: up to 0.015.
    field = Field(Sloped(0.9), [Frame((0.0, 0.0, 0.0), 2.0)], {"architecture": {"name": "ball"}, "pulls": 3})
    assert np.abs(_radius(noisy) - 1).max() > 0.1
    assert np.abs(_radius(field.denoise(noisy)) - 1).max() < 5e-4


def test_where_a_pull_overshoots_it_is_not_repeated(noisy):
    # Each pull of a field with slope 3 doubles the distance, and changes the side: three would leave eight times of it.
    field = Field(Sloped(3.0), [Frame((0.0, 0.0, 0.0), 2.0)], {"architecture": {"name": "ball"}, "pulls": 3})
    assert np.allclose(_radius(field.denoise(noisy)) - 1, -2 * (_radius(noisy) - 1), atol=1e-5)


def test_each_point_is_pulled_as_often_as_it_comes_closer(noisy):
    class TwoSlopes(Sloped):
        def forward(self, points, condition=None):
            return super().forward(points) * torch.where(points[:, 0] > 0, 1.0, 1 / 3)

    field = Field(TwoSlopes(2.7), [Frame((0.0, 0.0, 0.0), 2.0)], {"architecture": {"name": "ball"}, "pulls": 3})
    off, right = _radius(field.denoise(noisy)) - 1, noisy[:, 0] > 0
    before = _radius(noisy) - 1
    assert np.allclose(off[right], -1.7 * before[right], atol=1e-5)
    assert np.allclose(off[~right], 0.001 * before[~right], atol=1e-5)


def test_repeated_pulls_follow_a_field_that_turns(noisy):
    class Ellipsoid(Ball):
        def forward(self, points, condition=None):
            return (points * torch.tensor([1.0, 2.0, 4.0])).norm(dim=-1) - self.radius

    sdf = Ellipsoid(0.5)
    field = Field(sdf, [Frame((0.0, 0.0, 0.0), 1.0)], {"architecture": {"name": "ball"}, "pulls": 5})

    def pulled(point):
        for k in range(5):
            value, gradient = sdf.value_and_gradient(point[None])
            there = point - value * gradient[0] / gradient.norm()
            if k and sdf(there[None]).abs() >= value.abs():
                return point
            point = there
        return point

    with torch.no_grad():
        expected = torch.stack([pulled(point) for point in torch.as_tensor(noisy, dtype=torch.float32)])
    assert np.allclose(field.denoise(noisy), expected.numpy(), atol=1e-6)


@pytest.mark.parametrize("count", [1, 7, 21])
def test_no_point_is_lost_between_chunks(ball, noisy, monkeypatch, count):
    # The released denoiser drops what does not fill its last chunk.
    monkeypatch.setattr(module, "_CHUNK", 7)
    assert np.allclose(ball.denoise(noisy[:count]), noisy[:count] / _radius(noisy[:count])[:, None], atol=1e-6)


def test_more_points_than_a_chunk(ball):
    points = np.random.default_rng(0).normal(size=(module._CHUNK + 3, 3))
    clean = ball.denoise(points)
    assert len(clean) == len(points) and np.abs(_radius(clean) - 1).max() < 1e-5


def test_the_input_is_not_changed(ball, noisy):
    before = noisy.copy()
    ball.denoise(noisy), ball.upsample(noisy, 2)
    assert np.array_equal(noisy, before)


def test_no_points_give_no_points(ball):
    assert ball.denoise(np.empty((0, 3))).shape == (0, 3)


def test_shapes_have_their_own_surface_and_frame(noisy):
    frames = [Frame((0.0, 0.0, 0.0), 1.0), Frame((100.0, 0.0, 0.0), 10.0), Frame((0.0, 0.0, 0.0), 1.0)]
    field = Field(Spheres(), frames, {"architecture": {"name": "ball"}, "pulls": 3})
    assert np.allclose(_radius(field.denoise(noisy, shape=2)), 0.6, atol=1e-6)
    clean = field.denoise(noisy + [100, 0, 0], shape=1)
    assert np.allclose(_radius(clean, [100, 0, 0]), 4.0, atol=1e-5)
    more = field.upsample(noisy + [100, 0, 0], 2, shape=1)
    assert np.allclose(_radius(more, [100, 0, 0]), 4.0, atol=1e-4)


@pytest.mark.parametrize("rate", [1, 2, 5])
def test_upsampling_adds_points_after_the_denoised_ones(ball, noisy, rate):
    more = ball.upsample(noisy, rate)
    assert more.shape == (rate * 400, 3) and more.dtype == np.float64
    assert np.array_equal(more[:400], ball.denoise(noisy))
    assert np.abs(_radius(more) - 1).max() < 1e-6


def test_upsampled_points_fill_the_gaps(ball, noisy):
    few, many = ball.upsample(noisy, 1), ball.upsample(noisy, 8)
    probes = np.random.default_rng(3).normal(size=(2000, 3))
    probes /= _radius(probes)[:, None]
    holes = [cKDTree(points).query(probes)[0].mean() for points in (few, many)]
    # Eight times the points on the same area: even ones would be 0.35 as far away.
    assert holes[1] < 0.5 * holes[0]
    assert len(np.unique(many.round(9), axis=0)) == len(many)


def test_upsampling_stays_near_where_the_points_are(ball):
    # A cap: no copy may land on the other side.
    random = np.random.default_rng(0)
    cap = np.column_stack([0.1 * random.normal(size=(300, 2)), np.ones(300)])
    assert (ball.upsample(cap, 4)[:, 2] > 0.5).all()


def test_upsampling_follows_its_seed(ball, noisy):
    assert np.array_equal(ball.upsample(noisy, 3, seed=1), ball.upsample(noisy, 3, seed=1))
    assert not np.array_equal(ball.upsample(noisy, 3, seed=1), ball.upsample(noisy, 3, seed=2))


def test_upsampling_survives_repeated_points(ball, noisy):
    twice = np.concatenate([noisy, noisy])
    assert np.abs(_radius(ball.upsample(twice, 2)) - 1).max() < 1e-6


@pytest.mark.parametrize("count", [0, 1])
def test_upsampling_hardly_any_points_gives_finite_ones(ball, noisy, count):
    more = ball.upsample(noisy[:count], 3)
    assert more.shape == (3 * count, 3) and np.isfinite(more).all()


def test_upsampling_works_at_utm_coordinates(far_ball, noisy):
    more = far_ball.upsample(UTM + 20 * noisy, 3)
    assert np.abs(_radius(more, UTM) - 20).max() < 1e-3


def _gaps(points, centre=0.0):
    """Distances to the nearest neighbour, as multiples of that in a hexagonal packing of the sphere."""
    area = 4 * np.pi * _radius(points, centre).mean() ** 2
    return cKDTree(points).query(points, 2)[0][:, 1] / np.sqrt(2 / np.sqrt(3) * area / len(points))


def test_even_points_lie_on_the_sphere_in_their_order_and_far_apart(ball, noisy):
    clean, even = ball.denoise(noisy), ball.denoise(noisy, even=True)
    assert even.shape == noisy.shape and even.dtype == np.float64
    assert np.abs(_radius(even) - 1).max() < 1e-6
    spacing = np.sqrt(4 * np.pi / 400)
    moved = np.linalg.norm(even - clean, axis=1)
    assert moved.mean() < spacing and moved.max() < 3 * spacing
    assert _gaps(clean).mean() < 0.55 and _gaps(even).mean() > 0.85 and _gaps(even).min() > 0.5


@pytest.mark.parametrize("rate", [1, 4])
def test_upsampled_points_can_be_even(ball, noisy, rate):
    even = ball.upsample(noisy, rate, even=True)
    assert even.shape == (rate * 400, 3) and np.abs(_radius(even) - 1).max() < 1e-6
    assert _gaps(even).mean() > 0.85 and _gaps(even).min() > 0.45
    if rate == 1:
        assert np.allclose(even, ball.denoise(noisy, even=True), atol=1e-5)


def test_even_points_come_back_to_utm_coordinates(far_ball, noisy):
    even = far_ball.denoise(UTM + 20 * noisy, even=True)
    assert np.abs(_radius(even, UTM) - 20).max() < 1e-4 and _gaps(even, UTM).mean() > 0.85


def test_each_shape_spreads_on_its_own_surface(noisy):
    field = Field(Spheres(), [Frame((0.0, 0.0, 0.0), 1.0)] * 3, {"architecture": {"name": "ball"}, "pulls": 3})
    assert np.allclose(_radius(field.denoise(noisy, shape=1, even=True)), 0.4, atol=1e-6)


def test_sdf_at_is_the_distance_in_world_units(far_ball, noisy):
    distance = far_ball.sdf_at(UTM + 20 * noisy)
    assert distance.shape == (400,) and distance.dtype == np.float64
    assert np.allclose(distance, 20 * _radius(noisy) - 20, atol=1e-4)
    assert far_ball.sdf_at(UTM[None])[0] == pytest.approx(-20)


@pytest.mark.parametrize("task", ["denoise", "upsample", "sdf_at"])
def test_arrays_of_another_shape_are_refused(ball, task):
    with pytest.raises(InputError, match=r"points must be an array of shape \(n, 3\), got \(5, 2\)"):
        getattr(ball, task)(np.zeros((5, 2)))


@pytest.mark.parametrize("rate", [0, -1])
def test_rates_below_one_are_refused(ball, noisy, rate):
    with pytest.raises(InputError, match=f"rate must be at least 1, got {rate}"):
        ball.upsample(noisy, rate)


def test_a_cloud_from_elsewhere_is_refused(ball, noisy):
    with pytest.raises(InputError, match=r"400 of 400 points lie outside the box .* fit this one"):
        ball.denoise(noisy + [100.0, 0, 0])
    with pytest.raises(InputError, match="outside the box"):
        ball.upsample(50 * noisy)
