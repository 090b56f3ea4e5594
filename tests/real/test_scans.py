"""Real files in their official layouts are read as they are."""

import numpy as np
import pytest

from n2n.formats import read_cloud


@pytest.mark.parametrize(
    ("path", "count", "attributes"),
    [
        ("srb/scans/anchor.ply", 85_127, {"nx", "ny", "nz"}),
        ("kitti/object/training/velodyne/000000.bin", 115_384, {"reflectance"}),
        ("3dscene/input/lounge_1000.ply", 43_400, set()),
        ("street/Lille_street_small.ply", 170_610, set()),
        ("PCNet/happy100k_noise_white_1.00e-02.xyz", 100_000, set()),
        ("PUNet/meshes/test/Octahedron.off", 6, set()),
    ],
)
def test_read(data, path, count, attributes):
    cloud = read_cloud(data / path)
    assert len(cloud) == count
    assert attributes <= set(cloud.attributes)
    assert np.isfinite(cloud.points).all() and np.ptp(cloud.points, axis=0).min() > 0


def test_shapenet_clouds_hold_points_and_normals(data):
    path = next((data / "ShapeNet").glob("*/*/pointcloud.npz"))
    cloud = read_cloud(path)
    assert len(cloud) == 100_000 and cloud.attributes["normals"].shape == (100_000, 3)
