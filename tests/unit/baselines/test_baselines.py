"""Baselines with packages of our own making: order, arguments and messages; tests/real runs the true ones."""

import sys
import types

import numpy as np
import pytest

from n2n.baselines.optional import optional
from n2n.errors import ConfigError, InputError
from n2n.registry import BASELINES


class Point:
    def __init__(self, *coordinates):
        self.coordinates = coordinates

    def x(self):
        return self.coordinates[0]

    def y(self):
        return self.coordinates[1]

    def z(self):
        return self.coordinates[2]


class PointSet:
    """Keeps points in an order of its own, and sets some aside, as CGAL does while it orients normals."""

    def __init__(self):
        self.all, self.order, self.aside = [], [], []

    def insert(self, point):
        self.order.append(len(self.all))
        self.all.append(point)

    def points(self):
        return iter([self.all[index] for index in self.order])

    def indices(self):
        return iter(self.order)

    def cancel_removals(self):
        self.order, self.aside = self.order + self.aside, []


@pytest.fixture
def cgal(monkeypatch):
    """Install a CGAL whose smoothing adds 1 to every coordinate; return the calls it got."""
    calls = []

    def smooth(name):
        def run(cloud, *arguments):
            calls.append((name, *arguments))
            cloud.all = [Point(*(c + 1 for c in point.coordinates)) for point in cloud.all]

        return run

    def orient(cloud, neighbours):
        calls.append(("orient", neighbours))
        backwards = cloud.order[::-1]
        cloud.order, cloud.aside = backwards[2:], backwards[:2]

    processing = types.ModuleType("CGAL.CGAL_Point_set_processing_3")
    processing.jet_smooth_point_set = smooth("jet")
    processing.bilateral_smooth_point_set = smooth("bilateral")
    processing.jet_estimate_normals = lambda cloud, neighbours: calls.append(("normals", neighbours))
    processing.mst_orient_normals = orient
    kernel, sets = types.ModuleType("CGAL.CGAL_Kernel"), types.ModuleType("CGAL.CGAL_Point_set_3")
    kernel.Point_3, sets.Point_set_3 = Point, PointSet
    monkeypatch.setitem(sys.modules, "CGAL", types.ModuleType("CGAL"))
    for module in (processing, kernel, sets):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return calls


def cloud(count=60):
    return np.random.default_rng(0).normal(size=(count, 3))


def test_jet_passes_its_arguments_and_keeps_the_order(cgal):
    points = cloud()
    moved = BASELINES.build({"name": "jet", "neighbours": 30, "degree": 3, "iterations": 2}).denoise(points)
    assert cgal == [("jet", 30, 0.0, 3)] * 2
    assert np.allclose(moved, points + 2)


def test_bilateral_keeps_the_order_although_orienting_normals_does_not(cgal):
    points = cloud()
    moved = BASELINES.build({"name": "bilateral", "iterations": 1, "sharpness": 20}).denoise(points)
    assert cgal == [("normals", 24), ("orient", 24), ("bilateral", 24, 0.0, 20.0)]
    assert np.allclose(moved, points + 1)


def test_points_without_a_fit_stay_where_they_are(cgal, monkeypatch):
    def broken(target, *arguments):
        target.all[7] = Point(np.nan, 0.0, 0.0)

    monkeypatch.setattr(sys.modules["CGAL.CGAL_Point_set_processing_3"], "jet_smooth_point_set", broken)
    points = cloud()
    assert np.array_equal(BASELINES.build("jet").denoise(points), points)


@pytest.mark.parametrize("name", ["jet", "bilateral"])
def test_a_cloud_smaller_than_a_neighbourhood_is_refused(cgal, name):
    with pytest.raises(InputError, match="20 points; 24 neighbours"):
        BASELINES.build(name).denoise(cloud(20))


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("jet", {"neighbours": 2}, "neighbours=2 is out of range; give 3 or more"),
        ("jet", {"neighbours": 5, "degree": 3}, "10 coefficients"),
        ("jet", {"degree": 7}, "degree=7 is out of range; give 1 to 4"),
        ("bilateral", {"sharpness": 120}, "sharpness=120 is out of range; give 0 to 90"),
        ("poisson", {"depth": 99}, "depth=99"),
        ("poisson", {"neighbours": 1}, "neighbours=1"),
        ("poisson", {"point_weight": -1}, "point_weight=-1"),
    ],
)
def test_arguments_out_of_range(name, arguments, message):
    with pytest.raises(ConfigError, match=message):
        BASELINES.build({"name": name, **arguments})


@pytest.mark.parametrize(("name", "extra"), [("jet", "cgal"), ("bilateral", "cgal"), ("poisson", "poisson")])
def test_a_missing_package_is_named_with_the_line_that_installs_it(monkeypatch, name, extra):
    for module in ("CGAL", "CGAL.CGAL_Kernel", "pymeshlab"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ConfigError, match=rf"needs the package .*; pip install 'n2n\[{extra}\]'"):
        BASELINES.build(name)


def test_a_package_that_cannot_be_loaded_says_why(monkeypatch, tmp_path):
    (tmp_path / "halfway.py").write_text("raise ImportError('libGL.so.1: cannot open shared object file')")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ConfigError, match=r"package halfway \(libGL.so.1"):
        optional("halfway", "poisson", "x")


class MeshSet:
    """Answers with a tetrahedron, inside out, around what it was given."""

    def __init__(self, verbose):
        self.calls = []

    def add_mesh(self, mesh):
        self.points = mesh

    def compute_normal_for_point_clouds(self, k):
        MeshSet.neighbours = k

    def generate_surface_reconstruction_screened_poisson(self, **arguments):
        MeshSet.arguments = arguments

    def current_mesh(self):
        corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        faces = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
        result = types.SimpleNamespace(vertex_matrix=lambda: corners, face_matrix=lambda: faces)
        return result


def test_poisson_centres_its_input_turns_the_mesh_outwards_and_puts_it_back(monkeypatch):
    module = types.ModuleType("pymeshlab")
    seen = []
    module.MeshSet, module.Mesh = MeshSet, lambda vertex_matrix: seen.append(vertex_matrix)
    monkeypatch.setitem(sys.modules, "pymeshlab", module)
    points = cloud() + [5e6, 0, 0]
    mesh = BASELINES.build({"name": "poisson", "depth": 6}).reconstruct(points)
    assert np.abs(seen[0].min(axis=0) + seen[0].max(axis=0)).max() < 1e-6
    assert MeshSet.neighbours == 30
    assert MeshSet.arguments == {"depth": 6, "pointweight": 4.0, "threads": 1}
    assert mesh.volume == pytest.approx(1 / 6)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    assert mesh.vertices.min(axis=0) == pytest.approx(middle)
