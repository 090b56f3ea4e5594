"""KITTI scans, against bytes written by hand."""

import struct

import numpy as np

from n2n.formats import read_cloud


def test_rows_are_little_endian_x_y_z_reflectance(tmp_path):
    rows = [(52.25, -3.5, 1.75, 0.5), (0.0, 0.0, 0.0, 0.0), (float("nan"), 1.0, 2.0, 1.0)]
    (tmp_path / "000000.bin").write_bytes(b"".join(struct.pack("<4f", *row) for row in rows))
    cloud = read_cloud(tmp_path / "000000.bin")
    assert cloud.points.dtype == np.float64 and cloud.attributes["reflectance"].dtype == np.float32
    np.testing.assert_array_equal(cloud.points, [row[:3] for row in rows])
    assert cloud.attributes["reflectance"].tolist() == [0.5, 0, 1]
