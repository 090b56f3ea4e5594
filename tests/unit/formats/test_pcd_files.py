"""PCD, against files written by hand: no other reader of it is at hand."""

import numpy as np
import pytest

from n2n.formats import Cloud, read_cloud, write_cloud

X = np.array([500000.1234, 500001.5, 500002.0, 500003.0])
Y = np.array([5000000.5678, np.nan, 5000002.0, 5000003.0])
Z = np.full(4, 100.25)
LABEL = np.array([7, 65535, 0, 1], np.uint16)
HEADER = (
    "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z label\nSIZE 8 8 8 2\nTYPE F F F U\n"
    "COUNT 1 1 1 1\nWIDTH 2\nHEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA {}\n"
)


def ascii_body() -> bytes:
    return "".join(
        f"{x!r} {y!r} {z!r} {i}\n" for x, y, z, i in zip(*map(np.ndarray.tolist, TABLE), strict=True)
    ).encode()


def binary_body() -> bytes:
    rows = np.empty(4, "<f8, <f8, <f8, <u2")
    for name, values in zip(rows.dtype.names, TABLE, strict=True):
        rows[name] = values
    return rows.tobytes()


def compressed_body() -> bytes:
    """Field after field, LZF: a byte below 32 announces that many literal bytes and one more.

    A larger one repeats earlier bytes: the upper three bits are the length less 2, 7 meaning that a byte follows with
    what exceeds 7; the lower five bits and the last byte are the distance less 1.
    """
    x, y = bytes([31]) + X.tobytes(), bytes([31]) + Y.tobytes()
    z = bytes([7]) + Z[:1].tobytes() + bytes([7 << 5, 24 - 2 - 7, 8 - 1])
    packed = x + y + z + bytes([7]) + LABEL.tobytes()
    return np.array([len(packed), 4 * 26], "<u4").tobytes() + packed


TABLE = (X, Y, Z, LABEL)
BODIES = {"ascii": ascii_body, "binary": binary_body, "binary_compressed": compressed_body}


@pytest.mark.parametrize("encoding", BODIES)
def test_every_encoding_gives_points_and_fields_with_their_types(tmp_path, encoding):
    path = tmp_path / "scan.pcd"
    path.write_bytes(HEADER.format(encoding).encode() + BODIES[encoding]())
    cloud = read_cloud(path)
    assert cloud.points.dtype == np.float64
    np.testing.assert_array_equal(cloud.points, np.stack([X, Y, Z], axis=1))
    assert cloud.attributes["label"].dtype == np.uint16
    assert cloud.attributes["label"].tolist() == LABEL.tolist()


def test_padding_and_fields_of_several_elements_are_passed_over(tmp_path):
    # As the Point Cloud Library writes structures that are padded for alignment.
    header = (
        "VERSION .7\nFIELDS x y z _ rgb _ histogram\nSIZE 4 4 4 1 4 1 4\nTYPE F F F U F U F\nCOUNT 1 1 1 4 1 12 3\n"
        "WIDTH 2\nHEIGHT 1\nDATA {}\n"
    )
    row = np.dtype([("xyz", "<f4", 3), ("a", "u1", 4), ("rgb", "<u4"), ("b", "u1", 12), ("histogram", "<f4", 3)])
    rows = np.zeros(2, row)
    rows["xyz"], rows["rgb"] = [[1, 2, 3], [4, 5, 6]], [0x102030, 0xFFFFFF]
    (tmp_path / "binary.pcd").write_bytes(header.format("binary").encode() + rows.tobytes())
    lines = "1 2 3 0 0 0 0 0.5 {0} 9 9 9\n4 5 6 0 0 0 0 1.5 {0} 9 9 9\n".format(" ".join("0" * 12))
    (tmp_path / "ascii.pcd").write_text(header.format("ascii") + lines)
    binary, text = read_cloud(tmp_path / "binary.pcd"), read_cloud(tmp_path / "ascii.pcd")
    assert binary.points.tolist() == text.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert list(binary.attributes) == list(text.attributes) == ["rgb"]
    # Colours are packed into the bits of a float, NaN among them.
    assert binary.attributes["rgb"].view(np.uint32).tolist() == [0x102030, 0xFFFFFF]
    assert text.attributes["rgb"].tolist() == [0.5, 1.5]


def test_written_bytes_are_those_of_the_specification(tmp_path):
    write_cloud(tmp_path / "out.pcd", Cloud(np.stack([X, Y, Z], axis=1), {"label": LABEL}))
    header = HEADER.format("binary").replace("WIDTH 2\nHEIGHT 2", "WIDTH 4\nHEIGHT 1")
    assert (tmp_path / "out.pcd").read_bytes() == header.encode() + binary_body()


def test_types_that_pcd_lacks_become_double(tmp_path):
    attributes = {"inside": np.array([True, False]), "half": np.array([0.5, 2], np.float16), "id": np.array([2**40, 1])}
    write_cloud(tmp_path / "out.pcd", Cloud(np.zeros((2, 3)), attributes))
    header = (tmp_path / "out.pcd").read_bytes().split(b"DATA")[0].decode()
    assert "FIELDS x y z inside half id\nSIZE 8 8 8 8 8 8\nTYPE F F F F F I\n" in header
    assert read_cloud(tmp_path / "out.pcd").attributes["half"].tolist() == [0.5, 2]
