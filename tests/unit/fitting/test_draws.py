"""What a fit is shown: pairs of observations that depend on the seed and the iteration alone."""

import itertools

import numpy as np
import pytest
import torch

from n2n.datamodules.observations import ObservationsDataModule
from n2n.errors import InputError


def _data(*counts, shapes=1, **more):
    random = np.random.default_rng(0)
    return ObservationsDataModule([[random.normal(size=(n, 3)) for n in counts] for _ in range(shapes)], **more)


def _draws(data, count=20, pairs="random", points=50, seed=0, first=0, step=1):
    data.configure_draws(pairs, points, seed, first, step)
    return list(itertools.islice(iter(data.train_dataloader()), count))


def _observation(data, points, condition=0):
    """Which observation a draw shows."""
    return next(i for i, cloud in enumerate(data.shapes[condition]) if torch.equal(cloud, points))


def _same_draws(a, b):
    return all(
        torch.equal(x.source, y.source) and torch.equal(x.target, y.target) and x.condition == y.condition
        for x, y in zip(a, b, strict=True)
    )


def test_a_later_start_shows_what_an_earlier_one_would_have_shown():
    data = _data(60, 60, 60, 60, shapes=2)
    whole = _draws(data, count=8, step=10)
    assert _same_draws(_draws(data, count=5, first=30, step=10), whole[3:])
    assert _same_draws(_draws(data, count=8, step=10), whole)


def test_seeds_differ():
    data = _data(60, 60, 60, 60)
    assert not _same_draws(_draws(data, seed=1), _draws(data, seed=2))


def test_random_pairs_are_independent_and_may_agree():
    data = _data(60, 60, 60)
    draws = _draws(data, count=100)
    pairs = [(_observation(data, d.source), _observation(data, d.target)) for d in draws]
    assert len(set(pairs)) == 9
    assert all(d.same == (i == j) for d, (i, j) in zip(draws, pairs, strict=True))


def test_same_pairs_agree_and_visit_every_observation():
    data = _data(60, 60, 60)
    draws = _draws(data, pairs="same")
    assert all(d.same and d.source is d.target for d in draws)
    assert {_observation(data, d.source) for d in draws} == {0, 1, 2}


def test_one_observation_is_paired_with_itself():
    assert all(d.same for d in _draws(_data(60)))


def test_small_observations_are_merged_until_a_draw_holds_enough():
    data = _data(60, 60, 60, 60)
    for draw in _draws(data, points=150, pairs="same"):
        assert len(draw.source) == len(draw.target) == 180 and draw.key is None
    assert all(len(draw.source) == 240 for draw in _draws(data, points=10_000, pairs="same"))


def test_a_random_pair_is_two_observations_however_small():
    assert all(len(draw.source) == len(draw.target) == 60 for draw in _draws(_data(60, 60, 60), points=150))


def test_repeated_and_far_points_take_no_part():
    cloud = np.random.default_rng(0).normal(size=(300, 3))
    cloud /= np.linalg.norm(cloud, axis=1, keepdims=True)
    data = ObservationsDataModule([[np.concatenate([cloud, cloud[:50], [[900.0, 0, 0]]])]])
    assert data.left_out == [51] and data.outliers == [1] and len(data.shapes[0][0]) == 300
    assert data.frames[0].scale < 1.1


def test_each_observation_is_judged_by_itself():
    random = np.random.default_rng(0)
    fine, coarse = (random.normal(size=(count, 3)) for count in (5000, 600))
    fine /= np.linalg.norm(fine, axis=1, keepdims=True)
    coarse *= (1 + 0.05 * random.normal(size=(600, 1))) / np.linalg.norm(coarse, axis=1, keepdims=True)
    stray = np.array([[0.0, 0, 0], [2.2, 0, 0]])
    # Among the fine ones the coarse ones would be strays, too.
    data = ObservationsDataModule([[fine, np.concatenate([coarse, stray])]])
    assert data.outliers == [2] and [len(cloud) for cloud in data.shapes[0]] == [5000, 600]


def test_the_fingerprint_is_of_the_content():
    assert _data(60).fingerprint() == _data(60).fingerprint()
    assert _data(60).fingerprint() != _data(61).fingerprint()


@pytest.mark.parametrize("counts", [(200, 20, 20, 20), (20, 20, 20, 200)])
def test_draws_hold_enough_points_whatever_the_first_observation_has(counts):
    draws = _draws(_data(*counts), points=50, pairs="same")
    assert all(len(draw.source) >= 50 for draw in draws)


def test_keys_name_the_source():
    data = _data(60, 60, shapes=2)
    seen = {}
    for draw in _draws(data, count=40):
        seen.setdefault(draw.key, draw.source)
        assert torch.equal(seen[draw.key], draw.source)
    assert len(seen) == 4


def test_shapes_are_visited_with_their_condition():
    data = _data(60, 60, shapes=3)
    draws = _draws(data, count=40)
    assert {d.condition for d in draws} == {0, 1, 2}
    for draw in draws:
        _observation(data, draw.source, draw.condition), _observation(data, draw.target, draw.condition)


def test_each_shape_has_a_frame_around_all_its_observations():
    random = np.random.default_rng(0)
    clouds = [random.normal(size=(50, 3)) + [5e5, 5e6, 100], 3 * random.normal(size=(70, 3)) + [5e5, 5e6, 100]]
    data = ObservationsDataModule([clouds, [random.normal(size=(50, 3))]])
    assert torch.cat(data.shapes[0]).norm(dim=1).max().item() == pytest.approx(1, abs=1e-6)
    for cloud, unit in zip(clouds, data.shapes[0], strict=True):
        assert np.abs(data.frames[0].to_world(unit.double().numpy()) - cloud).max() < 1e-5
    assert data.frames[0].scale > 2 * data.frames[1].scale


def test_num_observations_takes_the_first_ones_or_says_how_many_there_are():
    assert [len(cloud) for cloud in _data(60, 70, 80, num_observations=2).shapes[0]] == [60, 70]
    with pytest.raises(InputError, match="num_observations=4, but only 3 given"):
        _data(60, 70, 80, num_observations=4)


@pytest.mark.parametrize("shapes", [[], [[]]])
def test_nothing_to_fit_is_told(shapes):
    with pytest.raises(InputError, match="no observations given"):
        ObservationsDataModule(shapes)
