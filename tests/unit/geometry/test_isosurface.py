"""The level set against closed forms, dense scikit-image marching cubes and trimesh."""

import numpy as np
import pytest
import torch
import trimesh
from skimage.measure import marching_cubes

from n2n.errors import ConfigError, SurfaceError
from n2n.geometry import marching
from n2n.geometry.components import drop_small_components
from n2n.geometry.isosurface import extract, voxel_size

_LOWER, _UPPER = np.full(3, -1.0), np.full(3, 1.0)


def sphere(centre=(0.0, 0.0, 0.0), radius=0.7, slope=1.0):
    centre = torch.tensor(centre, dtype=torch.float64)
    return lambda p: slope * ((p - centre).norm(dim=1) - radius)


def torus(p):
    return torch.hypot(torch.hypot(p[:, 0], p[:, 1]) - 0.6, p[:, 2]) - 0.25


def plate(thickness):
    half = torch.tensor([0.7013, 0.6037, thickness / 2], dtype=torch.float64)
    height = 0.0131

    def field(p):
        q = (p - torch.tensor([0, 0, height], dtype=torch.float64)).abs() - half
        return q.clamp(min=0).norm(dim=1) + q.amax(dim=1).clamp(max=0)

    return field


def waves(seed, frequency, count=12):
    """A smooth random field with many handles, pieces and ambiguous cells."""
    random = np.random.default_rng(seed)
    k = torch.as_tensor(random.normal(size=(3, count)) * frequency)
    phase = torch.as_tensor(random.uniform(0, 2 * np.pi, count))
    return lambda p: torch.cos(p @ k + phase).sum(dim=1) / (frequency * count**0.5)


def mesh_of(surface):
    return trimesh.Trimesh(surface.vertices, surface.faces, process=False)


def dense(field, lower, voxel, cells):
    """Every corner evaluated, plain scikit-image."""
    axes = [lower[i] + voxel * np.arange(cells[i] + 1) for i in range(3)]
    grid = torch.as_tensor(np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3))
    values = field(grid).numpy().reshape(cells + 1)
    vertices, faces, _, _ = marching_cubes(values.astype(np.float32), 0.0, spacing=(voxel,) * 3)
    return vertices + lower, faces


@pytest.mark.parametrize("resolution", [16, 40, 96, 200])
def test_sphere_has_the_error_of_linear_interpolation_and_no_shift(resolution):
    centre, radius = np.array([0.05, -0.11, 0.023]), 0.7
    voxel = voxel_size(_LOWER, _UPPER, resolution)
    surface = extract(sphere(tuple(centre), radius), _LOWER, _UPPER, voxel)
    error = np.linalg.norm(surface.vertices - centre, axis=1) - radius
    # The chord of an edge of length h in a sphere of curvature 1/R sags by at most h^2 / 8R.
    assert np.abs(error).max() <= 1.02 * voxel**2 / (8 * radius) + 1e-4 * voxel
    mesh = mesh_of(surface)
    np.testing.assert_allclose(mesh.center_mass, centre, atol=1e-2 * voxel)
    assert mesh.is_watertight
    assert mesh.euler_number == 2
    assert 0 < mesh.volume < 4 / 3 * np.pi * radius**3
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=3 * (voxel / radius) ** 2)


def test_vertices_are_the_linear_crossings_of_their_grid_edges_to_1e_6():
    field, voxel = sphere((0.05, -0.11, 0.023)), 2 / 100
    vertices = extract(field, _LOWER, _UPPER, voxel).vertices
    position = (vertices - _LOWER) / voxel
    low = np.floor(position + 1e-9)
    fraction = position - low
    assert ((fraction > 1e-7).sum(axis=1) == 1).all()
    high = low + (fraction > 1e-7)
    a, b = (field(torch.as_tensor(_LOWER + voxel * corner)).numpy() for corner in (low, high))
    crossing = _LOWER + voxel * (low + (a / (a - b))[:, None] * (high - low))
    # 1e-4 of a voxel is kept free around corners.
    assert np.abs(vertices - crossing).max() <= 2e-6
    assert np.quantile(np.abs(vertices - crossing), 0.99) < 1e-12


@pytest.mark.parametrize(
    ("field", "resolution"),
    [(sphere(), 70), (torus, 100), (waves(0, 9), 64), (waves(1, 14), 64), (plate(0.06), 100)],
)
def test_equals_dense_marching_cubes_on_the_same_grid(field, resolution):
    upper = np.array([1.0, 0.9, 0.8])
    voxel = voxel_size(_LOWER, upper, resolution)
    cells = np.ceil((upper - _LOWER) / voxel - 1e-6).astype(int)
    surface = extract(field, _LOWER, upper, voxel)
    vertices, faces = dense(field, _LOWER, voxel, cells)
    found, expected = (_by_edge(v, voxel) for v in (surface.vertices, vertices))
    assert found.keys() == expected.keys()
    difference = np.array([found[edge] for edge in expected]) - np.array(list(expected.values()))
    assert np.abs(difference).max() < 2e-3 * voxel
    # In a few ambiguous cells in 10^5 the limit on corner ratios decides for another vertex in the middle.
    assert len(surface.vertices) == pytest.approx(len(vertices), abs=2e-5 * len(vertices))
    assert mesh_of(surface).area == pytest.approx(trimesh.Trimesh(vertices, faces, process=False).area, rel=1e-4)


def _by_edge(vertices, voxel):
    """Name vertices by the grid edge they lie on; leave out those at a corner or in the middle of a cell."""
    position = (vertices - _LOWER) / voxel
    corner = np.floor(position + 5e-4)
    moving = position - corner > 5e-4
    edge = moving.sum(axis=1) == 1
    names = np.column_stack([corner, moving.argmax(axis=1)])[edge].astype(int)
    return dict(zip(map(tuple, names), vertices[edge], strict=True))


def test_torus_has_genus_one():
    mesh = mesh_of(extract(torus, _LOWER, _UPPER, 2 / 120))
    assert mesh.is_watertight
    assert mesh.euler_number == 0
    assert mesh.volume == pytest.approx(2 * np.pi**2 * 0.6 * 0.25**2, rel=2e-3)


def test_nested_spheres_keep_both_sheets_with_their_orientation():
    def shell(p):
        radius = p.norm(dim=1)
        return torch.maximum(radius - 0.8, 0.5 - radius)

    mesh = mesh_of(extract(shell, _LOWER, _UPPER, 2 / 100))
    assert mesh.is_watertight
    assert mesh.body_count == 2
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * (0.8**3 - 0.5**3), rel=2e-3)
    outward = np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles_center) > 0
    assert (outward == (np.linalg.norm(mesh.triangles_center, axis=1) > 0.65)).all()


@pytest.mark.parametrize(("resolution", "voxels"), [(100, 3.0), (256, 3.0), (300, 1.2)])
def test_thin_plate_is_found_though_no_coarse_corner_is_inside(resolution, voxels):
    voxel = 2 / resolution
    mesh = mesh_of(extract(plate(voxels * voxel), _LOWER, _UPPER, voxel))
    assert mesh.is_watertight
    assert mesh.body_count == 1
    assert mesh.euler_number == 2


@pytest.mark.parametrize("slope", [0.1, 0.5, 2.0, 30.0, 1e-6, 1e6])
def test_slope_of_the_field_does_not_change_the_surface(slope):
    voxel = 2 / 110
    expected = extract(sphere(), _LOWER, _UPPER, voxel)
    surface = extract(sphere(slope=slope), _LOWER, _UPPER, voxel)
    np.testing.assert_allclose(surface.vertices, expected.vertices, atol=1e-10)
    assert mesh_of(surface).is_watertight


def test_slope_two_loses_no_thin_plate():
    thin = plate(3 * 2 / 200)
    mesh = mesh_of(extract(lambda p: 2 * thin(p), _LOWER, _UPPER, 2 / 200))
    assert mesh.is_watertight
    assert mesh.euler_number == 2


@pytest.mark.parametrize("tile", [16, 2])
def test_noise_on_every_corner_still_gives_a_closed_manifold(tile, monkeypatch):
    """Random signs hold every ambiguous case; bricks and tiles must agree on all of them."""
    monkeypatch.setattr(marching, "_TILE", tile)
    cells = 23
    values = np.random.default_rng(0).normal(size=(cells + 1,) * 3)
    for axis in range(3):
        np.moveaxis(values, axis, 0)[[0, -1]] = 1.0
    values = torch.as_tensor(values)

    def field(p):
        i, j, k = ((p + 1) * cells / 2).round().long().T
        return values[i, j, k]

    mesh = mesh_of(extract(field, _LOWER, _UPPER, 2 / cells))
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert len(trimesh.Trimesh(mesh.vertices, mesh.faces).vertices) == len(mesh.vertices)


def test_corners_exactly_on_the_surface_make_no_duplicate_vertices():
    def octahedron(p):
        return p.abs().sum(dim=1) - 0.5

    mesh = mesh_of(extract(octahedron, _LOWER, _UPPER, 2 / 32))
    assert mesh.is_watertight
    assert mesh.euler_number == 2
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)
    assert mesh.area_faces.min() > 0


def test_surface_leaving_the_box_is_open_there():
    normal = np.array([0.36, 0.48, 0.8])

    def plane(p):
        return (p @ torch.as_tensor(normal)) - 0.0871

    surface = extract(plane, _LOWER, _UPPER, 2 / 60)
    mesh = mesh_of(surface)
    np.testing.assert_allclose(mesh.vertices @ normal, 0.0871, atol=1e-5)
    np.testing.assert_allclose(np.average(mesh.face_normals, axis=0, weights=mesh.area_faces), normal, atol=1e-6)
    edges = np.sort(mesh.edges, axis=1)
    _, first, count = np.unique(edges, axis=0, return_index=True, return_counts=True)
    rim = mesh.vertices[np.unique(edges[first[count == 1]])]
    np.testing.assert_allclose(np.abs(rim).max(axis=1), 1, atol=1e-9)


def test_level_other_than_zero():
    surface = extract(sphere(), _LOWER, _UPPER, 2 / 80, iso=0.1)
    radius = np.linalg.norm(surface.vertices, axis=1)
    np.testing.assert_allclose(radius, 0.8, atol=1.02 * (2 / 80) ** 2 / (8 * 0.8))


def test_polish_puts_vertices_on_the_true_level_set():
    def egg(p):
        return p[:, 0] ** 2 + 2 * p[:, 1] ** 2 + 3 * p[:, 2] ** 2 - 0.5

    errors = []
    for steps in (0, 1, 2):
        surface = extract(egg, _LOWER, _UPPER, 2 / 40, polish=steps)
        assert mesh_of(surface).is_watertight
        errors.append(np.median(np.abs(egg(torch.as_tensor(surface.vertices)).numpy())))
    assert errors[1] < 0.1 * errors[0]
    assert errors[2] < 0.1 * errors[1]


def test_every_corner_is_evaluated_once_and_few_are():
    seen = []

    def field(p):
        seen.append(p.numpy().copy())
        return sphere()(p)

    surface = extract(field, _LOWER, _UPPER, 2 / 128)
    positions = np.concatenate(seen)
    assert len(positions) == surface.evaluations
    assert len(np.unique(positions.round(9), axis=0)) == len(positions)
    assert surface.dense_evaluations == 129**3
    assert surface.evaluations < 0.2 * surface.dense_evaluations


def test_nothing_outside_the_box_is_evaluated():
    upper = np.array([1.0, 0.55, 0.2])
    low, high = np.full(3, np.inf), np.full(3, -np.inf)

    def field(p):
        np.minimum(low, p.numpy().min(axis=0), out=low)
        np.maximum(high, p.numpy().max(axis=0), out=high)
        return sphere()(p)

    voxel = voxel_size(_LOWER, upper, 100)
    extract(field, _LOWER, upper, voxel)
    np.testing.assert_allclose(low, _LOWER, atol=1e-12)
    assert (high <= upper + voxel).all()


def test_single_precision_field_and_gradients_enabled():
    layer = torch.nn.Linear(3, 1)
    surface = extract(lambda p: layer(p.float())[:, 0] * 0 + sphere()(p), _LOWER, _UPPER, 2 / 40)
    assert surface.vertices.dtype == np.float64
    assert surface.faces.dtype == np.int64


@pytest.mark.parametrize(
    ("field", "message"),
    [
        (sphere(radius=-0.031), r"positive everywhere.*min f = 0\.031 at \(0, 0, 0\).*outside"),
        (lambda p: -sphere(radius=-0.5)(p), "negative everywhere.*inside"),
        (lambda p: torch.full((len(p),), 0.25), "constant.*0.25"),
        (lambda p: torch.where(p[:, 0] > 0.5, torch.nan, sphere()(p)), "NaN or infinite at [1-9][0-9]* of"),
    ],
)
def test_no_surface_is_explained(field, message):
    with pytest.raises(SurfaceError, match=message):
        extract(field, _LOWER, _UPPER, 2 / 64)


def test_unusable_box_and_voxel_are_refused():
    with pytest.raises(ConfigError, match="upper must exceed lower"):
        extract(sphere(), _UPPER, _LOWER, 0.1)
    for voxel in (1e-5, 0.0, -1.0, float("nan")):
        with pytest.raises(ConfigError, match=r"too small.*at least"):
            extract(sphere(), _LOWER, _UPPER, voxel)


def test_small_components_can_be_dropped():
    def two(p):
        return torch.minimum(sphere(radius=0.6)(p), sphere((0.8, 0.8, 0.8), 0.05)(p))

    surface = extract(two, _LOWER, _UPPER, 2 / 64)
    assert mesh_of(surface).body_count == 2
    vertices, faces = drop_small_components(surface.vertices, surface.faces, 0.05)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.body_count == 1
    assert mesh.is_watertight
    assert np.linalg.norm(vertices, axis=1).max() < 0.61
