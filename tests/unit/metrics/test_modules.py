"""The registered metrics keep the contract of torchmetrics; their numbers are those of the functions."""

import pickle

import numpy as np
import pytest
import torch
from torchmetrics import Metric, MetricCollection

from n2n.errors import ConfigError, InputError
from n2n.metrics.chamfer import chamfer, directions
from n2n.metrics.emd import emd
from n2n.metrics.fscore import fscore
from n2n.metrics.hausdorff import hausdorff
from n2n.metrics.normals import normal_consistency
from n2n.metrics.point_mesh import point_to_mesh
from n2n.metrics.sdf_error import sdf_error
from n2n.registry import METRICS

FACES = np.array([[0, 1, 2], [2, 3, 4], [5, 6, 7]])
CASES = {
    "emd": ({"p": 2}, lambda a, b, n, m: ((a, b), emd(a, b, 2))),
    "fscore": ({"threshold": 0.5}, lambda a, b, n, m: ((a, b), fscore(*directions(a, b), 0.5))),
    "hausdorff": ({}, lambda a, b, n, m: ((a, b), hausdorff(a, b))),
    "l1cd": ({}, lambda a, b, n, m: ((a, b), chamfer(a, b, 1))),
    "l2cd": ({"combine": "sum"}, lambda a, b, n, m: ((a, b), chamfer(a, b, 2, "sum"))),
    "nc": ({"inflated": True}, lambda a, b, n, m: ((a, n, b, m), normal_consistency(a, n, b, m, True))),
    "p2m": ({"min_triangle_area": 0.5}, lambda a, b, n, m: ((a, b, FACES), in_order(point_to_mesh(a, b, FACES, 0.5)))),
    "sdf_error": ({"band": 0.7}, lambda a, b, n, m: ((a[:, 0], b[:, 0]), sdf_error(a[:, 0], b[:, 0], 0.7))),
}


def in_order(found):
    return found.total, found.forward, found.backward


def shapes(name):
    random = np.random.default_rng(0)
    return [CASES[name][1](*random.normal(size=(4, 40, 3))) for _ in range(3)]


def build(name):
    return METRICS.build({"name": name, **CASES[name][0]})


def flat(value):
    return np.array([float(v) for v in value.values()] if isinstance(value, dict) else [float(value)])


def test_every_builtin_metric_is_tested():
    assert set(CASES) == set(METRICS.names())


@pytest.mark.parametrize("name", CASES)
def test_compute_is_the_mean_over_shapes_and_a_call_is_one_shape(name):
    metric = build(name)
    assert isinstance(metric, Metric)
    called = [flat(metric(*arrays)) for arrays, _ in shapes(name)]
    expected = [np.atleast_1d(value) for _, value in shapes(name)]
    assert np.allclose(called, expected, rtol=1e-14)
    assert np.allclose(flat(metric.compute()), np.mean(expected, axis=0), rtol=1e-14)


@pytest.mark.parametrize("name", CASES)
def test_states_reset_merge_and_survive_pickle(name):
    whole, first, second = build(name), build(name), build(name)
    for index, (arrays, _) in enumerate(shapes(name)):
        whole.update(*arrays)
        (first if index else second).update(*arrays)
    first = pickle.loads(pickle.dumps(first))
    first.merge_state(second)
    assert np.allclose(flat(first.compute()), flat(whole.compute()), rtol=1e-14)
    whole.reset()
    with pytest.warns(UserWarning, match="before"), pytest.raises(InputError, match="no shape was measured yet"):
        whole.compute()
    arrays, value = shapes(name)[0]
    whole.update(*(torch.as_tensor(array) for array in arrays))
    assert np.allclose(flat(whole.compute()), value, rtol=1e-14)


def test_a_collection_names_all_numbers():
    metrics = MetricCollection({name: build(name) for name in ("l1cd", "l2cd", "fscore")})
    metrics.update(*shapes("l1cd")[0][0])
    assert set(metrics.compute()) == {"l1cd", "l2cd", "fscore", "precision", "recall"}


@pytest.mark.parametrize(
    ("name", "wrong", "message"),
    [
        ("l1cd", {"combine": "max"}, "combine=max is not known; choose one of: mean, sum"),
        ("fscore", {"threshold": -1.0}, "threshold=-1"),
        ("emd", {"p": 3}, "p=3"),
        ("sdf_error", {"band": 0.0}, "band=0"),
    ],
)
def test_settings_are_checked_when_built(name, wrong, message):
    with pytest.raises(ConfigError, match=message):
        METRICS.build({"name": name, **wrong})
