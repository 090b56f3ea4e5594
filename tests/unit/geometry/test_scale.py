import numpy as np
import pytest

from n2n.geometry.scale import estimate_scales
from n2n.geometry.shapes import sample_surface


@pytest.mark.parametrize("noise", [0.005, 0.01, 0.02, 0.03])
def test_noise_of_a_torus_is_found_within_a_quarter(noise):
    points = sample_surface("torus", 10_000)
    noisy = points + noise * np.random.default_rng(1).standard_normal(points.shape)
    assert estimate_scales(noisy).noise == pytest.approx(noise, rel=0.25)


def test_area_of_a_sphere_is_found_within_a_tenth():
    scales = estimate_scales(sample_surface("sphere", 10_000))
    assert scales.area == pytest.approx(4 * np.pi, rel=0.1)
    assert scales.spacing == pytest.approx(np.sqrt(4 * np.pi / 10_000), rel=0.05)


def test_a_clean_cloud_has_almost_no_noise():
    scales = estimate_scales(sample_surface("sphere", 10_000))
    assert scales.noise < 0.02 * scales.spacing


def test_scaling_the_points_scales_the_lengths():
    points = sample_surface("torus", 4000) + 0.01 * np.random.default_rng(1).standard_normal((4000, 3))
    small, large = estimate_scales(points), estimate_scales(100 * points)
    assert large.noise == pytest.approx(100 * small.noise)
    assert large.spacing == pytest.approx(100 * small.spacing)
    assert large.patch == small.patch


@pytest.mark.parametrize("spacing", [0.4, 0.7, 1.0, 1.6, 3.0])
def test_dense_or_sparse_a_flat_sheet_tells_its_noise_and_spacing(spacing):
    random, count = np.random.default_rng(2), 20_000
    side = spacing * np.sqrt(count)
    flat = np.c_[random.uniform(0, side, (count, 2)), np.zeros(count)]
    scales = estimate_scales(flat + random.standard_normal(flat.shape))
    assert scales.noise == pytest.approx(1, rel=0.08)
    assert scales.spacing == pytest.approx(spacing, rel=0.08)


def test_the_wall_of_a_thin_shell_is_not_noise():
    random, count = np.random.default_rng(3), 10_000
    side = np.sqrt(count / 2)  # two sheets, spacing 1 on each, five deviations apart
    sheets = np.c_[random.uniform(0, side, (count, 2)), 2.5 * random.choice([-1, 1], count)]
    assert estimate_scales(sheets + 0.5 * random.standard_normal(sheets.shape)).noise < 0.6
