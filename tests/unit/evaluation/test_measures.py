"""Every number against a dense table of distances, which shares no code with the kernels."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from n2n.evaluation.measures import MEASURES, Blank, Pair, Settings
from n2n.evaluation.samples import Samples
from n2n.metrics.normals import normal_consistency


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.fixture
def clouds():
    random = np.random.default_rng(3)
    x, y = random.random((70, 3)), random.random((110, 3))
    return x, unit(random.standard_normal(x.shape)), y, unit(random.standard_normal(y.shape))


@pytest.fixture
def pair(clouds):
    x, n, y, m = clouds
    return Pair(Samples(x, n, ""), Samples(y, m, ""), None, Settings(threshold=0.15, asked=100))


def test_every_formula(clouds, pair):
    x, n, y, m = clouds
    table = cdist(x, y)
    a, c = table.min(axis=1), table.min(axis=0)
    p, r = (a <= 0.15).mean(), (c <= 0.15).mean()
    forth, back = (n * m[table.argmin(axis=1)]), (m * n[table.argmin(axis=0)])
    expected = {
        "cd_sum2": (a**2).mean() + (c**2).mean(),
        "cd_mean2": ((a**2).mean() + (c**2).mean()) / 2,
        "cd_sum1": a.mean() + c.mean(),
        "cd_mean1": (a.mean() + c.mean()) / 2,
        "cd_p2s": (a.sum() + c.sum()) / 100,
        "hausdorff": max(a.max(), c.max()),
        "nc": (abs(forth.sum(axis=1)).mean() + abs(back.sum(axis=1)).mean()) / 2,
        "nc_inflated": (abs(forth).sum(axis=1).mean() + abs(back).sum(axis=1).mean()) / 2,
        "precision": p,
        "recall": r,
        "fscore": 2 * p * r / (p + r),
    }
    for metric, value in expected.items():
        assert MEASURES[metric].find(pair) == pytest.approx(value, rel=1e-12), metric
    assert set(MEASURES) - set(expected) == {"p2m", "p2m_forward", "p2m_backward"}


@pytest.mark.parametrize("inflated", [False, True])
def test_normals_are_those_of_the_metric(clouds, pair, inflated):
    assert pair.normals(inflated) == pytest.approx(normal_consistency(*clouds, inflated=inflated), rel=1e-12)


def test_the_released_code_inflates_random_normals_from_a_half_to_three_quarters():
    random = np.random.default_rng(0)
    points = random.random((40_000, 3))
    n, m = (unit(random.standard_normal(points.shape)) for _ in range(2))
    pair = Pair(Samples(points, n, ""), Samples(points, m, ""), None, Settings())
    assert MEASURES["nc"].find(pair) == pytest.approx(0.5, abs=0.005)
    assert MEASURES["nc_inflated"].find(pair) == pytest.approx(0.75, abs=0.005)


def test_p2m_of_a_lifted_square():
    """Two triangles, points at height 0.1 above their corners: 0.01 up, 0.01 down."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    lifted = corners + [0, 0, 0.1]
    pair = Pair(Samples(lifted, None, ""), None, (lifted, corners, faces), Settings())
    assert MEASURES["p2m_forward"].find(pair) == pytest.approx(0.01)
    assert MEASURES["p2m_backward"].find(pair) == pytest.approx(0.01)
    assert MEASURES["p2m"].find(pair) == pytest.approx(0.02)


def test_the_guard_takes_the_inside_of_small_triangles():
    """A point above the middle of a right triangle is 0.1 from its plane, but 1/4 of the leg from its edges."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    point = np.array([[0.25, 0.25, 0.1]])
    found = {}
    for guard in (0.0, 1.0):
        pair = Pair(Samples(point, None, ""), None, (point, corners, np.array([[0, 1, 2]])), Settings(None, guard))
        found[guard] = MEASURES["p2m_forward"].find(pair)
    assert found[0.0] == pytest.approx(0.01)
    assert found[1.0] == pytest.approx(0.01 + 0.25**2)


@pytest.mark.parametrize(
    ("metric", "reason"),
    [
        ("cd_sum2", "no clean cloud given"),
        ("fscore", "no clean cloud given"),
        ("nc", "the reference has no normals"),
        ("p2m", "no mesh given"),
        ("cd_p2s", "only for samples of two meshes"),
    ],
)
def test_what_cannot_be_measured_says_why(metric, reason):
    with pytest.raises(Blank, match=reason):
        MEASURES[metric].find(Pair(Samples(np.zeros((1, 3)), None, ""), None, None, Settings(0.1)))


def test_normals_without_direction_leave_a_blank(pair):
    pair.reference.normals[4] = 0
    with pytest.raises(Blank, match="1 normals have no direction"):
        MEASURES["nc"].find(pair)
