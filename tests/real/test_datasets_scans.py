"""The data modules of scans read the official files as they were downloaded."""

import numpy as np
import pytest
from point_cloud_utils import closest_points_on_mesh

from n2n.cli.main import main
from n2n.datamodules.paris import ParisDataModule
from n2n.datamodules.reading import read_points, read_scan
from n2n.datamodules.scans import ScanDataModule
from n2n.errors import InputError
from n2n.registry import DATAMODULES

PRESENT = {
    ("famous", "famous_original"): {"bunny": 20_802, "horse": 33_657},
    ("abc", "abc_minimal"): {
        "00994122_57d9d4755722f9d2d7436f0a_trimesh_000": 34_693,
        "00011084_fddd53ce45f640f3ab922328_trimesh_019": 59_979,
        "00016513_3d6966cd42eb44ab8f4224f2_trimesh_053": 86_648,
    },
    ("srb", None): {"anchor": 85_127, "dc": 71_265, "gargoyle": 95_435},
    ("scene3d", None): {"lounge": 43_400, "copyroom": 67_609},
    ("kitti", "training"): {"000000": 115_384, "000001": 120_268},
}


# The sample's bunny and its mesh are not in one frame; see below.
APART = ("famous", "bunny")


@pytest.mark.parametrize(("dataset", "variant"), PRESENT)
def test_all_scans_are_found_and_read(data, dataset, variant):
    module = DATAMODULES.get(dataset)
    assert issubclass(module, ScanDataModule)
    expected = PRESENT[dataset, variant]
    assert set(expected) <= set(module.names(str(data), variant))
    for scan in module.part(str(data), variant).scans:
        if scan.name in expected:
            points = read_points(scan.path)
            assert len(points) == expected[scan.name]
            if (dataset, scan.name) != APART:
                again, reference = read_scan(scan)
                assert np.array_equal(points, again)
                assert (scan.truth is None) == (reference.vertices is None and reference.points is None)


def test_scans_lie_on_their_meshes_up_to_sensor_noise(data):
    """By the exact distances of another library: noise is at most some 5 % of the longest edge."""
    for scan in DATAMODULES.get("abc").part(str(data), "abc_minimal").scans:
        points, reference = read_scan(scan)
        distance = closest_points_on_mesh(points[::50].copy(), reference.vertices.copy(), reference.faces.copy())[0]
        assert np.median(distance) < 0.02 and np.quantile(distance, 0.99) < 0.1


def test_a_pair_of_mixed_scales_is_refused(data):
    """The bunny's mesh is 0.883 times its scan: each vertex of the scan is some 7 % of the longest edge off."""
    scans = {scan.name: scan for scan in DATAMODULES.get("famous").part(str(data)).scans}
    with pytest.raises(InputError, match=r"bunny\.xyz\.npy.*03_meshes/bunny\.ply.*scaling by 0\.88.*expected"):
        read_scan(scans["bunny"])
    module = DATAMODULES.build({"name": "famous", "shape": "horse", "root": str(data)})
    assert len(module.noisy) == 33_657 and module.reference.faces.shape == (96_966, 3)


def test_a_street_in_chunks(data):
    file = data / "street/Lille_street_small.ply"
    module = ParisDataModule(chunk=19, chunks=20, file=str(file))
    assert len(module.noisy) == 170_610 // 20
    assert np.ptp(module.noisy, axis=0).max() < 25 < np.ptp(read_points(file), axis=0).max()


def test_the_command_reads_all_that_is_here(data, monkeypatch, capsys):
    monkeypatch.setenv("N2N_DATA", str(data))
    assert main(["data", "verify", "srb"]) == 0
    assert main(["data", "verify", "famous"]) == 2
    assert main(["data", "list"]) == 0
    output = capsys.readouterr().out
    assert "all good" in output and output.count("BAD") == 1 and "famous_original 2 of 22" in output
