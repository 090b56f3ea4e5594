"""Noise models: the deviation that was asked for, and each its own character."""

import numpy as np
import pytest
from scipy.stats import kurtosis

from n2n.errors import InputError
from n2n.geometry.noise import NOISE_MODELS, add_noise

SCALE = 0.02


@pytest.fixture(scope="module")
def ball():
    """20 000 points of the unit sphere; they are their own normals."""
    points = np.random.default_rng(5).standard_normal((20_000, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def _moved(ball, model, seed=0, normals=None):
    return add_noise(ball, model, SCALE, np.random.default_rng(seed), normals) - ball


# Of discrete noise the fourth moment over the squared variance: half zeros, half steps of 1 and 2.
@pytest.mark.parametrize(
    ("model", "excess"),
    [("gaussian", 0.0), ("uniform", -1.2), ("laplace", 3.0), ("discrete", (1 + 16) / 4 / (5 / 4) ** 2 - 3)],
)
def test_deviation_and_tails_along_every_axis(ball, model, excess):
    moved = _moved(ball, model)
    np.testing.assert_allclose(moved.std(axis=0), SCALE, rtol=0.03)
    np.testing.assert_allclose(moved.mean(axis=0), 0, atol=5 * SCALE / np.sqrt(len(ball)))
    assert np.abs(np.corrcoef(moved.T) - np.eye(3)).max() < 0.04
    np.testing.assert_allclose(kurtosis(moved, axis=0), excess, atol=0.45 if model == "laplace" else 0.15)


def test_range_noise_lies_on_one_ray_for_each_point(ball):
    first, second = (_moved(ball, "range", seed) for seed in (1, 2))
    np.testing.assert_allclose(np.cross(first, second), 0, atol=1e-15)
    along = np.linalg.norm(first, axis=1) * np.sign(np.einsum("ni,ni->n", first, second))
    np.testing.assert_allclose(np.sqrt((along**2).mean()), SCALE, rtol=0.02)
    # The camera that is chosen sees the point from the front: no ray grazes the sphere.
    facing = np.abs(np.einsum("ni,ni->n", first, ball)) / np.linalg.norm(first, axis=1)
    assert facing.min() > 0.5 and facing.mean() > 0.8


def test_range_noise_comes_from_few_places(ball):
    """Rays of all points, drawn back, meet in the cameras: a dozen points four radii away."""
    line = _moved(ball, "range", 1, ball)
    line /= -np.linalg.norm(line, axis=1, keepdims=True) * np.sign(np.einsum("ni,ni->n", line, ball))[:, None]
    # Where each ray, going outwards, pierces the sphere of radius 4 around the centre.
    outward = -line
    b = np.einsum("ni,ni->n", ball, outward)
    pierced = ball + outward * (np.sqrt(b**2 + 15) - b)[:, None]
    assert len(np.unique(pierced.round(3), axis=0)) <= 24  # rounding may split one in two
    distinct = pierced[np.unique(pierced.round(2), axis=0, return_index=True)[1]]
    assert 10 <= len(distinct) <= 20


def test_discrete_noise_leaves_half_and_moves_by_whole_steps(ball):
    moved = _moved(ball, "discrete")
    still = (moved == 0).all(axis=1)
    assert 0.48 < still.mean() < 0.52
    sizes = np.unique(np.abs(moved[~still]).round(9))
    np.testing.assert_allclose(sizes[1] / sizes[0], 2, rtol=1e-6)
    assert len(sizes) == 2 and (moved[~still] != 0).all()


@pytest.mark.parametrize("model", ["outliers", "mixed"])
def test_outliers_are_a_twentieth_all_over_the_box(ball, model):
    noisy = ball + _moved(ball, model)
    far = np.abs(np.linalg.norm(noisy, axis=1) - 1) > 10 * SCALE
    # Of a box of edge 2.4 the shell between 0.8 and 1.2 takes 37 %.
    assert abs(far.mean() - 0.05 * (1 - 4 / 3 * np.pi * (1.2**3 - 0.8**3) / 2.4**3)) < 0.006
    assert np.abs(noisy).max() < 1.25 and np.linalg.norm(noisy, axis=1).max() > 1.7


def test_outliers_replace_exactly_a_twentieth(ball):
    plain, strayed = _moved(ball, "gaussian"), _moved(ball, "outliers")
    assert (plain != strayed).any(axis=1).sum() == len(ball) // 20


def test_mixed_noise_holds_its_parts(ball):
    moved = _moved(ball, "mixed")
    assert 0.07 < (moved == 0).all(axis=1).mean() < 0.12  # the still half of the fifth that is discrete
    assert (np.abs(moved) <= np.sqrt(3) * SCALE).all(axis=1).mean() > 0.5


@pytest.mark.parametrize("model", list(NOISE_MODELS))
def test_same_generator_same_noise_and_none_at_zero(ball, model):
    assert (_moved(ball, model, 3) == _moved(ball, model, 3)).all()
    assert (_moved(ball, model, 3) != _moved(ball, model, 4)).any()
    if model not in ("outliers", "mixed"):
        assert (add_noise(ball, model, 0.0, np.random.default_rng(0)) == ball).all()


def test_mistakes():
    points = np.zeros((3, 3))
    with pytest.raises(InputError, match="noise model 'gauss' is not known; choose one of: gaussian, uniform"):
        add_noise(points, "gauss", 0.1, np.random.default_rng(0))
    for scale in (-0.1, float("nan"), float("inf")):
        with pytest.raises(InputError, match="is out of range; give a standard deviation >= 0"):
            add_noise(points, "gaussian", scale, np.random.default_rng(0))
