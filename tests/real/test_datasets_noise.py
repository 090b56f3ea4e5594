"""The real PU, PC and ShapeNet samples through their data modules, against what is known of the benchmarks."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from n2n.datamodules.pointcleannet import PCDataModule
from n2n.datamodules.punet import PUDataModule
from n2n.datamodules.shapenet import ShapeNetDataModule
from n2n.formats import read_cloud

# Chamfer distance, sum of both mean squared distances, x 10^4, of noisy and clean clouds of 10 000 points: published
# for PU at 1 and 3 %. Poisson-disk clouds of other samplers differ by a few per cent.
DO_NOTHING = {"duck": (4.12, 14.74), "fandisk": (3.30, 12.78), "Icosahedron": (4.71, 16.59)}


def _chamfer(a, b):
    return (cKDTree(a).query(b)[0] ** 2).mean() + (cKDTree(b).query(a)[0] ** 2).mean()


@pytest.mark.parametrize("shape", DO_NOTHING)
def test_pu_is_as_noisy_as_the_benchmark(data, shape):
    for noise, expected in zip((0.01, 0.03), DO_NOTHING[shape], strict=True):
        module = PUDataModule(shape, noise=noise, root=str(data))
        assert 1e4 * _chamfer(module.noisy, module.reference.points) == pytest.approx(expected, rel=0.03)
    clean = module.reference.points
    assert clean.shape == (10_000, 3) and np.linalg.norm(clean, axis=1).max() == pytest.approx(1)
    assert cKDTree(clean).query(clean, 2)[0][:, 1].min() > 0.01
    assert np.linalg.norm(module.reference.vertices, axis=1).max() == pytest.approx(1, abs=0.02)


def test_pu_shapes_that_are_here(data):
    names = PUDataModule.names(str(data))
    assert len(names) == 13 and names[0] == "Icosahedron" and names[-1] == "star"
    assert "sculpt" in PUDataModule.missing(str(data)) and "quadric" in PUDataModule.missing(str(data))


def test_pc_official_noise_is_relative_to_the_longest_edge(data):
    module = PCDataModule("galera", official=True, root=str(data))
    clean, noisy = module.reference.points, module.noisy
    assert clean.shape == noisy.shape == (10_000, 3) and np.linalg.norm(clean, axis=1).max() == pytest.approx(1)
    np.testing.assert_allclose((noisy - clean).std(axis=0), 0.01 * np.ptp(clean, axis=0).max(), rtol=0.03)


def test_pc_rows_are_of_the_file_and_evenly_spread(data):
    module = PCDataModule("happy", points=10_000, root=str(data))
    stored = read_cloud(data / "PCNet/happy100k.xyz").points
    middle = (stored.min(axis=0) + stored.max(axis=0)) / 2
    radius = np.linalg.norm(stored - middle, axis=1).max()
    points, unit = module.reference.points, (stored - middle) / radius
    # The frame is that of the rows chosen, which reach nearly as far as all.
    assert cKDTree(unit).query(points)[0].max() < 0.01
    gap = cKDTree(points).query(points, 2)[0][:, 1]
    assert np.quantile(gap, 0.9) / gap.min() < 1.4  # of independent points it is more than 10


def test_shapenet(data):
    names = ShapeNetDataModule.names(str(data))
    assert len([name for name in names if name.startswith("bench/")]) == 5 and len(names) == 12
    for name in (names[0], names[-1]):
        module = ShapeNetDataModule(name, root=str(data), num_observations=3)
        reference = module.reference
        assert module.name == name and module.noisy.shape == (3000, 3)
        assert np.ptp(reference.points, axis=0).max() == pytest.approx(1, abs=0.01)
        # Farther than the noise alone would reach, nothing is; nearer to a surface, points move along it.
        assert cKDTree(reference.points).query(module.noisy)[0].max() < 6 * 0.005
        np.testing.assert_allclose(np.linalg.norm(reference.normals, axis=1), 1, atol=1e-9)
