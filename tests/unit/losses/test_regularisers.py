"""Every term of Eq. 7 besides L, on states whose value is known by hand or in closed form."""

import pytest
import torch
from scipy.spatial.distance import cdist

from n2n.architectures.base import SDF
from n2n.geometry.pull import pull
from n2n.losses.regularisers import (
    Consistency,
    ConsistencyTarget,
    Eikonal,
    OnSurface,
    Smoothness,
    ZeroLevel,
    nearest_distance,
)
from n2n.losses.state import FieldState
from n2n.testing import Ball


class Scaled(SDF):
    """a times the distance to a sphere."""

    def __init__(self, slope: float, radius: float = 0.5) -> None:
        super().__init__()
        self.slope, self.radius = slope, radius

    def forward(self, points, condition=None):
        return self.slope * (points.norm(dim=-1) - self.radius)


class Quadratic(SDF):
    """x' A x: the Hessian is 2 A everywhere."""

    def __init__(self, matrix) -> None:
        super().__init__()
        self.matrix = torch.as_tensor(matrix, dtype=torch.float32)

    def forward(self, points, condition=None):
        return torch.einsum("ni,ij,nj->n", points, self.matrix, points)


class Conditional(Ball):
    """A ball whose radius is its condition."""

    def forward(self, points, condition=None):
        return points.norm(dim=-1) - condition.to(points)


def _points(count=200, seed=0):
    return torch.randn(count, 3, generator=torch.Generator().manual_seed(seed))


def _sphere(radius, count=200, seed=0):
    return radius * torch.nn.functional.normalize(_points(count, seed), dim=1)


def _state(field, queries, targets=None, **more):
    value, gradient = field.value_and_gradient(queries)
    pulled = pull(queries, value, gradient)
    targets = queries if targets is None else targets
    return FieldState(
        field=field, queries=queries, value=value, gradient=gradient, pulled=pulled, targets=targets, **more
    )


def _two_queries(denoised=None):
    """Two queries pulled by 0.5 and 0.8 to (0.5, 0, 0) and (1, -0.8, 0)."""
    queries = torch.tensor([[0.0, 0, 0], [1, 0, 0]])
    value, gradient = torch.tensor([0.5, -0.8]), torch.tensor([[-1.0, 0, 0], [0, -2, 0]])
    pulled = pull(queries, value, gradient)
    assert torch.allclose(pulled, torch.tensor([[0.5, 0, 0], [1, -0.8, 0]]))
    return FieldState(
        field=None, queries=queries, value=value, gradient=gradient, pulled=pulled, targets=queries, denoised=denoised
    )


def test_consistency_of_two_queries_by_hand():
    # The second is 0.8 from its own image and 0.5 from the other's: excess 0.3; the first is nearest to its own.
    assert Consistency("batch")(_two_queries()).item() == pytest.approx((0 + 0.3) / 2)


def test_consistency_against_a_larger_set_by_hand():
    # A denoised point 0.1 from the first query: excess 0.4; for the second the batch is still the closest.
    denoised = torch.tensor([[0.0, 0, 0.1], [9, 9, 9]])
    assert Consistency("larger")(_two_queries(denoised)).item() == pytest.approx((0.4 + 0.3) / 2)
    assert Consistency("batch")(_two_queries(denoised)).item() == pytest.approx(0.15)
    assert Consistency("larger")(_two_queries()).item() == pytest.approx(0.15)


@pytest.mark.parametrize("against", ["batch", "larger"])
def test_consistency_is_zero_where_every_image_is_the_nearest(against):
    # An exact distance: no point of the surface is closer than the image, however dense the denoised set.
    state = _state(Ball(0.5), _points(), denoised=_sphere(0.5, 3000, 1))
    assert Consistency(against)(state).item() == pytest.approx(0, abs=1e-6)


def test_a_larger_set_sees_what_the_batch_misses():
    # f is twice the distance: every query overshoots, and few others happen to be denoised to where it should go.
    state = _state(Scaled(2.0), _sphere(0.7, 10), denoised=_sphere(0.5, 5000, 1))
    assert Consistency("batch")(state).item() < 1e-6
    assert Consistency("larger")(state).item() == pytest.approx(0.2, abs=0.01)


def test_consistency_shrinks_f_only_where_there_is_an_excess():
    state = _two_queries()
    state.value = state.value.requires_grad_()
    Consistency()(state).backward()
    assert state.value.grad.tolist() == [0.0, -0.5]  # a mean of two; f < 0 in the second


def test_consistency_names_what_it_knows():
    with pytest.raises(ValueError, match="'batch' or 'larger', got 'all'"):
        Consistency("all")


def test_consistency_target_is_the_distance_to_the_noisy_batch():
    state = _state(Ball(0.5), _points(), _points(150, 1))
    expected = cdist(state.pulled.detach().numpy(), state.targets.numpy()).min(axis=1).mean()
    assert ConsistencyTarget()(state).item() == pytest.approx(expected, rel=1e-5)


def test_nearest_distance_is_the_least_of_all_pairs():
    points, cloud = _points(100), _points(70, 1)
    expected = torch.as_tensor(cdist(points.numpy(), cloud.numpy()).min(axis=1), dtype=torch.float32)
    assert torch.allclose(nearest_distance(points, cloud), expected, rtol=1e-4)


def test_nearest_distance_has_finite_slopes_on_the_cloud():
    points = _points(5).requires_grad_()
    nearest_distance(points, points.detach()).sum().backward()
    assert torch.isfinite(points.grad).all()


def test_zero_level_is_zero_for_an_exact_distance_and_grows_with_the_error():
    assert ZeroLevel()(_state(Ball(0.5), _points())).item() == pytest.approx(0, abs=1e-6)
    # f = 2 d moves a query at distance d to distance -d, where |f| = 2 d.
    assert ZeroLevel()(_state(Scaled(2.0), _sphere(0.6))).item() == pytest.approx(0.2, rel=1e-4)


@pytest.mark.parametrize("slope", [0.25, 1.0, 3.0])
def test_eikonal_of_a_scaled_distance(slope):
    state = _state(Scaled(slope), _points())
    assert Eikonal()(state).item() == pytest.approx((slope - 1) ** 2, abs=1e-6)


def test_eikonal_looks_where_it_is_told():
    class Ramp(SDF):
        """Slope 1 where x < 0 and 3 elsewhere."""

        def forward(self, points, condition=None):
            return torch.where(points[:, 0] < 0, points[:, 0], 3 * points[:, 0])

    state = _state(Ramp(), -_points().abs(), _points().abs())
    assert Eikonal("queries")(state).item() == pytest.approx(0)
    assert Eikonal("targets")(state).item() == pytest.approx(4)
    with pytest.raises(ValueError, match="'queries' or 'targets', got 'both'"):
        Eikonal("both")


def test_on_surface_is_the_mean_square_at_the_targets():
    state = _state(Ball(0.4), _points(), _sphere(0.5))
    assert OnSurface()(state).item() == pytest.approx(0.1**2, rel=1e-4)


def test_terms_ask_the_field_of_their_own_shape():
    field = Conditional()
    value, gradient = field.value_and_gradient(_sphere(2.5), torch.full((200,), 2))
    state = FieldState(
        field=field,
        queries=_sphere(2.5),
        value=value,
        gradient=gradient,
        pulled=pull(_sphere(2.5), value, gradient),
        targets=_sphere(2.5),
        condition=2,
    )
    assert ZeroLevel()(state).item() == pytest.approx(0, abs=1e-6)
    assert OnSurface()(state).item() == pytest.approx(0.25, rel=1e-4)


def test_smoothness_of_a_network_is_its_squared_hessian_times_the_volume():
    # Points at the centres of 60 boxes of the band's width: a volume of 60 * 0.1^3.
    points = 0.1 * torch.cartesian_prod(torch.arange(5.0), torch.arange(4.0), torch.arange(3.0))
    for matrix, tolerance in (
        ([[0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]], 0.01),
        ([[2, 1, 0], [1, 0, 0], [0, 0, -1]], 0.2),
    ):
        field = Quadratic(matrix)
        field.set_band(points, 0.1)
        energy = Smoothness()(_state(field, _points()))
        hessian = 4 * torch.tensor(matrix, dtype=torch.float32).square().sum().item()
        assert energy.item() == pytest.approx(hessian * 60 * 0.1**3, rel=tolerance)


def test_smoothness_of_a_sphere_follows_its_curvature():
    # ||Hessian|| of |x| is sqrt(2) / |x|.
    radii = {}
    for radius in (0.4, 0.8):
        field = Ball(radius)
        field.set_band(_sphere(radius, 2000), 0.02)
        radii[radius] = Smoothness()(_state(field, _points())).item() / len(
            torch.unique((_sphere(radius, 2000) / 0.02).round(), dim=0)
        )
    assert radii[0.4] == pytest.approx(2 / 0.4**2 * 0.02**3, rel=0.1)
    assert radii[0.4] / radii[0.8] == pytest.approx(4, rel=0.15)


def test_smoothness_without_a_band_says_what_to_call():
    with pytest.raises(RuntimeError, match="set_band"):
        Smoothness()(_state(Ball(), _points()))


@pytest.mark.parametrize(("adapt_from", "adapted"), [(0.5, [0.5, 0.75]), (0.0, [0.0, 0.49, 0.5, 0.75]), (1.0, [])])
def test_smoothness_adapts_from_its_share_of_the_fit_on(adapt_from, adapted):
    class Spy(Ball):
        def adapt_roughness(self):
            seen.append(progress)

    seen, term = [], Smoothness(adapt_from)
    for progress in (0.0, 0.49, 0.5, 0.75):
        term.begin(Spy(), progress)
    assert seen == adapted
    assert Smoothness().adapt_from == 1


def test_a_field_that_cannot_adapt_keeps_its_energy():
    field = Ball(0.5)
    field.set_band(_sphere(0.5), 0.05)
    before = field.roughness(torch.Generator().manual_seed(0))
    Smoothness(0.5).begin(field, 0.6)
    assert torch.equal(field.roughness(torch.Generator().manual_seed(0)), before)
