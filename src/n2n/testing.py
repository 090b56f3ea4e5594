"""Contracts that every swappable component keeps; plugin authors call these from their own tests.

Each `check_*` builds small problems, asks the component and raises `ContractError` with the broken promise. No pytest
needed: `check_distance(MyDistance())` inside a test function is enough.
"""

import pickle
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
import trimesh
from torch import Tensor

from n2n.architectures.base import SDF
from n2n.geometry.pull import pull
from n2n.losses.state import FieldState, Guide


class ContractError(AssertionError):
    """A component breaks a promise the rest of n2n relies on."""


def require(promise: str, kept: bool | np.bool_ | Tensor) -> None:
    """Raise `ContractError` unless the promise is kept."""
    if not bool(kept):
        raise ContractError(f"broken promise: {promise}")


def check_architecture(build: Callable[..., SDF], seed: int = 0) -> None:
    """Check a signed distance field in unit coordinates.

    Args:
        build: Returns a new field; called as `build(num_conditions=...)`.
        seed: Of parameters and points.
    """
    torch.manual_seed(seed)
    points = torch.rand(64, 3, dtype=torch.float64) * 1.6 - 0.8
    field = build(num_conditions=1).double()
    value = field(points)
    require("forward returns one value per point", value.shape == (64,))
    require("values are finite", value.isfinite().all())
    require("a value does not depend on the other points", torch.allclose(field(points[:5]), value[:5], atol=1e-9))

    with torch.no_grad():
        same, gradient = field.value_and_gradient(points)
    require("value_and_gradient agrees with forward", torch.allclose(same, value, atol=1e-9))
    require("the gradient is there under no_grad, detached", gradient.shape == (64, 3) and not gradient.requires_grad)
    step = 1e-6 * torch.eye(3, dtype=torch.float64)
    slope = torch.stack([(field(points + e) - field(points - e)) / 2e-6 for e in step], dim=1)
    error = (slope - gradient).abs().max() / slope.abs().max().clamp_min(1e-12)
    require(f"the gradient is the derivative of the value (relative error {error:.1e})", error < 1e-3)

    with field.shared():
        require("shared() changes nothing", torch.allclose(field(points), value, atol=1e-9))
    pull(points, *field.value_and_gradient(points)).square().mean().backward()
    slopes = [p.grad for p in field.parameters() if p.grad is not None]
    require("a loss on pulled points reaches the parameters", any(bool((g != 0).any()) for g in slopes))
    require("its gradients are finite", all(bool(g.isfinite().all()) for g in slopes))

    copy = build(num_conditions=1).double()
    copy.load_state_dict(field.state_dict())
    require("state_dict holds everything", torch.allclose(copy(points), value, atol=1e-9))

    several = build(num_conditions=3).double()
    codes = torch.arange(64) % 3
    require("one field holds several shapes", several(points, codes).shape == (64,))
    order = torch.randperm(64)
    require(
        "points and conditions belong together",
        torch.allclose(several(points[order], codes[order]), several(points, codes)[order], atol=1e-9),
    )


def check_distance(distance: Any, seed: int = 0) -> None:
    """Check a distance between moved and target points, (leaves, k, 3) each."""
    generator = torch.Generator().manual_seed(seed)
    target = torch.rand(3, 32, 3, generator=generator)
    moved = (target + 0.02 * torch.randn(target.shape, generator=generator)).requires_grad_(True)
    plan = distance.match(moved, target)
    require("match has no gradient", not any(t.requires_grad for t in _tensors(plan)))
    value = distance(moved, target, plan)
    require(
        "the value is one number, finite and not negative", value.shape == () and bool(value.isfinite() & (value >= 0))
    )
    require("without a plan it makes its own", torch.allclose(distance(moved, target), value, rtol=1e-4))

    (gradient,) = torch.autograd.grad(value, moved)
    require("the gradient is finite and not zero", bool(gradient.isfinite().all()) and bool((gradient != 0).any()))
    lower = distance(moved - 1e-3 * gradient / gradient.abs().max(), target, plan)
    require("a step against the gradient lowers it", lower < value)
    still = target.clone().requires_grad_(True)
    (at_rest,) = torch.autograd.grad(distance(still, target), still)
    require("points that are their targets get a finite gradient", at_rest.isfinite().all())

    rotation = torch.linalg.qr(torch.randn(3, 3, generator=generator))[0]
    turned = distance(moved @ rotation + 0.5, target @ rotation + 0.5)
    require("rotating and shifting both changes nothing", torch.allclose(turned, value, rtol=5e-3))
    order = torch.randperm(32, generator=generator)
    require("the order of targets does not matter", torch.allclose(distance(moved, target[:, order]), value, rtol=5e-3))
    alone = torch.stack([distance(moved[i : i + 1], target[i : i + 1]) for i in range(3)]).mean()
    require("leaves are independent; the value is their mean", torch.allclose(alone, value, rtol=5e-3))
    require("far apart is farther", distance(moved + 1.0, target) > value)


def check_regulariser(regulariser: Any, seed: int = 0) -> None:
    """Check a term R(state) of the loss."""
    for complete in (True, False):
        state = example_state(seed, complete)
        value = regulariser(state)
        require(
            "the value is one number, finite and not negative",
            value.shape == () and bool(value.isfinite() & (value >= 0)),
        )
        if value.requires_grad:
            value.backward()
            slopes = [p.grad for p in state.field.parameters() if p.grad is not None]
            require("its gradients are finite", all(bool(g.isfinite().all()) for g in slopes))
        again = regulariser(example_state(seed, complete))
        require("equal states give equal values", torch.allclose(again, value))


def check_pairing(build: Callable[..., Any], seed: int = 0) -> None:
    """Check how subsets are drawn.

    Args:
        build: Returns a pairing; called as `build(batch_size=...)`.
        seed: Of the clouds.
    """
    generator = torch.Generator().manual_seed(seed)
    queries, targets = torch.rand(500, 3, generator=generator), torch.rand(700, 3, generator=generator)
    for batch_size in (64, 300, 5000):
        pairing = build(batch_size=batch_size)
        first, second = pairing(queries, targets, torch.Generator().manual_seed(1))
        require("both index arrays are (leaves, k)", first.ndim == 2 and first.shape == second.shape)
        require("no more points than asked for", 0 < first.numel() <= batch_size)
        for index, cloud in ((first, queries), (second, targets)):
            require("indices point into their cloud", index.min() >= 0 and index.max() < len(cloud))
            require("no point is drawn twice", len(index.unique()) == index.numel())
        again = pairing(queries, targets, torch.Generator().manual_seed(1))
        require("equal generators give equal draws", torch.equal(again[0], first) and torch.equal(again[1], second))
        tied = pairing(targets + 0.01, targets, torch.Generator().manual_seed(1), same=True)
        require("same=True draws leaves of the same shape", tied[0].shape == tied[1].shape and tied[0].ndim == 2)


def check_metric(metric: Any, shapes: Sequence[tuple[Any, ...]]) -> None:
    """Check a metric, which is a `torchmetrics.Metric`.

    Args:
        metric: Fresh; is left fresh.
        shapes: Arguments of `update` for two shapes or more, as arrays.
    """
    before = [[np.array(array) for array in arrays] for arrays in shapes]
    alone = []
    for arrays in shapes:
        metric.reset()
        value = _numbers(metric(*arrays))
        require("calling it measures one shape", torch.equal(value, _numbers(metric.compute())))
        alone.append(value)
    metric.reset()
    for arrays in shapes:
        metric.update(*(torch.as_tensor(np.asarray(array)) for array in arrays))
    mean = _numbers(metric.compute())
    require("the values are finite", mean.isfinite().all())
    require("it is the mean over shapes, of arrays and tensors alike", torch.allclose(mean, torch.stack(alone).mean(0)))
    copy = pickle.loads(pickle.dumps(metric))
    require("a pickled metric knows what it has seen", torch.equal(_numbers(copy.compute()), mean))
    metric.reset()
    require("reset forgets", torch.equal(_numbers(metric(*shapes[0])), alone[0]))
    metric.reset()
    same = all(
        np.array_equal(a, b) for old, new in zip(before, shapes, strict=True) for a, b in zip(old, new, strict=True)
    )
    require("its arguments are not changed", same)


def check_baseline(method: Any, seed: int = 0) -> None:
    """Check another method: `denoise(points)`, `reconstruct(points)` or both, in world coordinates.

    Args:
        method: Constructed.
        seed: Of the points.
    """
    random = np.random.default_rng(seed)
    directions = random.normal(size=(2000, 3))
    sphere = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    centre, radius = np.array([500.0, -200.0, 100.0]), 20.0
    points = centre + radius * (sphere + 0.01 * random.normal(size=sphere.shape))
    given = points.copy()
    require("it can denoise or reconstruct", hasattr(method, "denoise") or hasattr(method, "reconstruct"))
    if hasattr(method, "denoise"):
        clean = method.denoise(points)
        require("denoise keeps number and order of the points, float64", _is_cloud(clean, len(points)))
        require("no point moves far", np.linalg.norm(clean - given, axis=1).max() < 0.5 * radius)
        require("equal points give equal points", np.array_equal(method.denoise(points), clean))
    if hasattr(method, "reconstruct"):
        mesh = method.reconstruct(points)
        require("reconstruct returns a mesh with faces", isinstance(mesh, trimesh.Trimesh) and len(mesh.faces) > 0)
        require("its vertices are finite", np.isfinite(mesh.vertices).all())
        require(
            "the mesh lies where the points do", np.abs(mesh.bounds - [centre - radius, centre + radius]).max() < radius
        )
    require("the points given are not changed", np.array_equal(points, given))


class Ball(SDF):
    """The exact distance to a sphere with a learnable centre and radius: a field whose answers are known."""

    def __init__(self, radius: float = 0.5) -> None:
        super().__init__()
        self.centre = torch.nn.Parameter(torch.zeros(3))
        self.radius = torch.nn.Parameter(torch.tensor(radius))

    def forward(self, points: Tensor, condition: Tensor | None = None) -> Tensor:
        return (points - self.centre).square().sum(-1).clamp_min(1e-20).sqrt() - self.radius


def example_state(seed: int = 0, complete: bool = True) -> FieldState:
    """Return the state of one step: a ball of radius 0.45 asked around a noisy sphere of radius 0.5.

    Args:
        seed: Of the points.
        complete: Also fill what may be missing: the larger denoised set, the guide and the far points.
    """
    generator = torch.Generator().manual_seed(seed)
    field = Ball(0.45)
    sphere = torch.nn.functional.normalize(torch.randn(256, 3, generator=generator), dim=-1)
    targets = 0.5 * sphere + 0.02 * torch.randn(sphere.shape, generator=generator)
    queries = targets + 0.05 * torch.randn(sphere.shape, generator=generator)
    field.set_band(targets, 0.1)
    value, gradient = field.value_and_gradient(queries)
    far = torch.rand(64, 3, generator=generator) * 2 - 1
    distance = far.norm(dim=-1) - 0.5
    return FieldState(
        field=field,
        queries=queries,
        value=value,
        gradient=gradient,
        pulled=pull(queries, value, gradient),
        targets=targets,
        denoised=0.5 * sphere if complete else None,
        guide=Guide(0.5 * sphere, sphere, far, distance.sign(), torch.pi) if complete else None,
        far=(far, distance) if complete else None,
        generator=generator,
    )


def _tensors(plan: Any) -> list[Tensor]:
    return [plan] if isinstance(plan, Tensor) else [t for t in plan if isinstance(t, Tensor)]


def _numbers(value: Any) -> Tensor:
    values = list(value.values()) if isinstance(value, dict) else [value]
    return torch.stack([torch.as_tensor(number, dtype=torch.float64) for number in values])


def _is_cloud(points: Any, count: int) -> bool:
    return points.shape == (count, 3) and points.dtype == np.float64 and bool(np.isfinite(points).all())
