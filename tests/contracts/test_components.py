"""Every registered component keeps the contract that plugin authors are given."""

import numpy as np
import pytest
import torch

from n2n import registry, testing
from n2n.errors import ConfigError
from n2n.metrics.modules import ShapeMean

ARGUMENTS = {"grid": {"voxel": 0.1}, "mlp": {"layers": 3, "width": 32}, "siren": {"layers": 2, "width": 32}}


@pytest.mark.parametrize("name", registry.ARCHITECTURES.names())
def test_architecture(name):
    testing.check_architecture(lambda **extra: registry.ARCHITECTURES.build({"name": name, **ARGUMENTS[name]}, **extra))


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("name", registry.DISTANCES.names())
def test_distance(name, p):
    testing.check_distance(registry.DISTANCES.build({"name": name, "p": p}))


@pytest.mark.parametrize("name", registry.REGULARISERS.names())
def test_regulariser(name):
    testing.check_regulariser(registry.REGULARISERS.build(name))


@pytest.mark.parametrize("name", registry.PAIRINGS.names())
def test_pairing(name):
    testing.check_pairing(lambda **extra: registry.PAIRINGS.build(name, **extra))


def shapes(name):
    """Return what a metric is given for three shapes."""
    random = np.random.default_rng(0)
    found = []
    for _ in range(3):
        a, b = random.normal(size=(2, 30, 3))
        normals = a / np.linalg.norm(a, axis=1, keepdims=True)
        others = {
            "nc": (a, normals, b, normals),
            "p2m": (a, b, np.arange(30).reshape(-1, 3)),
            "sdf_error": (a[:, 0], b[:, 0]),
        }
        found.append(others.get(name, (a, b)))
    return found


@pytest.mark.parametrize("name", registry.METRICS.names())
def test_metric(name):
    testing.check_metric(registry.METRICS.build(name), shapes(name))


@pytest.mark.parametrize("name", registry.BASELINES.names())
def test_baseline(name):
    try:
        method = registry.BASELINES.build(name)
    except ConfigError as error:
        pytest.skip(str(error))
    testing.check_baseline(method)


class Upward:
    """A distance whose gradient points the wrong way."""

    def match(self, moved, target):
        return moved.detach()[..., 0]

    def __call__(self, moved, target, plan=None):
        return 1 / (1 + (moved - target).square().sum(-1).mean())


class Leaky:
    """A distance whose plan keeps the graph."""

    def match(self, moved, target):
        return moved

    def __call__(self, moved, target, plan=None):
        return (moved - target).square().mean()


class Detached(testing.Ball):
    """A field that cannot learn: its value ignores the parameters."""

    def forward(self, points, condition=None):
        return points.square().sum(-1) + 0 * self.radius.detach()


class Gradientless(testing.Ball):
    """A field that returns the wrong gradient."""

    def __init__(self, num_conditions=1):
        super().__init__()

    def value_and_gradient(self, points, condition=None):
        return self(points), torch.ones_like(points)


class Repeating:
    """A pairing that draws with replacement."""

    def __init__(self, batch_size):
        self.size = batch_size

    def __call__(self, queries, targets, generator, same=False):
        index = torch.randint(min(len(queries), len(targets)), (1, self.size), generator=generator)
        return index, index


class Total(ShapeMean):
    """A metric that adds up."""

    def measure(self, a, b):
        return abs(a - b).mean()

    def compute(self):
        return self.total


class Greedy(ShapeMean):
    """A metric that changes what it is given."""

    def measure(self, a, b):
        a -= b
        return abs(a).mean()


class Dropping:
    """A baseline that leaves points out."""

    def denoise(self, points):
        return points[1:]


class Centring:
    """A baseline that answers in coordinates of its own."""

    def denoise(self, points):
        return points - points.mean(axis=0)


class InPlace:
    """A baseline that works in its argument."""

    def denoise(self, points):
        points += 0.1
        return points


class Coarse:
    """A baseline of single precision."""

    def denoise(self, points):
        return points.astype(np.float32)


@pytest.mark.parametrize(
    ("check", "component"),
    [
        (lambda metric: testing.check_metric(metric, shapes("l1cd")), Total()),
        (lambda metric: testing.check_metric(metric, shapes("l1cd")), Greedy()),
        (testing.check_baseline, Dropping()),
        (testing.check_baseline, Centring()),
        (testing.check_baseline, InPlace()),
        (testing.check_baseline, Coarse()),
        (testing.check_baseline, object()),
        (testing.check_distance, Upward()),
        (testing.check_distance, Leaky()),
        (testing.check_architecture, lambda num_conditions: Detached()),
        (testing.check_architecture, Gradientless),
        (testing.check_pairing, Repeating),
        (testing.check_regulariser, lambda state: state.value),
        (testing.check_regulariser, lambda state: -state.value.abs().mean()),
        (testing.check_regulariser, lambda state: (state.value * float("nan")).sum()),
        (testing.check_regulariser, lambda state: torch.rand(())),
    ],
)
def test_contracts_can_fail(check, component):
    with pytest.raises(testing.ContractError, match="broken promise"):
        check(component)
