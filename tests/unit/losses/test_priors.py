"""The terms that say where inside is, on balls whose error is known."""

import pytest
import torch

from n2n.geometry.pull import pull
from n2n.losses.priors import FarField, ScaffoldFit
from n2n.losses.state import FieldState, Guide
from n2n.testing import Ball


def _sphere(radius, count=100, seed=0):
    points = torch.randn(count, 3, generator=torch.Generator().manual_seed(seed))
    return radius * torch.nn.functional.normalize(points, dim=1)


def _state(field, guide=None, far=None, progress=0.0):
    queries = _sphere(0.6)
    value, gradient = field.value_and_gradient(queries)
    pulled = pull(queries, value, gradient)
    return FieldState(
        field=field,
        queries=queries,
        value=value,
        gradient=gradient,
        pulled=pulled,
        targets=queries,
        guide=guide,
        far=far,
        progress=progress,
    )


def _guide(radius, side=1.0):
    area = 4 * torch.pi * radius**2
    return Guide(_sphere(radius), side * _sphere(1.0), torch.zeros(1, 3), -torch.ones(1), area=area)


def test_scaffold_is_zero_for_the_field_it_was_sampled_from():
    assert ScaffoldFit()(_state(Ball(0.5), _guide(0.5))).item() == pytest.approx(0, abs=1e-10)


def test_scaffold_adds_the_squared_value_and_the_turned_normal():
    assert ScaffoldFit(normal_weight=0.0)(_state(Ball(0.4), _guide(0.5))).item() == pytest.approx(0.01, rel=1e-4)
    # Normals that point inwards differ from the gradient by 2.
    flipped = ScaffoldFit(normal_weight=1e-3)(_state(Ball(0.4), _guide(0.5, side=-1.0)))
    assert flipped.item() == pytest.approx(0.01 + 1e-3 * 4, rel=1e-4)


@pytest.mark.parametrize(("progress", "speaks"), [(0.0, True), (0.29, True), (0.3, False), (1.0, False)])
def test_scaffold_falls_silent(progress, speaks):
    value = ScaffoldFit(until=0.3)(_state(Ball(0.4), _guide(0.5), progress=progress))
    assert bool(value > 0) == speaks


def test_far_field_is_zero_for_the_true_distance_on_both_sides():
    points = torch.cat([_sphere(0.1), _sphere(1.0)])
    far = (points, points.norm(dim=1) - 0.5)
    assert FarField()(_state(Ball(0.5), far=far)).item() == pytest.approx(0, abs=1e-10)


def test_far_field_is_relative_to_the_distance():
    # Off by 0.1 at distances -0.4 and 0.5.
    points = torch.cat([_sphere(0.1), _sphere(1.0)])
    far = (points, points.norm(dim=1) - 0.5)
    expected = ((0.1 / 0.4) ** 2 + (0.1 / 0.5) ** 2) / 2
    assert FarField()(_state(Ball(0.4), far=far)).item() == pytest.approx(expected, rel=1e-4)


def test_far_field_punishes_a_wrong_sign_most():
    points = _sphere(0.1)
    right, wrong = (FarField()(_state(Ball(0.5), far=(points, side * torch.full((100,), 0.4)))) for side in (-1, 1))
    assert right.item() == pytest.approx(0, abs=1e-10) and wrong.item() == pytest.approx(4, rel=1e-4)


def test_terms_without_a_guide_are_zero():
    assert ScaffoldFit()(_state(Ball(0.4))).item() == 0
    assert FarField()(_state(Ball(0.4))).item() == 0
