"""Generated scans know their truth."""

import numpy as np
import pytest
import trimesh

from n2n.datamodules.generated import GeneratedDataModule
from n2n.errors import InputError
from n2n.geometry.noise import NOISE_MODELS
from n2n.geometry.shapes import scan


@pytest.mark.parametrize("model", list(NOISE_MODELS))
def test_truth_is_row_aligned_with_the_first_scan(model):
    data = GeneratedDataModule("sphere", 2000, 0.02, model)
    clean, normals = data.reference.points, data.reference.normals
    np.testing.assert_allclose(np.linalg.norm(clean, axis=1), 1, atol=1e-9)
    np.testing.assert_allclose(normals, clean, atol=1e-6)
    moved = np.linalg.norm(data.noisy - clean, axis=1)
    assert np.median(moved) < 0.06 and (moved < 0.2).mean() > 0.94
    assert data.name == "sphere" and model in data.source and "seed 0" in data.source


def test_mesh_of_the_torus():
    reference = GeneratedDataModule("torus", 500).reference
    mesh = trimesh.Trimesh(reference.vertices, reference.faces, process=False)
    assert mesh.is_watertight and mesh.euler_number == 0
    assert mesh.volume == pytest.approx(2 * np.pi**2 * 0.7 * 0.25**2, rel=2e-3)
    ring = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1]) - 0.7
    np.testing.assert_allclose(np.hypot(ring, mesh.vertices[:, 2]), 0.25, atol=1e-3)


def test_gaussian_scans_are_what_they_were():
    data = GeneratedDataModule("sphere", 300, 0.02, observations=2, seed=4)
    assert len(data.shapes[0]) == 2 and (data.noisy == scan("sphere", 300, 0.02, 4)).all()


@pytest.mark.parametrize(
    ("observations", "num_observations", "used"), [(None, None, 1), (None, 3, 3), (3, None, 3), (3, 2, 2), (2, 4, 4)]
)
def test_how_many_scans(observations, num_observations, used):
    data = GeneratedDataModule("sphere", 150, observations=observations, num_observations=num_observations)
    assert len(data.shapes[0]) == used
    assert len({cloud.numpy().tobytes() for cloud in data.shapes[0]}) == used


def test_names():
    assert GeneratedDataModule.names() == ["bracket", "sphere", "torus"] and GeneratedDataModule.missing() is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"shape": "torsu"}, "unknown shape 'torsu'. Did you mean 'torus'?"),
        ({"points": 99}, "datamodule.points=99 is out of range; give a whole number >= 100"),
        ({"observations": 0}, "datamodule.observations=0 is out of range"),
        ({"noise": float("nan")}, "noise=nan is out of range"),
        ({"noise_model": "none"}, "noise model 'none' is not known"),
    ],
)
def test_mistakes(arguments, message):
    with pytest.raises(InputError) as caught:
        GeneratedDataModule(**arguments)
    assert message in str(caught.value)
