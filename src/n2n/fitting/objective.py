"""Eq. 7 as an object: draw queries and targets, match them, measure L + lambda R + further terms."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional

from n2n.datamodules.observations import Draw
from n2n.errors import ConfigError
from n2n.geometry.curvature import curvature, noise_shift
from n2n.geometry.point_to_plane import point_to_plane
from n2n.geometry.pull import pull
from n2n.geometry.sampling import QuerySampler
from n2n.losses.state import FieldState, Guide

DENOISED_POINTS = 8192
_FAR_POINTS = 2048
_SETTLED = 0.25  # share of the fit after which the field's curvature means something
_FOOT_PULLS = 2


@dataclass
class Block:
    """What stays fixed over the optimiser steps that share one matching."""

    draw: Draw
    queries: Tensor
    targets: Tensor
    plan: Any
    denoised: Tensor | None
    far: tuple[Tensor, Tensor] | None


class Objective:
    """The loss of a fit.

    Args:
        distance: L of Eq. 4, with `match` and call.
        pairing: Which subsets are matched.
        queries: Where the field is asked.
        terms: name -> (weight, term); holds lambda R under `regulariser`.
        guides: One per shape, None where there is none; or empty.
        target_noise: Deviation of the noise that `_unbiased` takes the shift of off the targets, unit coordinates.
    """

    def __init__(
        self,
        distance: Any,
        pairing: Any,
        queries: QuerySampler,
        terms: dict[str, tuple[float, Any]],
        guides: Sequence[Guide | None] = (),
        target_noise: float = 0.0,
    ) -> None:
        self.distance, self.pairing, self.queries = distance, pairing, queries
        self.terms = {name: (weight, term) for name, (weight, term) in terms.items() if weight}
        self.guides, self.target_noise = guides, target_noise
        self._wants_denoised = any(getattr(term, "needs_denoised", False) for _, term in self.terms.values())

    @torch.no_grad()
    def begin(self, field: Any, draw: Draw, generator: torch.Generator, progress: float = 0.0) -> Block:
        """Draw queries and targets and match them under the present field (Eq. 4); tell the terms that ask for it."""
        candidates = self.queries(draw.source, generator, draw.key)
        # Queries that are the targets themselves would be matched to where they already are.
        tied = draw.same and self.queries.kind != "observation"
        query_index, target_index = self.pairing(candidates, draw.target, generator, same=tied)
        queries, targets = candidates[query_index], draw.target[target_index]
        with field.shared():
            if self.target_noise and progress >= _SETTLED:
                targets = self._unbiased(field, targets.reshape(-1, 3), draw.condition).reshape(targets.shape)
            for _ in range(self.queries.pulls):
                queries = self._pull(field, queries.reshape(-1, 3), draw.condition).reshape(queries.shape)
            moved = self._pull(field, queries.reshape(-1, 3), draw.condition).reshape(queries.shape)
            if not (moved.isfinite().all() and targets.isfinite().all()):
                raise diverged()
            for _, term in self.terms.values():
                if hasattr(term, "begin"):
                    term.begin(field, progress)
            plan = self.distance.match(moved, targets)
            denoised = self._denoise(field, draw, generator)
            far = self._far(field, draw, denoised)
        return Block(draw, queries, targets, plan, denoised, far)

    def loss(
        self, field: Any, block: Block, progress: float, generator: torch.Generator
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """Return the weighted sum and its parts (unweighted, detached) for the present parameters."""
        condition = block.draw.condition
        queries = block.queries.reshape(-1, 3)
        codes = torch.full((len(queries),), condition, dtype=torch.long, device=queries.device)
        value, gradient = field.value_and_gradient(queries, codes)
        pulled = pull(queries, value, gradient)
        matched = self.distance(pulled.reshape(block.queries.shape), block.targets, block.plan)
        state = FieldState(
            field=field,
            queries=queries,
            value=value,
            gradient=gradient,
            pulled=pulled,
            targets=block.targets.reshape(-1, 3),
            condition=condition,
            denoised=block.denoised,
            guide=self._guide(condition),
            far=_some(block.far, generator),
            progress=progress,
            generator=generator,
        )
        total, parts = matched, {"distance": matched.detach()}
        for name, (weight, term) in self.terms.items():
            measured = term(state)
            total = total + weight * measured
            parts[name] = measured.detach()
        return total, parts

    def _pull(self, field: Any, points: Tensor, condition: int) -> Tensor:
        return pull(points, *self._evaluate(field, points, condition))

    def _evaluate(self, field: Any, points: Tensor, condition: int) -> tuple[Tensor, Tensor]:
        codes = torch.full((len(points),), condition, dtype=torch.long, device=points.device)
        return field.value_and_gradient(points, codes)

    def _unbiased(self, field: Any, targets: Tensor, condition: int) -> Tensor:
        """Move targets inwards by what noise shifts the points of a curved surface outwards on average.

        Without this a surface fitted to many observations lies sigma^2 / r outside of a sphere.
        """
        foot = targets
        for _ in range(_FOOT_PULLS):
            foot = self._pull(field, foot, condition)

        def gradient(points: Tensor) -> Tensor:
            return self._evaluate(field, points, condition)[1]

        normals = functional.normalize(gradient(foot), dim=-1)
        bend = curvature(gradient, foot, normals, self.target_noise)
        return targets - noise_shift(bend, self.target_noise)[:, None] * normals

    def _denoise(self, field: Any, draw: Draw, generator: torch.Generator) -> Tensor | None:
        """Pull many of the targets, if anything will look at them: for a large network that costs more than a step."""
        if not self._wants_denoised and self._guide(draw.condition) is None:
            return None
        chosen = torch.randperm(len(draw.target), generator=generator)[:DENOISED_POINTS].to(draw.target.device)
        return self._pull(field, draw.target[chosen], draw.condition)

    def _guide(self, condition: int) -> Guide | None:
        return self.guides[condition] if self.guides else None

    def _far(self, field: Any, draw: Draw, denoised: Tensor | None) -> tuple[Tensor, Tensor] | None:
        """Return the guide's far points and their signed distance to the surface that the denoised set samples."""
        guide = self._guide(draw.condition)
        if guide is None or not len(guide.far_points):
            return None
        normals = functional.normalize(self._evaluate(field, denoised, draw.condition)[1], dim=-1)
        distance = point_to_plane(guide.far_points, denoised, normals, math.sqrt(guide.area / len(denoised)))
        if guide.far_lids is not None:
            distance = torch.minimum(distance, guide.far_lids)
        return guide.far_points, guide.far_signs * distance


def diverged() -> ConfigError:
    """Return the error for a field that is no longer finite."""
    return ConfigError("the fit diverged: f is infinite or not a number; lower optimizer.lr")


def _some(far: tuple[Tensor, Tensor] | None, generator: torch.Generator) -> tuple[Tensor, Tensor] | None:
    """Draw a few far points anew in every step: each is seen too seldom to be fitted alone."""
    if far is None:
        return None
    points, distance = far
    chosen = torch.randint(len(points), (_FAR_POINTS,), generator=generator).to(points.device)
    return points[chosen], distance[chosen]
