"""One optimiser step: value and gradient in closed form against double-backward autograd, same field, same batch."""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from benchmarks.scene import first_block
from benchmarks.tables import span, table
from benchmarks.timing import ratio, spread, timed_in_turns
from n2n.architectures.base import SDF
from n2n.architectures.grid import Grid
from n2n.geometry.pull import pull

TITLE = "Optimiser step"
TRIAL = {"points": 500, "rounds": 2, "steps": 1}

_Evaluate = Callable[[Grid, Tensor], tuple[Tensor, Tensor]]


def run(points: int = 10_000, rounds: int = 15, steps: int = 5) -> dict[str, Any]:
    """Measure.

    Args:
        points: Of the cloud; all of them are the batch.
        rounds: Turns.
        steps: Steps per turn.
    """
    module, block = first_block(points)
    field = module.field
    queries, targets = block.queries.reshape(-1, 3), block.targets.reshape(-1, 3)
    ways: dict[str, _Evaluate] = {"closed": Grid.value_and_gradient, "double": SDF.value_and_gradient, "lean": _lean}
    functions = [lambda way=way: _steps(field, way, queries, targets, steps) for way in ways.values()]
    times = dict(zip(ways, timed_in_turns(*functions, rounds=rounds), strict=True))
    gradients = {name: _gradient(field, way, queries, targets) for name, way in ways.items()}
    scale = gradients["closed"].abs().max()
    return {
        "queries": len(queries),
        "cells": field.shape,
        "times": {name: spread([t / steps for t in values]) for name, values in times.items()},
        "ratios": {name: ratio(times[name], times["closed"]) for name in ("double", "lean")},
        "disagreement": max(
            float((gradients[n] - gradients["closed"]).abs().max() / scale) for n in ("double", "lean")
        ),
    }


def render(result: dict[str, Any]) -> str:
    names = {"double": "autograd of `Grid.forward`", "lean": "autograd of a forward that computes nothing but f"}
    times, ratios = result["times"], result["ratios"]
    rows = [["closed form (`Grid.value_and_gradient`)", span(_milli(times["closed"]), " ms"), "1"]]
    rows += [[text, span(_milli(times[name]), " ms"), span(ratios[name], " x")] for name, text in names.items()]
    cells = " x ".join(map(str, result["cells"]))
    return "\n".join(
        [
            f"f, grad f, pull, squared matched distance and its backward pass on {result['queries']:,} queries, a grid "
            f"of {cells} cells. The parameters' gradients agree to {result['disagreement']:.1g} of the largest.",
            "",
            table(["grad f by", "step", "slower"], rows),
        ]
    )


def _milli(values: dict[str, float]) -> dict[str, float]:
    return {name: 1e3 * value for name, value in values.items()}


def _steps(field: Grid, evaluate: _Evaluate, queries: Tensor, targets: Tensor, count: int) -> None:
    for _ in range(count):
        field.zero_grad()
        with field.shared():
            moved = pull(queries, *evaluate(field, queries))
            (moved - targets).square().sum(-1).mean().backward()


def _gradient(field: Grid, evaluate: _Evaluate, queries: Tensor, targets: Tensor) -> Tensor:
    _steps(field, evaluate, queries, targets, 1)
    return torch.cat([p.grad.flatten() for p in field.parameters()])


def _lean(field: Grid, points: Tensor) -> tuple[Tensor, Tensor]:
    """What autograd could do at best: `Grid.forward` also computes the gradient in closed form, in vain."""
    leaf = points.detach().requires_grad_(True)
    inside = torch.minimum(torch.maximum(leaf, field.lower), field.lower + field.size)
    cell, weight, _ = field._stencil(inside)
    local = field.coefficients().reshape(-1)[cell].view(-1, 9, 3)
    z = torch.bmm(local, weight[:, 2, :, None]).view(-1, 3, 3)
    value = ((z * weight[:, 1, None, :]).sum(2) * weight[:, 0]).sum(1) + (leaf - inside).norm(dim=-1)
    return value, torch.autograd.grad(value.sum(), leaf, create_graph=True)[0]
