"""Surfaces of exact spheres in world coordinates."""

import numpy as np
import pytest
import torch

from n2n.errors import ConfigError, SurfaceError
from n2n.geometry.frame import Frame
from n2n.tasks.field import Field
from n2n.testing import Ball

UTM = np.array([5e5, 5e6, 100.0])


class Pair(Ball):
    """A ball of radius 0.5 and a smaller one beside it."""

    def __init__(self, small: float) -> None:
        super().__init__(0.5)
        self.small = small

    def forward(self, points, condition=None):
        beside = (points - torch.tensor([0.8, 0.0, 0.0])).norm(dim=-1) - self.small
        return torch.minimum(super().forward(points), beside)


def _field(sdf, centre=(0.0, 0.0, 0.0), scale=1.0, **architecture):
    return Field(sdf, [Frame(centre, scale)], {"architecture": {"name": "ball", **architecture}})


def _radius(points, centre=0.0):
    return np.linalg.norm(points - centre, axis=1)


def test_vertices_lie_on_the_sphere_and_the_mesh_is_closed(ball):
    mesh = ball.reconstruct(resolution=64)
    # Linear crossings of edges of 2 * 2.1 / 64: off by at most h^2 / 8 r.
    assert np.abs(_radius(mesh.vertices) - 1).max() < 1e-3
    assert mesh.is_watertight and mesh.body_count == 1
    assert mesh.volume == pytest.approx(4 / 3 * np.pi, rel=0.01)
    assert mesh.vertices.dtype == np.float64


def test_normals_point_outwards(ball):
    mesh = ball.reconstruct(resolution=32)
    assert mesh.volume > 0
    outward = mesh.triangles_center / _radius(mesh.triangles_center)[:, None]
    assert (mesh.face_normals * outward).sum(axis=1).min() > 0.9


def test_the_surface_is_not_shifted(ball):
    # The released extraction is off by half a voxel and a factor 128 / 127.
    mesh = ball.reconstruct(resolution=50)
    assert np.abs(mesh.center_mass).max() < 1e-4
    assert np.abs(mesh.bounds - [[-1] * 3, [1] * 3]).max() < 1e-3


def test_utm_coordinates_are_kept(far_ball):
    mesh = far_ball.reconstruct(resolution=256)
    assert np.abs(_radius(mesh.vertices, UTM) - 20).max() < 1e-3
    assert mesh.is_watertight


def test_the_edge_is_given_in_world_units(far_ball):
    coarse, fine = far_ball.reconstruct(edge=2.0), far_ball.reconstruct(edge=1.0, resolution=8)
    for mesh, edge in ((coarse, 2.0), (fine, 1.0)):
        lengths = mesh.edges_unique_length
        assert lengths.max() <= np.sqrt(3) * edge and 0.4 * edge < np.median(lengths) < 1.3 * edge
    assert len(fine.faces) == pytest.approx(4 * len(coarse.faces), rel=0.1)


def test_resolution_counts_voxels_along_the_longest_side():
    flat = {"lower": [-1.0, -0.7, -0.7], "upper": [1.0, 0.7, 0.7]}
    by_resolution = _field(Ball(0.5), **flat).reconstruct(resolution=40)
    by_edge = _field(Ball(0.5), **flat).reconstruct(edge=2.0 / 40)
    assert np.array_equal(by_resolution.vertices, by_edge.vertices)


def test_the_box_of_the_architecture_is_searched():
    sdf = Ball(0.5)
    with torch.no_grad():
        sdf.centre += torch.tensor([2.0, 0.0, 0.0])
    mesh = _field(sdf, lower=[1.2, -0.8, -0.8], upper=[2.8, 0.8, 0.8]).reconstruct(resolution=32)
    assert mesh.is_watertight and np.allclose(mesh.center_mass, [2, 0, 0], atol=1e-3)
    with pytest.raises(SurfaceError):
        _field(sdf).reconstruct(resolution=32)


def test_specks_are_dropped_unless_asked_for():
    # Areas 0.04^2 to 0.5^2: 0.6 %; 0.15^2 to 0.5^2: 9 %.
    assert _field(Pair(0.04)).reconstruct(resolution=96).body_count == 1
    assert _field(Pair(0.04)).reconstruct(resolution=96, keep_all=True).body_count == 2
    assert _field(Pair(0.15)).reconstruct(resolution=96).body_count == 2


@pytest.mark.parametrize(("radius", "side"), [(-0.5, "outside"), (3.0, "inside")])
def test_a_field_without_a_surface_is_an_error_with_its_range(radius, side):
    with pytest.raises(SurfaceError) as caught:
        _field(Ball(radius)).reconstruct(resolution=32)
    message = str(caught.value)
    # The box reaches from the centre to sqrt(3) * 1.05.
    low, high = -radius, np.sqrt(3) * 1.05 - radius
    assert "min" in message and "max" in message and f"all of it is {side}" in message
    assert f"{high:.3g}" in message
    assert abs(float(message.split("min f = ")[1].split()[0]) - low) < 0.1


def test_shapes_have_their_own_surface_and_frame():
    class Spheres(Ball):
        def forward(self, points, condition=None):
            return points.norm(dim=-1) - 0.3 * (condition + 1)

    frames = [Frame((0.0, 0.0, 0.0), 1.0), Frame((10.0, 0.0, 0.0), 2.0)]
    mesh = Field(Spheres(), frames, {"architecture": {"name": "ball"}, "pulls": 3}).reconstruct(resolution=32, shape=1)
    assert np.abs(_radius(mesh.vertices, [10, 0, 0]) - 1.2).max() < 0.01


@pytest.mark.parametrize(
    "arguments", [{"resolution": 7}, {"resolution": 2049}, {"edge": 0.0}, {"edge": -1.0}, {"edge": 1e-6}]
)
def test_sizes_out_of_range_are_refused(ball, arguments):
    with pytest.raises(ConfigError):
        ball.reconstruct(**arguments)
