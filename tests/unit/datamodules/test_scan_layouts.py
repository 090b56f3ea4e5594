"""Official layouts as downloaded are found and read; what is wrong with a file is one line, and only that shape's."""

import numpy as np
import pytest
import trimesh

from n2n.datamodules import layouts
from n2n.datamodules.dfaust import DFaustDataModule
from n2n.datamodules.kitti import KittiDataModule
from n2n.datamodules.paris import ParisDataModule, cut
from n2n.datamodules.points2surf import ABCDataModule, FamousDataModule
from n2n.datamodules.scene3d import Scene3DDataModule
from n2n.datamodules.srb import SRBDataModule
from n2n.errors import InputError
from n2n.formats import Cloud, write_cloud


def ball(count=400, radius=0.5, centre=(0, 0, 0), seed=0):
    random = np.random.default_rng(seed)
    points = random.normal(size=(count, 3))
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True) + np.asarray(centre, float)


def mesh(path, radius=0.5, centre=(0, 0, 0)):
    path.parent.mkdir(parents=True, exist_ok=True)
    shape = trimesh.creation.icosphere(2, radius)
    shape.apply_translation(centre)
    shape.export(path)
    return shape


def cloud(path, points, **attributes):
    path.parent.mkdir(parents=True, exist_ok=True)
    write_cloud(path, Cloud(points, attributes))


def points2surf(root, variant="famous_original", names=("bunny", "horse")):
    folder = root / variant
    for seed, name in enumerate(names):
        mesh(folder / "03_meshes" / f"{name}.ply")
        (folder / "04_pts").mkdir(exist_ok=True)
        np.save(folder / "04_pts" / f"{name}.xyz.npy", ball(seed=seed).astype(np.float32))
    (folder / "testset.txt").write_text("\n".join(names) + "\n")
    return folder


def in_world(module):
    return module.frames[0].to_world(module.shapes[0][0].double().numpy())


def failure(call):
    with pytest.raises(InputError) as caught:
        call()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_famous_is_read_with_its_mesh(tmp_path):
    points2surf(tmp_path)
    assert FamousDataModule.names(str(tmp_path)) == ["bunny", "horse"]
    module = FamousDataModule("horse", root=str(tmp_path))
    np.testing.assert_allclose(in_world(module), ball(seed=1), atol=1e-6)
    assert module.name == "horse" and module.reference.faces.shape == (320, 3) and module.reference.points is None
    np.testing.assert_allclose(np.linalg.norm(module.reference.vertices, axis=1), 0.5, atol=1e-6)
    assert "famous_original/04_pts/horse.xyz.npy" in module.source
    assert "Armadillo" in FamousDataModule.missing(str(tmp_path)) and "n2n data fetch" in FamousDataModule.missing(
        str(tmp_path)
    )


@pytest.mark.parametrize("base", ["", "datasets", "data"])
def test_archives_may_be_unpacked_in_the_usual_places(tmp_path, base):
    points2surf(tmp_path / base, "abc_extra_noisy", ("00011", "00012"))
    assert ABCDataModule("00012", "extra_noisy", str(tmp_path)).name == "00012"
    assert ABCDataModule.names(str(tmp_path), "abc_extra_noisy") == ["00011", "00012"]
    assert ABCDataModule.names(str(tmp_path)) == [] and "abc" in ABCDataModule.missing(str(tmp_path))


def test_the_environment_names_the_data_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("N2N_DATA", str(tmp_path))
    points2surf(tmp_path)
    assert FamousDataModule().name == "bunny"
    monkeypatch.delenv("N2N_DATA")
    monkeypatch.chdir(tmp_path)
    assert "data/famous_original" in failure(FamousDataModule)


def test_wrong_names_are_told(tmp_path):
    points2surf(tmp_path)
    assert "'bunnny'" in failure(lambda: FamousDataModule("bunnny", root=str(tmp_path)))
    assert "famous_dense" in failure(lambda: FamousDataModule(variant="dens", root=str(tmp_path)))
    assert "num_observations=2" in failure(lambda: FamousDataModule(root=str(tmp_path), num_observations=2))


def truncate(path):
    path.write_bytes(path.read_bytes()[:-100])


@pytest.mark.parametrize(
    ("spoil", "file", "told"),
    [
        (truncate, "04_pts/bunny.xyz.npy", "04_pts/bunny.xyz.npy"),
        (lambda path: path.write_bytes(b""), "04_pts/bunny.xyz.npy", "empty"),
        (lambda path: np.save(path, np.zeros((50, 4))), "04_pts/bunny.xyz.npy", "4 columns, not 3"),
        (lambda path: np.save(path, np.zeros(300)), "04_pts/bunny.xyz.npy", r"(300,)"),
        (lambda path: np.save(path, ball(20)), "04_pts/bunny.xyz.npy", "20 points are too few"),
        (lambda path: path.unlink(), "03_meshes/bunny.ply", "no such file"),
        (truncate, "03_meshes/bunny.ply", "03_meshes/bunny.ply"),
        (lambda path: mesh(path, 20.0), "03_meshes/bunny.ply", "one frame"),
        (lambda path: mesh(path, centre=(3, 0, 0)), "03_meshes/bunny.ply", "one frame"),
        (lambda path: path.write_text("bunny\nhorse\nbunny\n"), "testset.txt", "'bunny' twice"),
    ],
)
def test_a_bad_file_is_named_with_its_layout_and_harms_no_other_shape(tmp_path, spoil, file, told):
    folder = points2surf(tmp_path)
    spoil(folder / file)
    message = failure(lambda: FamousDataModule("bunny", root=str(tmp_path)))
    assert told in message and str(folder) in message
    assert "expected" in message
    assert FamousDataModule("horse", root=str(tmp_path)).name == "horse"
    assert FamousDataModule.names(str(tmp_path)) == ["bunny", "horse"]


@pytest.mark.parametrize("content", ["", "../../secret\nhorse\n"])
def test_a_bad_list_does_not_stop_the_shapes_that_are_there(tmp_path, content):
    folder = points2surf(tmp_path)
    (folder / "testset.txt").write_text(content)
    part = layouts.points2surf(tmp_path, "famous_original")
    assert len(part.problems) == 1 and "testset.txt" in part.problems[0]
    assert "horse" in FamousDataModule.names(str(tmp_path))


def test_a_scan_that_the_list_names_and_nobody_has(tmp_path):
    folder = points2surf(tmp_path)
    (folder / "04_pts/bunny.xyz.npy").unlink()
    part = layouts.points2surf(tmp_path, "famous_original")
    assert [scan.name for scan in part.scans] == ["horse"]
    assert "bunny.xyz.npy: is missing" in part.problems[0]


@pytest.mark.parametrize(
    ("scale", "shift", "noise", "together"),
    [(1, 0, 0, True), (1, 0, 0.05, True), (1.15, 0, 0.01, False), (1 / 1.15, 0, 0.01, False), (1, 0.06, 0.01, False)],
)
def test_a_slightly_wrong_frame_is_told_from_noise(tmp_path, scale, shift, noise, together):
    """Noise is relative to the longest edge; 0.05 is the most that a benchmark has."""
    folder = points2surf(tmp_path)
    shape = trimesh.creation.box((1.0, 0.7, 0.4))
    shape.export(folder / "03_meshes/bunny.ply")
    random = np.random.default_rng(2)
    points = trimesh.sample.sample_surface(shape, 4000, seed=1)[0] * scale + shift
    np.save(folder / "04_pts/bunny.xyz.npy", points + noise * random.normal(size=points.shape))
    if together:
        assert FamousDataModule("bunny", root=str(tmp_path)).reference.faces.shape == (12, 3)
    else:
        assert "scaling by" in failure(lambda: FamousDataModule("bunny", root=str(tmp_path)))


@pytest.mark.parametrize("layout", ["dgp", "capudf", "sap"])
def test_srb_in_the_layouts_of_three_authors(tmp_path, layout):
    """Deep Geometric Prior (scans, clouds as .xyz), CAP-UDF (input, clouds as .ply), Shape As Points (no truth)."""
    folder, inside, ending = {
        "dgp": ("deep_geometric_prior_data", "scans/", ".xyz"),
        "capudf": ("data/srb", "input/", ".ply"),
        "sap": ("data/deep_geometric_prior_data", "", None),
    }[layout]
    scan, truth = ball(radius=40), ball(3000, radius=40, seed=5)
    normals = {name: np.ones(len(scan)) for name in ("nx", "ny", "nz")}
    for name in ("lord_quas", "anchor"):
        cloud(tmp_path / folder / f"{inside}{name}.ply", scan, **normals)
        if ending:
            cloud(tmp_path / folder / f"ground_truth/{name}{ending}", truth)
    assert SRBDataModule.names(str(tmp_path)) == ["anchor", "lord_quas"]
    module = SRBDataModule("lord_quas", str(tmp_path))
    np.testing.assert_allclose(in_world(module), scan, atol=1e-4)
    assert module.reference.vertices is None and module.reference.normals is None
    if ending:
        np.testing.assert_allclose(module.reference.points, truth, atol=1e-6)
    else:
        assert module.reference.points is None and "no ground truth" in module.source
        assert "ground truth not present" in SRBDataModule.missing(str(tmp_path))


def test_scenes_in_the_unit_box_are_brought_back_to_metres(tmp_path):
    """The longest edge of the truth, and the middle of its box, are what the benchmark divides by."""
    truth = mesh(tmp_path / "3dscene/ground_truth/lounge.ply", 3.0, (10, 20, 5))
    middle, longest = truth.bounds.mean(axis=0), np.ptp(truth.bounds, axis=0).max()
    metres = ball(radius=3.0, centre=(10, 20, 5))
    cloud(tmp_path / "3dscene/input/lounge_1000.ply", (metres - middle) / longest)
    np.testing.assert_allclose(in_world(Scene3DDataModule(root=str(tmp_path))), metres, atol=1e-5)
    cloud(tmp_path / "3dscene/input/lounge_1000.ply", metres)
    np.testing.assert_allclose(in_world(Scene3DDataModule(root=str(tmp_path))), metres, atol=1e-5)
    cloud(tmp_path / "3dscene/input/lounge_1000.ply", 100 * metres)
    assert "one frame" in failure(lambda: Scene3DDataModule(root=str(tmp_path)))


def test_scenes_as_arrays(tmp_path):
    (tmp_path / "3dscene/input").mkdir(parents=True)
    for name in ("stonewall", "copyroom"):
        np.save(tmp_path / f"3dscene/input/{name}_1000.xyz.npy", ball())
    assert Scene3DDataModule.names(str(tmp_path)) == ["copyroom", "stonewall"]
    assert "lounge" in Scene3DDataModule.missing(str(tmp_path))


def test_dfaust_of_sap_and_raw(tmp_path):
    frame = "50007/shake_hips/shake_hips.000380"
    mesh(tmp_path / "raw/dfaust/scans" / f"{frame}.ply")
    raw = DFaustDataModule(frame, str(tmp_path / "raw"))
    assert raw.name == frame and raw.reference.points is None and len(raw.shapes[0][0]) == 162
    cloud(tmp_path / "sap/data/dfaust/50002_hips.ply", ball(), **{n: np.ones(400) for n in ("nx", "ny", "nz")})
    mesh(tmp_path / "sap/data/dfaust/ground_truth/50002_hips.ply")
    sap = DFaustDataModule(root=str(tmp_path / "sap"))
    assert sap.name == "50002_hips" and sap.reference.faces.shape == (320, 3)


@pytest.mark.parametrize("place", ["", "data/", "dfaust/"])
def test_dfaust_as_its_owners_ship_it(tmp_path, place):
    mesh(tmp_path / f"{place}scans/50002/hips/hips.000380.ply")
    cloud(tmp_path / "srb/scans/anchor.ply", ball())
    assert DFaustDataModule.names(str(tmp_path)) == ["50002/hips/hips.000380"]
    assert DFaustDataModule(root=str(tmp_path)).name == "50002/hips/hips.000380"


@pytest.mark.parametrize(("shift", "together"), [(1e-6, True), (0.004, True), (0.03, False)])
def test_rounding_is_no_other_frame(tmp_path, shift, together):
    truth = ball(3000, radius=0.5)
    cloud(tmp_path / "srb/ground_truth/anchor.xyz", truth)
    cloud(tmp_path / "srb/scans/anchor.ply", truth[:2000] + [shift, 0, 0])
    if together:
        assert SRBDataModule("anchor", str(tmp_path)).reference.points.shape == (3000, 3)
    else:
        assert "scaling by" in failure(lambda: SRBDataModule("anchor", str(tmp_path)))


def test_kitti_by_frame_number(tmp_path):
    path = tmp_path / "kitti/object/training/velodyne/000007.bin"
    path.parent.mkdir(parents=True)
    points = ball(radius=20)
    np.column_stack([points, np.full(400, 0.5)]).astype("<f4").tofile(path)
    for frame in (7, "000007"):
        np.testing.assert_allclose(in_world(KittiDataModule(frame, root=str(tmp_path))), points, atol=1e-5)
    assert "'000008' is not there; present: 000007" in failure(lambda: KittiDataModule(8, root=str(tmp_path)))
    assert "frame number" in failure(lambda: KittiDataModule(-1, root=str(tmp_path)))
    assert "split" in failure(lambda: KittiDataModule(split="train", root=str(tmp_path)))
    path.write_bytes(path.read_bytes()[:-3])
    assert "expected kitti/object/training" in failure(lambda: KittiDataModule(7, root=str(tmp_path)))


def street(count=5003, seed=3):
    random = np.random.default_rng(seed)
    along = random.uniform(0, 160, count)
    points = np.column_stack([along, random.uniform(-6, 6, count), random.uniform(0, 8, count)])
    turn = np.deg2rad(130)
    return points @ np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]]), along


def test_a_street_is_cut_across_into_equal_counts():
    points, along = street()
    chunks = cut(points, 50)
    assert np.array_equal(np.sort(np.concatenate(chunks)), np.arange(len(points)))
    assert {len(rows) for rows in chunks} == {100, 101}
    middles = [np.median(along[rows]) for rows in chunks]
    assert (np.diff(middles) > 0).all() or (np.diff(middles) < 0).all()
    # A chunk is some 3 m of street; the direction found is not exactly the one it was made with.
    assert max(np.ptp(along[rows]) for rows in chunks) < 6
    for first, second in zip(chunks, cut(points, 50), strict=True):
        assert np.array_equal(first, second)


def test_paris_gives_one_chunk_and_takes_other_streets(tmp_path):
    points, _ = street()
    points += (650_000, 6_860_000, 40)
    cloud(tmp_path / "rueMadame_database/GT_Madame1_2.ply", points, label=np.zeros(len(points), np.int32))
    module = ParisDataModule(chunk=7, chunks=20, root=str(tmp_path))
    assert module.name == "GT_Madame1_2_07of20"
    left = sum(len(rows) for rows in cut(points, 20)[7:8]) - module.left_out[0]
    assert len(module.shapes[0][0]) == left
    cloud(tmp_path / "lille.ply", points)
    other = ParisDataModule(chunk=7, chunks=20, file=str(tmp_path / "lille.ply"))
    np.testing.assert_allclose(in_world(other), in_world(module))
    assert "0 to chunks - 1 = 19" in failure(lambda: ParisDataModule(chunk=20, chunks=20, root=str(tmp_path)))
    assert "too few" in failure(lambda: ParisDataModule(chunks=500, root=str(tmp_path)))
    assert "GT_Madame1_3" in ParisDataModule.missing(str(tmp_path))
