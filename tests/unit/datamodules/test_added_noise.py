"""Benchmarks whose noise is added here: official layouts, exact counts, independent copies, plain messages."""

import numpy as np
import pytest
import trimesh

from n2n.datamodules.benchmark import noisy_copies
from n2n.datamodules.pointcleannet import PCDataModule
from n2n.datamodules.punet import PUDataModule
from n2n.datamodules.shapenet import CLASSES, ShapeNetDataModule
from n2n.errors import InputError
from n2n.formats import Cloud, write_cloud, write_mesh

STEM = "galera100k_noise_white_"
IDS = ("1a", "2b")


def _ball(count, seed=0):
    points = np.random.default_rng(seed).standard_normal((count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def _write(path, points):
    path.parent.mkdir(parents=True, exist_ok=True)
    write_cloud(path, Cloud(points))


def _store(folder, **changes):
    """Write a pointcloud.npz in the layout of Occupancy Networks; None leaves an array out."""
    folder.mkdir(parents=True, exist_ok=True)
    ball = _ball(100_000)
    arrays = {"points": 0.5 * ball, "normals": ball, "loc": np.zeros(3), "scale": np.ones(())} | changes
    arrays = {name: np.asarray(values, np.float16) for name, values in arrays.items() if values is not None}
    np.savez(folder / "pointcloud.npz", **arrays)


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """A data folder with an off-centre ellipsoid in every layout."""
    folder = tmp_path_factory.mktemp("data")
    mesh = trimesh.creation.icosphere(3)
    mesh.vertices = mesh.vertices * [5, 3, 2] + [100, -20, 7]
    for name in ("star", "duck"):
        path = folder / f"PUNet/meshes/test/{name}.off"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_mesh(path, mesh)
    clean = 400 * _ball(100_000) + [0, 0, 1000]
    _write(folder / "PCNet/galera100k.xyz", clean)
    _write(folder / "PCNet/galera100k_noise_white_1.00e-02.xyz", clean + 8 * _ball(100_000, 1))
    for identity in IDS:
        _store(folder / f"ShapeNet/02828884/{identity}")
    (folder / "ShapeNet/02828884/test.lst").write_text("2b\n1a\n3c\n")
    return folder


def _pu(root, **arguments):
    return PUDataModule(**{"shape": "duck", "points": 700, "root": str(root)} | arguments)


def _pc(root, **arguments):
    return PCDataModule(**{"shape": "galera", "points": 700, "root": str(root)} | arguments)


def _shapenet(root, **arguments):
    return ShapeNetDataModule(**{"shape": "bench/1a", "root": str(root)} | arguments)


LEVELS = {_pu: 0.01, _pc: 0.01, _shapenet: 0.005}


@pytest.mark.parametrize("build", [_pu, _pc])
def test_everything_is_in_the_unit_sphere_of_the_clean_cloud(root, build):
    data = build(root, noise=0.02)
    clean = data.reference.points
    assert clean.shape == data.noisy.shape == (700, 3)
    np.testing.assert_allclose(clean.min(axis=0) + clean.max(axis=0), 0, atol=1e-12)
    assert np.linalg.norm(clean, axis=1).max() == pytest.approx(1)
    np.testing.assert_allclose((data.noisy - clean).std(axis=0), 0.02, rtol=0.1)


def test_pu_points_lie_on_the_mesh_that_is_handed_out(root):
    data = _pu(root)
    vertices, faces, points = data.reference.vertices, data.reference.faces, data.reference.points
    apex = vertices[faces[:, 0]]
    normals = np.cross(vertices[faces[:, 1]] - apex, vertices[faces[:, 2]] - apex)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # The mesh is convex, so the planes of its faces tell how far inside a point lies.
    height = points @ normals.T - np.einsum("fi,fi->f", normals, apex)
    np.testing.assert_allclose(height.max(axis=1), 0, atol=1e-6)
    assert np.linalg.norm(data.reference.vertices, axis=1).max() == pytest.approx(1, abs=0.05)


def test_pc_points_are_of_the_file(root):
    data = _pc(root)
    assert data.reference.vertices is None and data.reference.normals is None
    middle, radius = data.frames[0].centre, data.frames[0].scale
    assert len(middle) == 3 and radius == pytest.approx(1, abs=0.1)
    # A sphere stays one, wherever it was and however large.
    np.testing.assert_allclose(np.linalg.norm(data.reference.points, axis=1), 1, atol=0.01)


def test_shapenet_keeps_the_stored_frame_and_truth(root):
    data = _shapenet(root)
    assert data.name == "bench/1a" and data.noisy.shape == (3000, 3)
    assert data.reference.points.shape == data.reference.normals.shape == (100_000, 3)
    np.testing.assert_allclose(np.linalg.norm(data.reference.points, axis=1), 0.5, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(data.reference.normals, axis=1), 1, atol=1e-12)
    radial = np.linalg.norm(data.noisy, axis=1) - 0.5
    assert radial.std() == pytest.approx(0.005, rel=0.06)
    # Drawn with replacement: 3000 of 100 000 hold some 44 pairs; copies share the one clean cloud.
    zero = _shapenet(root, noise=0.0).noisy
    assert 2900 < len(np.unique(zero, axis=0)) < 2999


@pytest.mark.parametrize("build", [_pu, _pc, _shapenet])
def test_a_copy_is_the_same_for_every_number_of_copies(root, build):
    few, many = build(root, num_observations=2), build(root, num_observations=4)
    assert [len(data.shapes[0]) for data in (few, many)] == [2, 4]
    assert (few.noisy == many.noisy).all()
    worlds = [[data.frames[0].to_world(c.double().numpy()) for c in data.shapes[0]] for data in (few, many)]
    for a, b in zip(*worlds, strict=False):
        np.testing.assert_allclose(a, b, atol=1e-5)
    # Different copies are independent: their difference has the deviation of two.
    if len(worlds[1][2]) == len(worlds[1][3]):
        np.testing.assert_allclose((worlds[1][2] - worlds[1][3]).std(), np.sqrt(2) * LEVELS[build], rtol=0.05)


def test_noise_is_drawn_with_seed_and_copy():
    clean = _ball(50)
    for k, copy in enumerate(noisy_copies(clean, 0.1, "gaussian", 7, 3)):
        expected = clean + 0.1 * np.random.default_rng([7, k]).standard_normal((50, 3))
        np.testing.assert_array_equal(copy, expected)


@pytest.mark.parametrize("build", [_pu, _pc, _shapenet])
def test_the_same_arguments_make_the_same_data(root, build):
    first, again, other = build(root), build(root), build(root, seed=1)
    assert first.fingerprint() == again.fingerprint() != other.fingerprint()
    assert (first.reference.points == again.reference.points).all()
    assert first.source == again.source and "seed 0" in first.source and str(root) not in first.source


@pytest.mark.parametrize("build", [_pu, _pc])
def test_a_denser_reference_in_the_same_frame(root, build):
    plain, dense = build(root), build(root, reference_points=2100)
    assert (plain.noisy == dense.noisy).all() and dense.reference.points.shape == (2100, 3)
    assert "2100" in dense.source
    sizes = [np.ptp(data.reference.points, axis=0) for data in (plain, dense)]
    np.testing.assert_allclose(*sizes, rtol=0.06)


def test_pu_takes_official_files_where_there_are_any(root, tmp_path):
    folder = tmp_path / "data"  # as unpacked: one folder deeper
    mesh = folder / "PUNet/meshes/test/duck.off"
    mesh.parent.mkdir(parents=True)
    mesh.write_bytes((root / "PUNet/meshes/test/duck.off").read_bytes())
    clean = _ball(10_000) * [5, 3, 2] + [100, -20, 7]
    noisy = clean + 0.05 * np.random.default_rng(9).standard_normal(clean.shape)
    _write(folder / "PUNet/pointclouds/test/10000_poisson/duck.xyz", clean)
    _write(folder / "examples/PUNet_10000_poisson_0.01/duck.xyz", noisy)
    drawn, official = (_pu(tmp_path, points=10_000, official=value, num_observations=2) for value in (False, True))
    scale = np.linalg.norm(clean - (clean.min(axis=0) + clean.max(axis=0)) / 2, axis=1).max()
    np.testing.assert_allclose((official.noisy - drawn.reference.points) * scale, noisy - clean, atol=1e-6)
    assert "10000_poisson/duck.xyz" in drawn.source and "examples" not in drawn.source
    assert "examples/PUNet_10000_poisson_0.01/duck.xyz" in official.source
    assert (drawn.shapes[0][1].shape == official.shapes[0][1].shape) and (drawn.noisy != official.noisy).any()
    (tmp_path / "n2n-prepared-pu.json").write_text('{"duck": "data/examples/PUNet_10000_poisson_0.01/duck.xyz"}')
    assert "duck.xyz (made by n2n data prepare)" in _pu(tmp_path, points=10_000, official=True).source
    with pytest.raises(InputError, match=r"no official noisy file for duck, 10000_poisson_0.02; leave out"):
        _pu(tmp_path, points=10_000, noise=0.02, official=True)


def test_pc_official_noise_keeps_its_rows(root):
    data = _pc(root, official=True)
    moved = np.linalg.norm(data.noisy - data.reference.points, axis=1)
    np.testing.assert_allclose(moved, 8 / 400, rtol=0.02)
    with pytest.raises(InputError, match=r"no official noisy file for galera, noise 2.00e-02"):
        _pc(root, official=True, noise=0.02)


def test_pc_copies_beside_an_official_one_have_its_level(tmp_path):
    """A flat box: its longest edge is 1.9 radii, so that the two units differ."""
    clean = 30 * np.random.default_rng(3).uniform(-1, 1, (100_000, 3)) * [1.0, 0.3, 0.1] + [5, 0, 0]
    noisy = clean + 0.025 * 60 * np.random.default_rng(4).standard_normal(clean.shape)
    _write(tmp_path / "PCNet/galera100k.xyz", clean)
    _write(tmp_path / "PCNet/galera100k_noise_white_2.50e-02.xyz", noisy)
    data = _pc(tmp_path, official=True, noise=0.025, points=2000, num_observations=3)
    copies = [data.frames[0].to_world(cloud.double().numpy()) for cloud in data.shapes[0]]
    thickness = [np.std(copy[:, 2]) for copy in copies]
    expected = np.hypot(np.std(data.reference.points[:, 2]), 0.025 * np.ptp(data.reference.points, axis=0).max())
    np.testing.assert_allclose(thickness, expected, rtol=0.06)
    assert "noise 0.025 of the longest edge" in data.source
    assert "noise 0.025 of the radius" in _pc(tmp_path, noise=0.025).source


@pytest.mark.parametrize("level", ["2.50e-03", "5.00e-03", "1.00e-02", "1.50e-02", "2.50e-02"])
def test_all_official_levels_of_pc(root, tmp_path, level):
    (tmp_path / "PCNet").mkdir()
    (tmp_path / "PCNet/galera100k.xyz").symlink_to(root / "PCNet/galera100k.xyz")
    (tmp_path / f"PCNet/galera100k_noise_white_{level}.xyz").symlink_to(
        root / "PCNet/galera100k_noise_white_1.00e-02.xyz"
    )
    assert f"galera100k_noise_white_{level}.xyz" in _pc(tmp_path, official=True, noise=float(level)).source


def _copy_pc(root, folder):
    folder.mkdir(parents=True)
    for path in (root / "PCNet").glob("galera100k*.xyz"):
        (folder / path.name).symlink_to(path)


@pytest.mark.parametrize("meshes", ["PCNet/meshes/inner", "pointCleanNetDataset/meshes"])
def test_pc_as_fetched_clouds_in_one_folder_meshes_in_another(root, tmp_path, meshes):
    _copy_pc(root, tmp_path / "pointCleanNetDataset")
    mesh = trimesh.creation.icosphere(4, 400).apply_translation((0, 0, 1000))
    (tmp_path / meshes).mkdir(parents=True)
    write_mesh(tmp_path / meshes / "galera.off", mesh)
    data = _pc(tmp_path)
    assert PCDataModule.names(str(tmp_path)) == ["galera"] and data.reference.faces.shape == (5120, 3)
    assert "mesh " + meshes + "/galera.off" in data.source
    np.testing.assert_allclose(np.linalg.norm(data.reference.vertices, axis=1), 1, atol=0.01)
    for scale, shift in ((1.0, 30.0), (1.06, 0.0), (0.01, 0.0)):
        write_mesh(tmp_path / meshes / "galera.off", mesh.copy().apply_translation((0, shift, 0)).apply_scale(scale))
        data = _pc(tmp_path)
        assert data.reference.vertices is None and "left aside, the cloud does not lie on it" in data.source
    (tmp_path / meshes / "galera.off").write_text("OFF\n")
    assert "left aside, it cannot be read" in _pc(tmp_path).source


def test_pc_of_score_denoise_beside_the_original(root, tmp_path):
    """Its clouds have another scale; its examples are relative to the radius."""
    _copy_pc(root, tmp_path / "data/pointCleanNetDataset")
    clean = 3 * _ball(10_000, 5)
    noisy = clean + 0.02 * 3 * np.random.default_rng(6).standard_normal(clean.shape)
    _write(tmp_path / "data/PCNet/pointclouds/test/10000_poisson/galera.xyz", clean)
    _write(tmp_path / "data/examples/PCNet_10000_poisson_0.02/galera.xyz", noisy)
    _write(tmp_path / "data/PCNet/pointclouds/test/10000_poisson/dragon.xyz", clean)
    assert PCDataModule.names(str(tmp_path)) == ["galera", "dragon"]
    data = _pc(tmp_path, points=10_000, noise=0.02, official=True, num_observations=2)
    np.testing.assert_allclose((data.noisy - data.reference.points).std(axis=0), 0.02, rtol=0.03)
    assert "data/PCNet/pointclouds/test/10000_poisson/galera.xyz" in data.source
    assert "data/examples/PCNet_10000_poisson_0.02/galera.xyz" in data.source and "of the radius" in data.source
    # No example of this level: the rows of PointCleanNet, in its own unit.
    other = _pc(tmp_path, points=10_000, noise=0.01, official=True)
    assert "galera100k_noise_white_1.00e-02.xyz" in other.source and "of the longest edge" in other.source
    # Another density comes from the 100 000; mixed with a stored cloud of another scale it is refused.
    assert "galera100k.xyz, 700 of 100000" in _pc(tmp_path).source
    with pytest.raises(InputError, match="expected both in one frame"):
        _pc(tmp_path, points=10_000, reference_points=20_000)
    # A shape of which only the Poisson-disk cloud is here is thinned from that.
    thinned = _pc(tmp_path, shape="dragon")
    assert "10000_poisson/dragon.xyz, 700 of 10000 points by Poisson disks" in thinned.source
    with pytest.raises(InputError, match=r"dragon\.xyz: holds 10000 points, 20000 were asked for"):
        _pc(tmp_path, shape="dragon", points=20_000)


def test_pu_shapes_without_a_mesh_have_their_clouds(root, tmp_path):
    clean = _ball(10_000) * [5, 3, 2] + [100, -20, 7]
    noisy = clean + 0.05 * np.random.default_rng(9).standard_normal(clean.shape)
    _write(tmp_path / "data/PUNet/pointclouds/test/10000_poisson/sculpt.xyz", clean)
    _write(tmp_path / "data/examples/PUNet_10000_poisson_0.01/sculpt.xyz", noisy)
    mesh = tmp_path / "data/PUNet/meshes/test/duck.off"
    mesh.parent.mkdir(parents=True)
    mesh.write_bytes((root / "PUNet/meshes/test/duck.off").read_bytes())
    assert PUDataModule.names(str(tmp_path)) == ["duck", "sculpt"]
    data = _pu(tmp_path, shape="sculpt", points=10_000, official=True)
    assert data.reference.vertices is None and data.reference.points.shape == (10_000, 3)
    assert "there is no mesh" in data.source and "there is no mesh" not in _pu(tmp_path).source
    scale = np.linalg.norm(clean - (clean.min(axis=0) + clean.max(axis=0)) / 2, axis=1).max()
    np.testing.assert_allclose((data.noisy - data.reference.points) * scale, noisy - clean, atol=1e-6)
    sparse = _pu(tmp_path, shape="sculpt", points=500, reference_points=2000)
    assert len(sparse.noisy) == 500 and len(sparse.reference.points) == 2000
    with pytest.raises(InputError, match=r"sculpt.xyz: holds 10000 points, 20000 were asked for"):
        _pu(tmp_path, shape="sculpt", points=20_000)
    missing = PUDataModule.missing(str(tmp_path))
    assert "PU meshes, for P2M, not present: sculpt;" in missing
    assert "sculpt" not in missing.split(";")[0] and "duck" not in missing


def test_names_and_what_is_missing(root):
    assert PUDataModule.names(str(root)) == ["duck", "star"]
    assert PCDataModule.names(str(root)) == ["galera"]
    assert ShapeNetDataModule.names(str(root)) == ["bench/2b", "bench/1a"]
    assert "PU meshes not present: Icosahedron, Octahedron" in PUDataModule.missing(str(root))
    assert "duck" not in PUDataModule.missing(str(root))
    assert "n2n data fetch pc" in PCDataModule.missing(str(root))
    gaps = ShapeNetDataModule.missing(str(root))
    assert "airplane (02691156)" in gaps and "bench (1 of 3 listed in test.lst)" in gaps
    assert len(CLASSES) == len(set(CLASSES.values())) == 13
    for module in (PUDataModule, PCDataModule, ShapeNetDataModule):
        assert module.names(str(root / "nowhere")) == [] and module.missing(str(root / "nowhere"))


def test_the_first_shape_and_the_environment(root, monkeypatch):
    monkeypatch.setenv("N2N_DATA", str(root))
    assert PUDataModule(points=200).name == "duck"
    assert ShapeNetDataModule().name == "bench/2b"
    assert ShapeNetDataModule("bench").name == ShapeNetDataModule("02828884/2b").name == "bench/2b"


@pytest.mark.parametrize(
    ("build", "arguments", "message"),
    [
        (_pu, {"shape": "ducky"}, "'ducky' is not there; present: duck, star"),
        (_pu, {"points": 0}, "datamodule.points=0 is out of range; give a whole number >= 100"),
        (_pu, {"noise": -1.0}, "noise=-1.0 is out of range"),
        (_pu, {"noise_model": "salt"}, "noise model 'salt' is not known"),
        (_pu, {"reference_points": 5}, "datamodule.reference_points=5 is out of range"),
        (_pc, {"points": 100_001}, "holds 100000 points, 100001 were asked for; lower datamodule.points"),
        (_shapenet, {"shape": "benhc/1a"}, "ShapeNet has no class 'benhc'. Did you mean 'bench'?"),
        (_shapenet, {"shape": "bench/zz"}, "'zz' is not there; present: 2b, 1a"),
        (_shapenet, {"shape": "chair"}, "no scan found there; get it with `n2n data fetch shapenet`"),
    ],
)
def test_mistakes(root, build, arguments, message):
    with pytest.raises(InputError) as caught:
        build(root, **arguments)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def _broken_shapenet(folder, how):
    place = folder / "ShapeNet/02828884"
    (place / "1a").mkdir(parents=True)
    (place / "test.lst").write_text("1a\n" if how != "twice" else "1a\n1a\n")
    if how == "empty list":
        (place / "test.lst").write_text("\n")
    if how == "no list":
        (place / "test.lst").unlink()
    spoilt = 0.5 * _ball(100_000)
    spoilt[5] = np.nan
    changes = {
        "few": {"points": 0.5 * _ball(99)},
        "no normals": {"normals": None},
        "keys": {"points": None, "normals": None},
        "nan": {"points": spoilt},
        "nan normals": {"normals": spoilt.astype(np.float16)},
        "scale": {"points": 40 * _ball(100_000)},
    }
    _store(place / "1a", **changes.get(how, {}))
    if how == "truncated":
        path = place / "1a/pointcloud.npz"
        path.write_bytes(path.read_bytes()[:5000])


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("truncated", "pointcloud.npz: is no .npz archive, or cut off"),
        ("few", "pointcloud.npz: holds points (99, 3)"),
        ("no normals", "and normals (0,)"),
        ("keys", "no array named"),
        ("nan", "pointcloud.npz: 1 of 100000 points are NaN or infinite"),
        ("nan normals", "holds normals that are NaN or infinite"),
        ("scale", "the longest edge is 80, not 1; the cloud is not in the unit cube"),
        ("empty list", "test.lst: is empty; expected one name a line"),
        ("no list", "test.lst: is missing; expected"),
        ("twice", "test.lst: names '1a' twice; expected every name once"),
    ],
)
def test_bad_shapenet(tmp_path, how, message):
    _broken_shapenet(tmp_path, how)
    with pytest.raises(InputError) as caught:
        _shapenet(tmp_path)
    text = str(caught.value)
    assert message in text and str(tmp_path) in text and "expected" in text and "\n" not in text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "duck.off: the file is empty"),
        ("OFF\n9 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "the header promises 9 vertices"),
        ("OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n", "holds no triangles"),
        ("OFF\n3 1 0\n0 0 nan\n1 0 0\n0 1 0\n3 0 1 2\n", "1 points are NaN or infinite"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "face index outside the range of its vertices"),
    ],
)
def test_bad_meshes(tmp_path, content, message):
    path = tmp_path / "PUNet/meshes/test/duck.off"
    path.parent.mkdir(parents=True)
    path.write_text(content)
    with pytest.raises(InputError) as caught:
        _pu(tmp_path)
    assert message in str(caught.value) and "expected PUNet/meshes/test/NAME.off" in str(caught.value)


def test_bad_clouds(root, tmp_path):
    mesh = tmp_path / "PUNet/meshes/test/duck.off"
    mesh.parent.mkdir(parents=True)
    mesh.write_bytes((root / "PUNet/meshes/test/duck.off").read_bytes())
    path = tmp_path / "PUNet/pointclouds/test/10000_poisson/duck.xyz"
    clean = _ball(10_000) * [5, 3, 2] + [100, -20, 7]
    _write(path, clean[:9000])
    with pytest.raises(InputError, match=r"duck.xyz: holds 9000 points, not 10000; expected PUNet/pointclouds"):
        _pu(tmp_path, points=10_000)
    _write(path, (clean - clean.mean(axis=0)) / 5)
    with pytest.raises(InputError, match=r"does not lie where its truth .* lies .*; expected both in one frame"):
        _pu(tmp_path, points=10_000)
    clean[3] = np.nan
    _write(path, clean)
    with pytest.raises(InputError, match="1 of 10000 points are NaN or infinite; expected PUNet/pointclouds"):
        _pu(tmp_path, points=10_000)


def test_official_noise_on_another_scale(root, tmp_path):
    clean = 400 * _ball(100_000)
    _write(tmp_path / "PCNet/galera100k.xyz", clean)
    _write(tmp_path / "PCNet/galera100k_noise_white_1.00e-02.xyz", clean / 400)
    with pytest.raises(
        InputError, match=r"does not lie where its truth .*galera100k.xyz lies .*; expected both in one frame"
    ):
        _pc(tmp_path, official=True)
