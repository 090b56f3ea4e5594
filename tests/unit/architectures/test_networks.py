"""The paper's network and the sinusoidal one."""

import pytest
import torch

from n2n.architectures.base import ConditionCode
from n2n.architectures.mlp import MLP
from n2n.architectures.siren import Siren


@pytest.fixture(autouse=True)
def _seed():
    torch.manual_seed(0)


def _directions(count=40):
    return torch.nn.functional.normalize(torch.randn(count, 3), dim=1)


def _zero_crossings(field, directions):
    """The distance from the origin at which f turns positive along each ray; every ray must cross once."""
    radii = torch.linspace(0.02, 1.5, 50)
    with torch.no_grad():
        positive = torch.stack([field(radius * directions) for radius in radii]) > 0
    assert not positive[0].any() and positive[-1].all()
    assert (positive.int().diff(dim=0) >= 0).all()
    return radii[positive.int().argmax(dim=0)]


def test_the_default_is_eight_layers_of_512_with_a_bounded_output():
    network = MLP()
    assert [tuple(layer.weight.shape) for layer in network.hidden] == [(512, 3)] + [(512, 512)] * 7
    assert tuple(network.head.weight.shape) == (1, 512)
    assert sum(p.numel() for p in network.parameters()) == 4 * 512 + 7 * 513 * 512 + 513


@pytest.mark.parametrize("radius", [0.5])
def test_the_paper_network_starts_roughly_as_a_sphere(radius):
    crossings = _zero_crossings(MLP(geometric_init=radius), _directions())
    assert crossings.mean().item() == pytest.approx(radius, rel=0.2)
    assert crossings.min() > 0.5 * radius and crossings.max() < 1.6 * radius


def test_tanh_bounds_the_output_and_linear_does_not():
    points = 100 * torch.randn(500, 3)
    bounded, free = MLP(4, 64), MLP(4, 64, output="linear")
    free.load_state_dict(bounded.state_dict())
    assert bounded(points).abs().max() <= 1 and free(points).abs().max() > 10
    assert torch.allclose(bounded(points), torch.tanh(free(points)))
    assert bounded(points).max() > 0.99


def test_without_geometric_init_pytorch_decides():
    network = MLP(3, 64, geometric_init=None)
    # PyTorch draws evenly within 1 / sqrt(fan in).
    assert network.hidden[1].weight.abs().max() <= 1 / 8 and network.hidden[1].bias.any()
    assert network(_directions()).abs().max() < 0.3


def test_unknown_outputs_are_named():
    with pytest.raises(ValueError, match="'tanh' or 'linear', got 'sigmoid'"):
        MLP(output="sigmoid")


@pytest.mark.parametrize("radius", [0.4, 0.8])
def test_siren_starts_close_to_a_sphere(radius):
    crossings = _zero_crossings(Siren(radius=radius), _directions())
    assert (crossings - radius).abs().max() < 0.05


def test_siren_is_smooth_where_relu_is_not():
    points = (0.5 * torch.randn(20, 3)).double()
    for network, smooth in ((Siren(2, 32).double(), True), (MLP(2, 32, output="linear").double(), False)):
        leaf = points.clone().requires_grad_()
        _, gradient = network.value_and_gradient(leaf)
        (second,) = torch.autograd.grad(gradient.square().sum(), leaf)
        assert bool(second.any()) == smooth


def test_siren_frequency_sets_how_fast_it_varies():
    slow, fast = Siren(2, 64, frequency=1.0), Siren(2, 64, frequency=60.0)
    points = _directions()
    departure = [field.value_and_gradient(points)[1] - points for field in (slow, fast)]
    assert departure[1].norm(dim=1).mean() > 5 * departure[0].norm(dim=1).mean()


@pytest.mark.parametrize("build", [lambda n: MLP(2, 32, num_conditions=n), lambda n: Siren(2, 32, num_conditions=n)])
def test_several_shapes_in_one_network(build):
    network, points = build(3), torch.randn(40, 3)
    values = [network(points, torch.full((40,), c)) for c in range(3)]
    assert not torch.allclose(values[0], values[1]) and not torch.allclose(values[1], values[2])
    assert torch.equal(network(points), values[0])  # no condition means the first
    # A loss on one shape leaves the others' codes alone.
    (slope,) = torch.autograd.grad(values[1].square().sum(), network.code.codes.weight)
    assert slope[1].any() and not slope[0].any() and not slope[2].any()
    assert build(1).code.codes is None


def test_geometric_init_survives_the_code():
    network = MLP(4, 256, geometric_init=0.5, num_conditions=2)
    points = torch.cat([torch.zeros(1, 3), 2 * _directions(20)])
    for condition in range(2):
        value = network(points, torch.full((21,), condition))
        assert value[0] < 0 and (value[1:] > 0).all()


def test_codes_follow_the_points():
    code = ConditionCode(3, width=5)
    points = torch.randn(4, 3)
    joined = code.append(points, torch.tensor([2, 0, 1, 2]))
    assert torch.equal(joined[:, :3], points)
    assert torch.equal(joined[:, 3:], code.codes.weight[[2, 0, 1, 2]])
    assert ConditionCode(1).append(points, None) is points


def test_gradient_under_no_grad_is_detached_and_parameters_learn_otherwise():
    network, points = MLP(2, 32), torch.randn(10, 3)
    with torch.no_grad():
        value, gradient = network.value_and_gradient(points)
    assert not value.requires_grad and not gradient.requires_grad
    value, gradient = network.value_and_gradient(points)
    (gradient.norm(dim=1) - 1).square().sum().backward()
    assert network.hidden[0].weight.grad.any()
    assert points.grad is None and not points.requires_grad
