"""Eq. 7 as a sum of its parts, and what is drawn for it."""

import pytest
import torch

from n2n.architectures.base import SDF
from n2n.datamodules.observations import Draw
from n2n.fitting.objective import Objective
from n2n.geometry.sampling import QuerySampler
from n2n.losses.distances import EMD
from n2n.losses.regularisers import Consistency, OnSurface, ZeroLevel
from n2n.losses.state import Guide
from n2n.testing import Ball
from n2n.transport.pairing import GlobalPairing, StratifiedPairing


def _generator(seed=0):
    return torch.Generator().manual_seed(seed)


def _sphere(radius, count, seed):
    return radius * torch.nn.functional.normalize(torch.randn(count, 3, generator=_generator(seed)), dim=1)


def _objective(kind="observation", terms=None, guides=(), pairing=None, pulls=0, target_noise=0.0):
    queries = QuerySampler(kind, scale=0.05, pulls=pulls)
    return Objective(EMD(1), pairing or StratifiedPairing(256, 32), queries, terms or {}, guides, target_noise)


class Halved(SDF):
    """Half the distance to a sphere: a pull goes half the way."""

    def forward(self, points, condition=None):
        return 0.5 * (points.norm(dim=-1) - 0.5)


class Pipe(SDF):
    """Twice the distance to a cylinder around z."""

    def __init__(self, radius):
        super().__init__()
        self.radius = radius

    def forward(self, points, condition=None):
        return 2 * (points[:, :2].norm(dim=-1) - self.radius)


class Three(SDF):
    """A ball of radius 0.4, its complement (the field of a cave) and a half space."""

    def forward(self, points, condition=None):
        ball = points.norm(dim=-1) - 0.4
        return torch.stack([ball, -ball, points[:, 2]], 1).gather(1, condition[:, None])[:, 0]


def _noisy(clean, noise, seed=3):
    """Two noisy points to every clean one, of opposite noise: what is left of the mean is second order."""
    moved = noise * torch.randn(clean.shape, generator=_generator(seed))
    return torch.cat([clean + moved, clean - moved])


def _draw(same=False):
    source, target = _sphere(0.6, 300, 1), _sphere(0.5, 400, 2)
    return Draw(target, target, True, 0, 0) if same else Draw(source, target, False, None, 0)


def _loss(objective, field, block, progress=0.5):
    return objective.loss(field, block, progress, _generator(9))


def test_total_is_the_weighted_sum_of_the_parts():
    objective = _objective(terms={"regulariser": (0.3, OnSurface()), "zero_level": (2.0, ZeroLevel())})
    field = Ball(0.45)
    total, parts = _loss(objective, field, objective.begin(field, _draw(), _generator()))
    assert set(parts) == {"distance", "regulariser", "zero_level"}
    assert parts["regulariser"].item() == pytest.approx(0.05**2, rel=1e-3)
    expected = parts["distance"] + 0.3 * parts["regulariser"] + 2 * parts["zero_level"]
    assert total.item() == pytest.approx(expected.item()) and total.requires_grad
    assert not any(part.requires_grad for part in parts.values())


def test_terms_of_weight_zero_are_not_evaluated():
    def fails(state):
        raise AssertionError

    objective = _objective(terms={"regulariser": (0.0, fails)})
    _, parts = _loss(objective, Ball(), objective.begin(Ball(), _draw(), _generator()))
    assert set(parts) == {"distance"}


def test_observation_queries_of_two_clouds_are_source_and_target():
    draw = _draw()
    block = _objective().begin(Ball(), draw, _generator())
    assert torch.allclose(block.queries.norm(dim=-1), torch.tensor(0.6))
    assert torch.allclose(block.targets.norm(dim=-1), torch.tensor(0.5))


def test_a_cloud_is_not_matched_to_itself_row_by_row():
    # F = identity would be perfect if queries and targets were the same rows.
    draw = _draw(same=True)
    block = _objective(pairing=GlobalPairing(100)).begin(Ball(), draw, _generator())
    assert not torch.equal(block.queries, block.targets)


def test_jittered_queries_share_a_leaf_with_the_targets_they_came_from():
    block = _objective("jitter").begin(Ball(0.5), _draw(same=True), _generator())
    offset = block.queries - block.targets
    assert offset.std().item() == pytest.approx(0.05, rel=0.1)


def test_denoised_points_are_pulled_and_detached():
    terms = {"regulariser": (0.1, Consistency(against="larger"))}
    block = _objective(terms=terms).begin(Ball(0.4), _draw(), _generator())
    assert torch.allclose(block.denoised.norm(dim=1), torch.full((400,), 0.4), atol=1e-5)
    assert not block.denoised.requires_grad


def test_nothing_is_denoised_that_nobody_looks_at():
    terms = {"regulariser": (0.1, Consistency(against="batch"))}
    assert _objective(terms=terms).begin(Ball(0.4), _draw(), _generator()).denoised is None


def test_far_points_get_their_signed_distance_to_the_denoised_cloud():
    far = torch.tensor([[0.0, 0, 0], [1.0, 0, 0], [0, 0.9, 0]])
    signs = torch.tensor([-1.0, 1.0, 1.0])
    guide = Guide(_sphere(0.5, 10, 3), _sphere(1.0, 10, 3), far, signs, area=torch.pi)
    seen = []

    def spy(state):
        seen.append(state)
        return state.value.sum() * 0

    objective = _objective(guides=[guide], terms={"spy": (1.0, spy)})
    field = Ball(0.5)
    _loss(objective, field, objective.begin(field, _draw(), _generator()), progress=0.25)
    points, distance = seen[0].far
    assert torch.allclose(distance, points.norm(dim=1) - 0.5, atol=0.02)
    assert set(map(tuple, points.tolist())) == set(map(tuple, far.tolist()))
    assert seen[0].progress == 0.25 and seen[0].guide is guide


def test_blocks_follow_the_generator():
    objective = _objective("jitter")
    a, b, c = (objective.begin(Ball(), _draw(same=True), _generator(seed)) for seed in (1, 1, 2))
    assert torch.equal(a.queries, b.queries) and torch.equal(a.plan, b.plan)
    assert not torch.equal(a.queries, c.queries)


@pytest.mark.parametrize(("pulls", "left"), [(0, 1.0), (1, 0.5), (3, 0.125)])
def test_queries_are_pulled_before_the_loss_as_often_as_asked(pulls, left):
    block = _objective(pulls=pulls).begin(Halved(), _draw(), _generator())
    assert torch.allclose(block.queries.norm(dim=-1), torch.tensor(0.5 + 0.1 * left), atol=1e-5)
    assert torch.allclose(block.targets.norm(dim=-1), torch.tensor(0.5), atol=1e-5)
    assert not block.queries.requires_grad


def test_pulled_queries_are_what_the_loss_sees():
    seen = []

    def spy(state):
        seen.append(state.queries)
        return state.value.sum() * 0

    objective = _objective(terms={"spy": (1.0, spy)}, pulls=2)
    block = objective.begin(Halved(), _draw(), _generator())
    _loss(objective, Halved(), block)
    assert torch.equal(seen[0], block.queries.reshape(-1, 3))


def test_terms_are_told_about_field_and_progress_once_per_block():
    class Told:
        def __init__(self):
            self.seen = []

        def begin(self, field, progress):
            self.seen.append((field, progress))

        def __call__(self, state):
            return state.value.sum() * 0

    told, silent, field = Told(), Told(), Ball()
    objective = _objective(terms={"told": (1.0, told), "off": (0.0, silent), "plain": (1.0, OnSurface())})
    block = objective.begin(field, _draw(), _generator(), 0.25)
    _loss(objective, field, block)
    _loss(objective, field, block)
    objective.begin(field, _draw(), _generator(), 0.75)
    assert told.seen == [(field, 0.25), (field, 0.75)] and silent.seen == []


@pytest.mark.parametrize("noise", [0.05, 0.1])
def test_targets_of_a_noisy_sphere_lie_on_it_on_average(noise):
    targets = _noisy(_sphere(0.5, 40_000, 4), noise)
    bias = targets.norm(dim=1).mean().item() - 0.5
    assert bias == pytest.approx(noise**2 / 0.5, rel=0.1)
    with torch.no_grad():
        moved = _objective(target_noise=noise)._unbiased(Ball(0.5), targets, 0)
    assert abs(moved.norm(dim=1).mean().item() - 0.5) < 0.05 * bias
    # Along the normal and nowhere else.
    assert torch.nn.functional.cosine_similarity(moved, targets).min() > 0.9999


def test_targets_of_a_noisy_cylinder_move_by_half_as_much():
    angle, z = torch.rand(2, 40_000, generator=_generator())
    clean = torch.stack([0.5 * (7 * angle).cos(), 0.5 * (7 * angle).sin(), z], 1)
    targets = _noisy(clean, 0.08)
    with torch.no_grad():
        moved = _objective(target_noise=0.08)._unbiased(Pipe(0.5), targets, 0)
    bias, rest = (cloud[:, :2].norm(dim=1).mean().item() - 0.5 for cloud in (targets, moved))
    assert bias == pytest.approx(0.08**2 / (2 * 0.5), rel=0.1) and abs(rest) < 0.06 * bias
    assert torch.allclose(moved[:, 2], targets[:, 2], atol=1e-4)


@pytest.mark.parametrize("radius", [0.32, 0.4, 0.48])
def test_the_shift_is_that_of_the_surface_wherever_its_noisy_point_lies(radius):
    targets = _sphere(radius, 100, 1)
    with torch.no_grad():
        moved = _objective(target_noise=0.04)._unbiased(Three(), targets, 0)
    assert torch.allclose(moved.norm(dim=1), torch.tensor(radius - 0.04**2 / 0.4), atol=1e-4)


def test_the_shift_is_that_of_the_shape_the_targets_belong_to():
    # In a cave the field's inside is outside of the ball; its points lie too far from the centre all the same.
    targets = _sphere(0.4, 100, 1)
    with torch.no_grad():
        ball, cave, flat = (_objective(target_noise=0.04)._unbiased(Three(), targets, shape) for shape in range(3))
    assert (targets - ball).norm(dim=1).min() > 0.003
    assert torch.allclose(cave, ball, atol=1e-5) and torch.allclose(flat, targets, atol=1e-6)


def test_targets_are_corrected_once_the_field_has_settled():
    draw, field = _draw(), Ball(0.5)
    plain = _objective().begin(field, draw, _generator(), 0.9)
    early, late = (_objective(target_noise=0.1).begin(field, draw, _generator(), p) for p in (0.24, 0.25))
    assert torch.equal(early.targets, plain.targets)
    assert torch.allclose(late.targets.norm(dim=-1), torch.tensor(0.48), atol=2e-3)
    assert torch.equal(late.queries, plain.queries)


def test_the_radius_of_a_sphere_is_unbiased_with_many_observations():
    def radius(target_noise):
        queries = QuerySampler("jitter", scale=0.05, pulls=1)
        objective = Objective(EMD(2), StratifiedPairing(2000, 32), queries, {}, (), target_noise)
        field, seen = Ball(0.45), []
        optimizer = torch.optim.Adam(field.parameters(), lr=0.02)
        for number in range(24):
            cloud = _noisy(_sphere(0.5, 1000, number), 0.1, 100 + number)
            block = objective.begin(field, Draw(cloud, cloud, True, None, 0), _generator(number), 0.5)
            for _ in range(4):
                optimizer.zero_grad()
                _loss(objective, field, block)[0].backward()
                optimizer.step()
            seen.append(field.radius.item())
        return sum(seen[12:]) / 12

    assert radius(0.0) == pytest.approx(0.5 + 0.1**2 / 0.5, abs=0.002)
    assert radius(0.1) == pytest.approx(0.5, abs=0.002)
