"""PLY, against files written by hand and against trimesh."""

import numpy as np
import pytest
import trimesh

from n2n.formats import Cloud, read_cloud, write_cloud

ROWS = np.array(
    [(500000.1234, 5000000.5678, 100.25, 255, -7, 0.5), (500001.5, np.nan, 99.0, 0, 70000, -1.25)],
    [("x", "f8"), ("y", "f8"), ("z", "f8"), ("red", "u1"), ("label", "i4"), ("reflectance", "f4")],
)
PROPERTIES = (
    "property double x\nproperty float64 y\nproperty double z\n"
    "property uchar red\nproperty int32 label\nproperty float reflectance\n"
)


def ply(encoding: str, body: bytes, properties: str = PROPERTIES, count: int = 2) -> bytes:
    head = f"ply\nformat {encoding} 1.0\ncomment by hand\nelement vertex {count}\n{properties}end_header\n"
    return head.encode() + body


TEXT = "".join(" ".join(str(value) for value in row) + "\n" for row in ROWS.tolist()).encode()
ENCODED = {
    "ascii": TEXT,
    "binary_little_endian": ROWS.astype(ROWS.dtype.newbyteorder("<")).tobytes(),
    "binary_big_endian": ROWS.astype(ROWS.dtype.newbyteorder(">")).tobytes(),
}


@pytest.mark.parametrize("encoding", ENCODED)
def test_every_encoding_gives_points_and_properties_with_their_types(tmp_path, encoding):
    path = tmp_path / "scan.ply"
    path.write_bytes(ply(encoding, ENCODED[encoding]))
    cloud = read_cloud(path)
    assert cloud.points.dtype == np.float64
    np.testing.assert_array_equal(cloud.points, [[500000.1234, 5000000.5678, 100.25], [500001.5, np.nan, 99.0]])
    assert {name: values.dtype.str for name, values in cloud.attributes.items()} == {
        "red": "|u1",
        "label": "<i4",
        "reflectance": "<f4",
    }
    for name, values in cloud.attributes.items():
        assert values.tolist() == ROWS[name].tolist()


@pytest.mark.parametrize("encoding", ENCODED)
def test_lines_may_end_in_carriage_returns(tmp_path, encoding):
    path = tmp_path / "windows.ply"
    header, body = ply(encoding, b"").replace(b"\n", b"\r\n"), ENCODED[encoding]
    path.write_bytes(header + (body.replace(b"\n", b"\r\n") if encoding == "ascii" else body))
    assert read_cloud(path).points[0].tolist() == [500000.1234, 5000000.5678, 100.25]


def test_one_vertex_is_a_cloud(tmp_path):
    path = tmp_path / "one.ply"
    path.write_bytes(ply("ascii", b"1 2 3 4 5 6\n", count=1))
    cloud = read_cloud(path)
    assert cloud.points.tolist() == [[1, 2, 3]] and cloud.attributes["label"].tolist() == [5]


def test_other_elements_and_lists_are_passed_over(tmp_path):
    path = tmp_path / "mixed.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement camera 1\nproperty float f\nelement vertex 3\nproperty float x\n"
        "property float y\nproperty list uchar int near\nproperty float z\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n9\n1 2 2 7 8 3\n4 5 2 7 8 6\n7 8 2 7 8 9\n3 0 1 2\n"
    )
    cloud = read_cloud(path)
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert cloud.attributes == {}


def test_a_mesh_gives_its_vertices_in_order(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=1)
    ball.export(tmp_path / "ball.ply")
    np.testing.assert_allclose(read_cloud(tmp_path / "ball.ply").points, ball.vertices, atol=1e-7)


def test_written_bytes_are_those_of_the_specification(tmp_path):
    cloud = Cloud(
        np.array([[500000.1234, 5000000.5678, 100.25], [np.nan, 2.0, 3.0]]),
        {"red": np.array([255, 1], np.uint8), "label": np.array([-7, 70000], np.int32)},
    )
    write_cloud(tmp_path / "out.ply", cloud)
    properties = "property double x\nproperty double y\nproperty double z\nproperty uchar red\nproperty int label\n"
    rows = np.array(
        [(500000.1234, 5000000.5678, 100.25, 255, -7), (np.nan, 2, 3, 1, 70000)], "<f8, <f8, <f8, u1, <i4"
    ).tobytes()
    expected = ply("binary_little_endian", rows, properties).replace(b"comment by hand\n", b"")
    assert (tmp_path / "out.ply").read_bytes() == expected


def test_trimesh_reads_coordinates_and_colours(tmp_path):
    random = np.random.default_rng(0)
    points = random.normal(size=(50, 3)) + [5e5, 5e6, 100]
    colours = random.integers(0, 256, (50, 3), dtype=np.uint8)
    write_cloud(tmp_path / "out.ply", Cloud(points, dict(zip(("red", "green", "blue"), colours.T, strict=True))))
    theirs = trimesh.load(tmp_path / "out.ply")
    assert np.array_equal(theirs.vertices, points)
    assert np.array_equal(theirs.colors[:, :3], colours)


def test_types_that_ply_lacks_become_double(tmp_path):
    attributes = {"id": np.array([2**40, 1]), "inside": np.array([True, False]), "half": np.array([0.5, 2], np.float16)}
    write_cloud(tmp_path / "out.ply", Cloud(np.zeros((2, 3)), attributes))
    back = read_cloud(tmp_path / "out.ply").attributes
    assert {name: values.tolist() for name, values in back.items()} == {
        "id": [2**40, 1],
        "inside": [1, 0],
        "half": [0.5, 2],
    }
    assert {values.dtype.str for values in back.values()} == {"<f8"}
