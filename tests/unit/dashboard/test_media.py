"""Meshes and clouds keep their shape when they are made small."""

import base64

import numpy as np
import pytest
import trimesh

from n2n.dashboard.media import read_picture, read_scene, simplify
from tests.unit.dashboard.conftest import write_media


def unpacked(scene, key):
    steps = np.frombuffer(base64.b64decode(scene[key]), "<u2").reshape(-1, 3)
    low, high = np.array(scene["low"]), np.array(scene["high"])
    return low + steps / 65535 * (high - low)


def test_a_scene_is_what_was_stored_to_16_bits(tmp_path):
    write_media(tmp_path / "media")
    problems = []
    scene = read_scene(tmp_path / "media", problems)
    assert not problems
    points = unpacked(scene, "points")
    stored = np.load(tmp_path / "media" / "points.npz")["points"]
    assert scene["counts"]["points"] == [len(stored), len(stored)]
    gaps = np.linalg.norm(points[:, None] - stored[None], axis=2).min(axis=1)
    assert gaps.max() < 2 * 2 / 65535
    assert np.allclose(np.linalg.norm(unpacked(scene, "vertices"), axis=1), 1, atol=1e-4)
    error = np.frombuffer(base64.b64decode(scene["error"]), "u1") / 255 * scene["top"]
    assert np.abs(error - np.minimum(np.abs(points[:, 2]), scene["top"])).max() < 0.005


def test_simplified_spheres_stay_spheres():
    sphere = trimesh.creation.icosphere(subdivisions=6)
    vertices, faces = simplify(np.asarray(sphere.vertices), np.asarray(sphere.faces), 8000)
    assert 4000 < len(vertices) <= 8000
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(1, abs=2e-3)
    assert faces.max() < len(vertices) and trimesh.Trimesh(vertices, faces).area == pytest.approx(4 * np.pi, rel=0.02)


@pytest.mark.parametrize("size", [1e-9, 1e9])
def test_simplifying_knows_no_unit(size):
    sphere = trimesh.creation.icosphere(subdivisions=5)
    vertices, _ = simplify(size * np.asarray(sphere.vertices), np.asarray(sphere.faces), 3000)
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(size, rel=5e-3)


@pytest.mark.parametrize("name", ["mesh.glb", "points.npz", "level_sets.png"])
@pytest.mark.parametrize("content", [b"", b"nothing of the kind", b"PK\x03\x04broken"])
def test_damaged_files_are_told(tmp_path, name, content):
    write_media(tmp_path / "media")
    (tmp_path / "media" / name).write_bytes(content)
    problems = []
    picture, scene = read_picture(tmp_path / "media", problems), read_scene(tmp_path / "media", problems)
    assert len(problems) == 1 and problems[0].startswith(name)
    assert scene is not None and (picture is None) == (name == "level_sets.png")


def test_any_bit_may_be_wrong(tmp_path):
    write_media(tmp_path / "media")
    random = np.random.default_rng(0)
    for name in ("points.npz", "mesh.glb"):
        path, shown = tmp_path / "media" / name, 0
        whole = path.read_bytes()
        for _ in range(200):
            damaged = bytearray(whole)
            damaged[random.integers(len(whole))] ^= 1 << int(random.integers(8))
            path.write_bytes(damaged)
            problems = []
            assert read_scene(tmp_path / "media", problems) is not None and len(problems) <= 1
            shown += not problems
        assert 0 < shown < 200
        path.write_bytes(whole)


def test_faces_of_vertices_that_are_not_there_are_told(tmp_path):
    mesh = trimesh.creation.icosphere(subdivisions=5)
    mesh.export(tmp_path / "mesh.glb")
    damaged = bytearray((tmp_path / "mesh.glb").read_bytes())
    faces = np.asarray(mesh.faces, "<u4").tobytes()
    damaged[damaged.index(faces[:60]) + 3] = 1  # of the first index
    (tmp_path / "mesh.glb").write_bytes(damaged)
    problems = []
    assert read_scene(tmp_path, problems) is None and "vertices that are not there" in problems[0]


@pytest.mark.parametrize(
    "arrays",
    [{"points": np.zeros((4, 2))}, {"points": np.full((4, 3), np.nan)}, {"other": np.zeros(3)},
     {"points": np.zeros((4, 3)), "error": np.zeros(3)}, {"points": np.array([{}], object)}],
)  # fmt: skip
def test_arrays_that_are_no_cloud_are_told(tmp_path, arrays):
    np.savez(tmp_path / "points.npz", **arrays)
    problems = []
    assert read_scene(tmp_path, problems) is None and len(problems) == 1


def test_nothing_there_is_nothing(tmp_path):
    problems = []
    assert read_scene(tmp_path, problems) is None and read_picture(tmp_path, problems) is None and not problems
