"""Protocols on real shapes: the numbers of independent code, and the floors that perfect surfaces are known to have."""

import json

import numpy as np
import point_cloud_utils as pcu
import pytest
import trimesh
from scipy.spatial import cKDTree

from n2n.cli.main import main
from n2n.evaluation.protocol import load_protocol
from n2n.formats import write_mesh
from n2n.geometry.poisson import poisson_disk
from n2n.geometry.reference import Reference


def unit_sphere(points):
    """Return the map of score-denoise: box centre, farthest point."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    scale = np.linalg.norm(points - centre, axis=1).max()
    return lambda x: (x - centre) / scale


@pytest.fixture
def shape(data):
    """Return a function: name of a PU shape -> vertices in the unit sphere, faces."""

    def load(name):
        path = data / "PUNet" / "meshes" / "test" / f"{name}.off"
        if not path.exists():
            pytest.skip(f"{path} is missing")
        mesh = trimesh.load(path, process=False)
        vertices = np.asarray(mesh.vertices, np.float64)
        return unit_sphere(vertices)(vertices), np.asarray(mesh.faces, np.int64)

    return load


@pytest.mark.parametrize("case", ["stanford-bunny_10000_1", "spot_10000_3", "fandisk_10000_2"])
def test_the_command_gives_the_numbers_of_independent_code(peers, tmp_path, monkeypatch, case):
    monkeypatch.chdir(tmp_path)
    arrays = peers(case)
    clean, noisy, vertices, faces = (arrays[name] for name in ("clean", "noisy", "verts", "faces"))
    np.savetxt("clean.xyz", clean, fmt="%.17g")
    np.savetxt("noisy.xyz", noisy, fmt="%.17g")
    write_mesh("mesh.ply", trimesh.Trimesh(vertices, faces, process=False))
    reference = ["--reference", "clean.xyz", "--reference", "mesh.ply"]
    settings = ["--protocol", "sbp", "--noisy", "noisy.xyz", "--json", "a.json"]
    assert main(["evaluate", "noisy.xyz", *reference, *settings]) == 0
    record = json.loads((tmp_path / "a.json").read_text())

    def cd_sum(p):
        to = unit_sphere(clean)
        p, q = to(p), to(clean)
        return (cKDTree(q).query(p)[0] ** 2).mean() + (cKDTree(p).query(q)[0] ** 2).mean()

    to = unit_sphere(vertices)
    distance, face, weights = pcu.closest_points_on_mesh(noisy, vertices, faces)
    oracle = pcu.interpolate_barycentric_coords(faces, face, weights, vertices)
    scaled = pcu.closest_points_on_mesh(to(noisy), to(vertices), faces)[0]
    assert record["values"]["cd_sum2"] == pytest.approx(cd_sum(noisy), rel=1e-9)
    assert record["values"]["cd_mean2"] == pytest.approx(cd_sum(noisy) / 2, rel=1e-9)
    assert record["values"]["p2m_forward"] == pytest.approx((scaled**2).mean(), rel=1e-6)
    assert record["floors"]["oracle"]["cd_sum2"] == pytest.approx(cd_sum(oracle), rel=1e-6)
    assert len(distance) == record["samples"]["prediction"]["points"]


# Shape: L1CD x 10 and both NC of 100,000 samples, L2CD x 100 and CD-P2S x 100 of 10,000 uniform ones, in the unit cube.
FLOORS = {
    "duck": (0.0258, 0.9960, 0.9973, 0.0084, 1.62),
    "chair": (0.0151, 0.9870, 0.9903, 0.0029, 0.95),
    "horse": (0.0162, 0.9936, 0.9951, 0.0033, 1.02),
}


@pytest.mark.parametrize("name", FLOORS)
def test_the_true_mesh_reaches_the_known_floors(shape, name):
    vertices, faces = shape(name)
    vertices = vertices / np.ptp(vertices, axis=0).max()
    l1, nc, inflated, l2, sum1 = FLOORS[name]
    mesh, truth = trimesh.Trimesh(vertices, faces, process=False), Reference(vertices=vertices, faces=faces)
    onet = load_protocol("onet").evaluate(mesh, truth)
    assert onet.printed("cd_mean1") == pytest.approx(l1, rel=0.02)
    assert onet.values["nc"] == pytest.approx(nc, abs=0.001)
    assert onet.values["nc_inflated"] == pytest.approx(inflated, abs=0.001)
    assert onet.values["fscore"] == pytest.approx(1, abs=1e-4)
    assert onet.floors["resample"]["cd_mean1"] == pytest.approx(onet.values["cd_mean1"], rel=0.02)
    neuralpull = load_protocol("neuralpull").evaluate(mesh, truth)
    assert neuralpull.printed("cd_mean2") == pytest.approx(l2, rel=0.05)
    # The floor of CD-P2S was measured with uniform samples; the even ones of the protocol lie closer.
    assert 200 * neuralpull.values["cd_mean1"] == pytest.approx(sum1, rel=0.02)
    assert load_protocol("p2s").evaluate(mesh, truth).printed("cd_sum1") == pytest.approx(0.855 * sum1, rel=0.02)
    sap = load_protocol("sap").evaluate(mesh, truth)
    assert 0.041 < sap.printed("cd_mean1") < 0.064 and 0.86 < sap.values["fscore"] < 0.99


# Shape: CD-sum2 x 10^4 of doing nothing, of the oracle and of another Poisson-disk cloud; 10,000 points, 1 % noise.
DENOISING = {"duck": (4.12, 2.407, 2.478), "casting": (4.09, 2.443, 2.444), "camel": (2.73, 1.231, 1.014)}


@pytest.mark.parametrize("name", DENOISING)
def test_denoising_has_the_known_floors(shape, name):
    vertices, faces = shape(name)
    clean = poisson_disk(vertices, faces, 10_000, seed=1)
    noisy = clean + 0.01 * np.random.default_rng(2).standard_normal(clean.shape)
    result = load_protocol("sbp").evaluate(noisy, Reference(points=clean, vertices=vertices, faces=faces), noisy)
    nothing, oracle, resample = DENOISING[name]
    assert result.printed("cd_sum2") == pytest.approx(nothing, rel=0.03)
    assert result.printed("cd_sum2", result.floors["oracle"]["cd_sum2"]) == pytest.approx(oracle, rel=0.03)
    assert result.printed("cd_sum2", result.floors["resample"]["cd_sum2"]) == pytest.approx(resample, rel=0.03)


def test_abc_is_measured_in_the_stored_unit(data):
    """The original meshes have longest edge 1; the stored ones are turned, and their axis-aligned boxes are larger."""
    boxes = []
    for path in sorted((data / "abc_minimal/03_meshes").glob("*.ply")):
        mesh = trimesh.load(path, process=False)
        assert mesh.bounding_box_oriented.primitive.extents.max() == pytest.approx(1, abs=0.01)
        boxes.append(np.ptp(mesh.vertices, axis=0).max())
        wrong = mesh.copy().apply_translation((0, 0, 0.002))
        truth = Reference(vertices=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces))
        l2 = load_protocol("neuralpull").evaluate(wrong, truth).values["cd_mean2"]
        (there, _), (back, _) = (trimesh.sample.sample_surface(m, 10_000, seed=s) for m, s in ((wrong, 11), (mesh, 12)))
        expected = ((cKDTree(back).query(there)[0] ** 2).mean() + (cKDTree(there).query(back)[0] ** 2).mean()) / 2
        assert l2 == pytest.approx(expected, rel=0.05)
    if not boxes:
        pytest.skip("no ABC meshes here")
    assert min(boxes) > 1.1 and max(boxes) < 1.36
