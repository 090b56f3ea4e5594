"""Protocols as a whole: frames, floors, blanks, the crop, settings."""

import json
from importlib.metadata import EntryPoint

import numpy as np
import pytest
import trimesh
from scipy.spatial.distance import cdist

from n2n import registry
from n2n.compose import conf_dir
from n2n.errors import ConfigError, InputError
from n2n.evaluation import options
from n2n.evaluation.comparison import crop
from n2n.evaluation.protocol import Protocol, load_protocol
from n2n.geometry.reference import Reference
from n2n.registry import PROTOCOLS

NAMES = sorted(path.stem for path in (conf_dir() / "protocol").glob("*.yaml"))
PAPER = ["neuralpull", "onet", "p2s", "sap", "sbp", "scene3d"]


@pytest.fixture(scope="module")
def ball():
    """A sphere of radius 1: mesh, clean points on the mesh, noisy points."""
    mesh = trimesh.creation.icosphere(subdivisions=3)
    random = np.random.default_rng(0)
    clean, _ = trimesh.sample.sample_surface(mesh, 600, seed=1)
    clean = np.asarray(clean)
    return mesh, clean, clean + 0.03 * random.standard_normal(clean.shape)


def reference_of(mesh=None, points=None, scale=1.0, shift=0.0):
    vertices = None if mesh is None else np.asarray(mesh.vertices) * scale + shift
    return Reference(
        points=None if points is None else points * scale + shift,
        vertices=vertices,
        faces=None if mesh is None else np.asarray(mesh.faces),
    )


def small(name, samples=400):
    """A protocol with fewer samples, so that a test takes no time."""
    protocol = load_protocol(name)
    if protocol.reference["samples"] is not None:
        protocol.reference = {**protocol.reference, "samples": samples}
        protocol.prediction = {**protocol.prediction, "samples": samples}
    return protocol


def test_the_papers_protocols_are_there_with_their_sources():
    assert NAMES == PAPER == PROTOCOLS.names()
    for name in NAMES:
        protocol = load_protocol(name)
        assert protocol.label == name and protocol.sources and protocol.floors and protocol.title


def test_sbp_is_both_directions_in_the_sphere_of_the_clean_cloud(ball):
    mesh, clean, noisy = ball
    result = load_protocol("sbp").evaluate(noisy * 7 + 3, reference_of(mesh, clean, 7.0, 3.0))
    centre = (clean.min(axis=0) + clean.max(axis=0)) / 2
    radius = np.linalg.norm(clean - centre, axis=1).max()
    table = cdist(noisy, clean) / radius
    expected = (table.min(axis=1) ** 2).mean() + (table.min(axis=0) ** 2).mean()
    assert result.values["cd_sum2"] == pytest.approx(expected, rel=1e-9)
    assert result.values["cd_mean2"] == pytest.approx(expected / 2, rel=1e-9)
    assert result.printed("cd_sum2") == pytest.approx(1e4 * expected, rel=1e-9)
    assert result.values["p2m"] == pytest.approx(result.values["p2m_forward"] + result.values["p2m_backward"])


@pytest.mark.parametrize("name", ["onet", "sap", "sbp"])
def test_numbers_do_not_depend_on_the_units_of_the_files(ball, name):
    mesh, clean, _ = ball
    wrong = trimesh.Trimesh(np.asarray(mesh.vertices) * 1.05, mesh.faces, process=False)
    far = trimesh.Trimesh(np.asarray(wrong.vertices) * 250 - 40, mesh.faces, process=False)
    protocol = small(name)
    here, there = (
        protocol.evaluate(wrong, reference_of(mesh, clean)),
        protocol.evaluate(far, reference_of(mesh, clean, 250.0, -40.0)),
    )
    assert there.values == pytest.approx(here.values, rel=1e-7)


@pytest.mark.parametrize(
    ("name", "metric", "power"),
    [("scene3d", "cd_mean1", 1), ("p2s", "cd_sum1", 1), ("p2s", "cd_p2s", 1), ("neuralpull", "cd_mean2", 2)],
)
def test_some_protocols_measure_in_the_units_of_the_files(ball, name, metric, power):
    """Their scripts sample the stored meshes as they are."""
    mesh, _, _ = ball
    protocol = small(name)
    here = protocol.evaluate(mesh, reference_of(mesh)).values[metric]
    large = trimesh.Trimesh(np.asarray(mesh.vertices) * 5, mesh.faces, process=False)
    there = protocol.evaluate(large, reference_of(mesh, None, 5.0)).values[metric]
    assert there == pytest.approx(5**power * here)


def test_turning_a_shape_changes_no_number_of_points2surf():
    """The stored meshes are turned: an axis-aligned box would make the same shape smaller by up to a third."""
    truth = trimesh.creation.box((1.0, 0.6, 0.3)).subdivide_loop(0)
    wrong = truth.copy().apply_scale(1.05)
    turn = trimesh.transformations.rotation_matrix(0.7, (1, 1, 0.3))
    here, there = (
        {name: small(name, 4000).evaluate(mesh, reference_of(mesh=known)).values for name in ("p2s", "neuralpull")}
        for mesh, known in ((wrong, truth), (wrong.copy().apply_transform(turn), truth.copy().apply_transform(turn)))
    )
    assert there["p2s"]["cd_sum1"] == pytest.approx(here["p2s"]["cd_sum1"], rel=1e-6)
    assert there["neuralpull"]["cd_mean2"] == pytest.approx(here["neuralpull"]["cd_mean2"], rel=1e-6)


@pytest.mark.parametrize(
    ("scale", "shift", "told"),
    [
        (1.0, 0.0, None),
        (100.0, 0.0, "the prediction has another size or place than the reference (longest edges 19"),
        (0.01, 0.0, "the prediction has another size or place"),
        (1.05, 0.0, "scaled by 0.9"),
        (1.0, 0.1, "scaled by"),
        (1.0, 1.1, "another size or place"),
    ],
)
def test_a_prediction_in_another_frame_is_noted(ball, scale, shift, told):
    mesh, clean, noisy = ball
    notes = load_protocol("sbp").evaluate(clean * scale + shift, reference_of(mesh, clean), noisy).notes
    assert [told in note and "in the same coordinates" in note for note in notes] == ([True] if told else [])


@pytest.mark.parametrize("noise", [0.0, 0.03, 0.1])
def test_noise_is_no_other_frame(ball, noise):
    mesh, clean, _ = ball
    noisy = clean + noise * np.random.default_rng(1).standard_normal(clean.shape)
    assert load_protocol("sbp").evaluate(noisy, reference_of(mesh, clean), noisy).notes == []


def test_the_other_files_are_looked_at_as_well(ball):
    mesh, clean, noisy = ball
    moved = Reference(clean * 1.2, None, np.asarray(mesh.vertices), np.asarray(mesh.faces))
    assert any(note.startswith("scaled by") and "reference cloud" in note for note in evaluate_notes(clean, moved))
    assert any("the noisy cloud" in note for note in evaluate_notes(clean, reference_of(mesh, clean), noisy * 3))


def evaluate_notes(prediction, reference, noisy=None):
    return load_protocol("sbp").evaluate(prediction, reference, noisy).notes


def test_what_lies_wholly_beside_the_reference_is_refused(ball):
    mesh, clean, noisy = ball
    away = mesh.copy().apply_translation((2.5, 0, 0))
    for name, given in (
        ("prediction", (clean + [0, 0, 3], reference_of(mesh, clean))),
        ("noisy cloud", (clean, reference_of(mesh, clean), noisy - 30)),
        ("reference cloud", (np.asarray(away.vertices), reference_of(away, clean))),
    ):
        with pytest.raises(InputError, match=f"the {name} lies beside the reference, .*in the same coordinates"):
            load_protocol("sbp").evaluate(*given)


@pytest.mark.parametrize("name", PAPER)
def test_results_repeat_and_are_plain(ball, name):
    mesh, clean, noisy = ball
    first, second = (small(name).evaluate(mesh, reference_of(mesh, clean), noisy).as_json() for _ in range(2))
    assert first == second == json.loads(json.dumps(first))
    for metric in {**first["values"], **first["blanks"]}:
        assert {"formula", "unit", "factor", "better"} <= set(first["definitions"][metric])


@pytest.mark.parametrize("name", ["onet", "p2s", "neuralpull", "sap", "scene3d"])
def test_the_true_mesh_meets_other_samples_of_itself(ball, name):
    """The same seed on both sides would give distances of zero."""
    mesh, _, _ = ball
    result = small(name).evaluate(mesh, reference_of(mesh))
    key = "cd_sum1" if name == "p2s" else "cd_mean2" if name in ("neuralpull", "scene3d") else "cd_mean1"
    assert result.values[key] > 0
    assert result.values[key] == pytest.approx(result.floors["resample"][key], rel=0.2)


def test_floors_are_measured_like_the_prediction(ball):
    mesh, clean, noisy = ball
    protocol = load_protocol("sbp")
    result = protocol.evaluate(noisy, reference_of(mesh, clean), noisy)
    idle, oracle = result.floors["do_nothing"], result.floors["oracle"]
    assert idle == {key: result.values[key] for key in idle}
    # All pairs of points and triangles.
    corners, repeats = np.asarray(mesh.triangles), len(mesh.faces)
    every = trimesh.triangles.closest_point(np.tile(corners, (len(noisy), 1, 1)), np.repeat(noisy, repeats, axis=0))
    every = every.reshape(len(noisy), repeats, 3)
    choice = np.linalg.norm(every - noisy[:, None], axis=2).argmin(axis=1)
    nearest = every[np.arange(len(noisy)), choice]
    assert oracle == pytest.approx(protocol.evaluate(nearest, reference_of(mesh, clean)).values, rel=1e-6, abs=1e-12)
    assert oracle["p2m_forward"] < 1e-20 < oracle["p2m_backward"]
    assert oracle["cd_sum2"] < result.values["cd_sum2"]


def test_what_is_missing_leaves_blanks_with_reasons(ball):
    mesh, clean, noisy = ball
    protocol = load_protocol("sbp")
    cloud_only = protocol.evaluate(noisy, reference_of(None, clean))
    assert cloud_only.blanks == dict.fromkeys(("p2m", "p2m_forward", "p2m_backward"), "no mesh given")
    assert cloud_only.floor_blanks == {
        "oracle": "no noisy points given",
        "resample": "no mesh given",
        "do_nothing": "no noisy points given",
    }
    mesh_only = protocol.evaluate(noisy, reference_of(mesh))
    assert set(mesh_only.blanks) == {"cd_sum2", "cd_mean2", "hausdorff"}
    assert set(mesh_only.blanks.values()) == {"no clean cloud given"}
    assert small("onet").evaluate(noisy, reference_of(mesh)).blanks["nc"] == "the prediction is points, without normals"
    assert "cd_p2s" in small("p2s").evaluate(noisy, reference_of(mesh)).blanks


def test_any_number_of_points_is_compared(ball):
    mesh, clean, noisy = ball
    result = load_protocol("sbp").evaluate(noisy[:137], reference_of(mesh, clean))
    assert result.samples["prediction"]["points"] == 137 and result.samples["reference"]["points"] == 600


def test_a_mesh_under_sbp_gives_as_many_samples_as_the_clean_cloud(ball):
    mesh, clean, _ = ball
    result = load_protocol("sbp").evaluate(mesh, reference_of(None, clean))
    assert result.samples["prediction"]["points"] == 600
    assert any("sampled" in note for note in result.notes)
    assert result.values["components"] == 1 and result.values["watertight"] == 1
    with pytest.raises(InputError, match="give a clean cloud as reference"):
        load_protocol("sbp").evaluate(mesh, reference_of(mesh))


def test_a_cloud_stands_for_a_mesh_that_is_not_there(ball):
    mesh, clean, _ = ball
    dense = small("sap", 200).evaluate(mesh, reference_of(None, clean))
    assert dense.samples["reference"]["points"] == 200 and set(dense.floors) == {"split"}
    assert not any("split" in note for note in dense.notes)
    thin = small("sap", 1000).evaluate(mesh, reference_of(None, clean))
    assert any("only 600" in note for note in thin.notes) and any("half its density" in note for note in thin.notes)
    assert thin.floors["split"]["cd_mean1"] > 0


def test_stored_points_are_taken_before_a_mesh_under_onet(ball):
    _, clean, _ = ball
    outer = reference_of(trimesh.creation.icosphere(radius=9.0), clean)
    assert small("onet").evaluate(clean, outer).values["cd_mean1"] < 0.05


def test_faces_with_one_far_vertex_are_cropped():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.2]])
    mesh = trimesh.Trimesh(vertices, [[0, 1, 2], [1, 3, 2]], process=False)
    # The box of the cloud is 1 long, so the limit is 0.1; the last vertex is 0.2 away.
    cloud = vertices * [1, 1, 0]
    assert crop(mesh, cloud, 0.1).faces.tolist() == [[0, 1, 2]]
    assert len(crop(mesh, cloud, 0.3).faces) == 2


def test_scene3d_is_measured_without_and_with_the_crop(ball):
    mesh, clean, _ = ball
    away = trimesh.util.concatenate(mesh, trimesh.creation.icosphere(radius=0.5).apply_translation((9, 0, 0)))
    protocol = small("scene3d")
    protocol.crop = 0.2
    result = protocol.evaluate(away, reference_of(mesh), clean)
    assert result.values["cd_mean1_cropped"] < 0.2 < result.values["cd_mean1"]
    assert result.values["components"] == 2
    assert f"the crop keeps {len(mesh.faces):,} of {len(away.faces):,} faces" in result.notes
    assert protocol.evaluate(away, reference_of(mesh)).blanks["nc_cropped"] == "no input cloud given"
    assert protocol.evaluate(clean, reference_of(mesh), clean).blanks["nc_cropped"] == "only a mesh is cropped"
    gone = trimesh.creation.icosphere(radius=0.1)
    assert "no face lies within" in protocol.evaluate(gone, reference_of(mesh), clean).blanks["cd_mean2_cropped"]


@pytest.mark.parametrize(
    ("prediction", "reference", "message"),
    [
        (np.zeros((0, 3)), Reference(points=np.ones((3, 3))), "the prediction has shape"),
        (np.full((4, 3), np.nan), Reference(points=np.ones((3, 3))), "the prediction holds 4 rows that are NaN"),
        (np.ones((4, 3)), Reference(), "the reference is empty"),
        (np.ones((4, 3)), Reference(points=np.ones((3, 3))), "no extent"),
    ],
)
def test_unusable_points_are_refused(prediction, reference, message):
    with pytest.raises(InputError, match=message):
        load_protocol("sbp").evaluate(prediction, reference)


SPEC = {
    "name": "sbp",
    "title": "t",
    "frame": "cube",
    "reference": {"use": "mesh", "sampler": "uniform", "samples": 10},
    "prediction": {"sampler": "uniform", "samples": 10},
    "metrics": {"cd_mean1": 10},
}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frame": "cubes"}, "frame=cubes is not known. Did you mean 'cube'?"),
        ({"metrics": {"cd_men1": 1}}, "metrics=cd_men1 is not known. Did you mean 'cd_mean1'?"),
        ({"metrics": {"fscore": 1}}, "needs its threshold"),
        ({"metrics": {"p2m": 1}}, "needs p2m: frame, min_triangle_area"),
        ({"floors": {"oracel": {}}}, "floors=oracel is not known. Did you mean 'oracle'?"),
        ({"prediction": {"sampler": "evn", "samples": 1}}, "prediction.sampler=evn is not known"),
        ({"reference": {"use": "mesh", "sampler": "even", "samples": None}}, "needs reference.samples"),
        ({"reference": {"use": "mesh"}}, "needs reference.samples"),
        ({"reference": {"use": "mesh", "samples": 3, "sample": 1}}, "reference=sample is not known"),
        ({"treshold": 1}, "no argument 'treshold'. Did you mean 'threshold'?"),
    ],
)
def test_settings_are_checked_when_a_protocol_is_built(change, message):
    with pytest.raises(ConfigError) as caught:
        PROTOCOLS.build({**SPEC, **change})
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_an_unknown_protocol_names_the_nearest():
    with pytest.raises(ConfigError, match=r"Unknown protocol 'spb'. Did you mean 'sbp'\?"):
        load_protocol("spb")


def test_a_plugin_adds_a_protocol(tmp_path, monkeypatch):
    folder = tmp_path / "my_conf" / "protocol"
    folder.mkdir(parents=True)
    (tmp_path / "my_conf" / "__init__.py").touch()
    (folder / "mine.yaml").write_text(json.dumps({**SPEC, "name": "mine", "title": "my own"}))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(options, "entry_points", lambda group: [EntryPoint("mine", "my_conf", group)])
    point = EntryPoint("mine", "n2n.evaluation.protocol:Protocol", "n2n.protocols")
    monkeypatch.setattr(registry, "entry_points", lambda group: [point] if group == "n2n.protocols" else [])
    mine = load_protocol("mine")
    assert isinstance(mine, Protocol) and (mine.label, mine.title) == ("mine", "my own")
    assert load_protocol("sbp").label == "sbp"
