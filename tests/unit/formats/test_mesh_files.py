"""Meshes out, and mesh vertices in, against trimesh and files written by hand."""

import warnings

import numpy as np
import pytest
import trimesh

from n2n.errors import OutputError
from n2n.formats import MESH_EXTENSIONS_WRITE, read_cloud, write_mesh

UTM = np.array([5e5 + 0.1234, 5e6 + 0.5678, 100.25])


def ball(centre=(0, 0, 0), radius: float = 1.0) -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    return trimesh.Trimesh(mesh.vertices + centre, mesh.faces, process=False)


@pytest.mark.parametrize("extension", [".ply", ".obj", ".off"])
def test_vertices_far_from_the_origin_and_faces_come_back_exactly(tmp_path, extension):
    mesh = ball(UTM)
    write_mesh(tmp_path / f"ball{extension}", mesh)
    theirs = trimesh.load(tmp_path / f"ball{extension}", process=False, maintain_order=True)
    assert np.abs(theirs.vertices - mesh.vertices).max() < 1e-7
    assert np.array_equal(theirs.faces, mesh.faces)


@pytest.mark.parametrize("extension", MESH_EXTENSIONS_WRITE)
def test_every_format_is_watertight_outward_and_of_the_right_size(tmp_path, extension):
    mesh = ball((1, 2, 3))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_mesh(tmp_path / f"ball{extension}", mesh)
    theirs = trimesh.load(tmp_path / f"ball{extension}", force="mesh")
    assert theirs.is_watertight
    # Positive: the normals point outwards.
    assert theirs.volume == pytest.approx(mesh.volume, rel=1e-5)
    np.testing.assert_allclose(theirs.bounds, mesh.bounds, atol=1e-6)


@pytest.mark.parametrize("extension", [".stl", ".glb"])
def test_single_precision_far_from_the_origin_is_told(tmp_path, extension):
    with pytest.warns(UserWarning, match=r"stores 32-bit coordinates, which moves vertices by up to 0\.\d+ here"):
        write_mesh(tmp_path / f"ball{extension}", ball(UTM))
    assert (tmp_path / f"ball{extension}").exists()


def test_a_mesh_without_faces_can_be_written(tmp_path):
    write_mesh(tmp_path / "none.ply", trimesh.Trimesh(np.eye(3), np.empty((0, 3), int), process=False))
    assert read_cloud(tmp_path / "none.ply").points.tolist() == np.eye(3).tolist()


@pytest.mark.parametrize("name", ["ball.xyz", "ball", "ball.STEP"])
def test_other_extensions_are_refused(tmp_path, name):
    with pytest.raises(OutputError, match=r"unknown mesh type .*; choose one of: .ply, .obj, .off, .stl, .glb"):
        write_mesh(tmp_path / name, ball())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("extension", [".ply", ".obj", ".off"])
def test_vertices_are_read_in_order(tmp_path, extension):
    mesh = ball(UTM)
    # trimesh's own digits: eight after the point are its default for text, single precision for ply.
    mesh.export(tmp_path / f"ball{extension}")
    points = read_cloud(tmp_path / f"ball{extension}").points
    assert np.abs(points - mesh.vertices).max() < (0.5 if extension == ".ply" else 1e-7)


@pytest.mark.parametrize("kind", ["stl", "stl_ascii"])
def test_each_vertex_of_an_stl_counts_once(tmp_path, kind):
    mesh = ball((1, 2, 3))
    mesh.export(tmp_path / "ball.stl", file_type=kind)
    points = read_cloud(tmp_path / "ball.stl").points
    assert len(points) == len(mesh.vertices)
    order, theirs = np.lexsort(points.round(4).T), np.lexsort(mesh.vertices.round(4).T)
    np.testing.assert_allclose(points[order], mesh.vertices[theirs], atol=1e-6)


CLOUDS = [
    ("cloud.off", "OFF\n2 0 0\n1 2 3\n500000.1234 5000000.5678 100.25\n"),
    ("one_line.off", "OFF 2 0 0\n1 2 3\n500000.1234 5000000.5678 100.25\n"),
    (
        "coloured.off",
        "COFF # by hand\n# two points\n2 0 0\n\n1 2 3 9 9 9\n500000.1234 5000000.5678 100.25 8 8 8\n",
    ),
    ("upper.OFF", "OFF\n2 1 0\n1 2 3\n500000.1234 5000000.5678 100.25\n3 0 1 1\n"),
    ("cloud.obj", "# by hand\no scan\nv 1 2 3\nv 500000.1234 5000000.5678 100.25\n"),
    (
        "coloured.obj",
        "v 1 2 3 1 0 0\nvn 0 0 1\nvt 0 0\nv 500000.1234 5000000.5678 100.25 1 0 0\nf 1 2 2\n",
    ),
    ("aligned.obj", "mtllib none.mtl\nv\t1  2  3\n  v   500000.1234 5000000.5678 100.25\n"),
]


@pytest.mark.parametrize(("name", "content"), CLOUDS, ids=[row[0] for row in CLOUDS])
def test_vertices_need_no_faces(tmp_path, name, content):
    (tmp_path / name).write_text(content)
    assert read_cloud(tmp_path / name).points.tolist() == [[1, 2, 3], [500000.1234, 5000000.5678, 100.25]]
