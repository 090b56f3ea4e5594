"""Scores, evaluations and media of fields whose surface is known in closed form."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import torch
import trimesh
from PIL import Image

from n2n.architectures.base import SDF
from n2n.compose import compose
from n2n.config import Config
from n2n.datamodules.observations import ObservationsDataModule
from n2n.errors import ConfigError, SurfaceError
from n2n.evaluation.protocol import load_protocol
from n2n.fitting.fit import FitResult
from n2n.fitting.held_out import HeldOut
from n2n.fitting.prepare import prepare
from n2n.geometry.frame import Frame
from n2n.geometry.reference import Reference
from n2n.metrics.point_mesh import distances_to_mesh
from n2n.tasks.field import Field
from n2n.tracking import media, names
from n2n.tracking.results import check_evaluations, evaluate, results
from n2n.tracking.tracker import track

CENTRE, SCALE = np.array([5.0e5, 4.0e6, 100.0]), 10.0  # as in a map projection, metres


def directions(count, seed):
    return unit_vectors(np.random.default_rng(seed).normal(size=(count, 3)))


def unit_vectors(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


@pytest.fixture(scope="module")
def sphere():
    """A field of a sphere, and its radius in world units."""
    config = compose(["evaluate=[denoise/sbp]"])
    config["architecture"] |= {"voxel": 0.05, "lower": [-1.0] * 3, "upper": [1.0] * 3}
    report = {"noise": [0.5], "spacing": [0.2], "iterations": 7}
    return Field(Sphere(0.6), [Frame(tuple(CENTRE), SCALE)], config, report), 6.0


class Sphere(SDF):
    """The signed distance of a sphere; without a zero where the radius is negative."""

    def __init__(self, radius):
        super().__init__()
        self.radius = torch.nn.Parameter(torch.tensor(radius))

    def forward(self, points, condition=None):
        return points.norm(dim=-1) - self.radius


class Bumpy(Sphere):
    """A sphere with waves that are finer than the noise."""

    def __init__(self, radius, height):
        super().__init__(radius)
        self.height = height

    def forward(self, points, condition=None):
        return super().forward(points) + self.height * torch.sin(60 * points).prod(dim=-1)


class Folded(Sphere):
    """Three spheres, one within the other, where one would do."""

    def forward(self, points, condition=None):
        height = super().forward(points)
        return height * (height.square() / 0.026**2 - 1)


def scored(field, held_out, noise):
    """Score a field by points whose lines go through the middle of the sphere."""
    frames = field.frames * len(held_out)
    unseen = [HeldOut(p, unit_vectors(p - CENTRE), sigma) for p, sigma in zip(held_out, noise, strict=True)]
    return Field.of(FitResult(field.sdf, frames, field.config, {"noise": noise}, unseen)).report


def test_held_out_points_score_by_their_distance_to_the_surface(sphere):
    field, radius = sphere
    inner, outer = (CENTRE + (radius + offset) * directions(500, 0) for offset in (-0.3, 0.5))
    report = scored(field, [np.concatenate([inner, outer])], [0.8])
    assert report["validation"] == pytest.approx(0.4, rel=0.01)
    assert report["validation_relative"] == pytest.approx(0.5, rel=0.01)
    # A network of two shapes has two surfaces and two noises.
    pair = scored(field, [inner, outer], [0.3, 0.25])
    assert pair["validation_relative"] == pytest.approx((1 + 2) / 2, rel=0.01)
    assert "validation" not in scored(field, [np.empty((0, 3))], [0.8])


def test_a_surface_that_follows_noise_is_nearer_to_all_points_and_scores_worse(sphere):
    field, radius = sphere
    noise = 0.02 * field.frames[0].scale
    points = CENTRE + (radius + np.random.default_rng(0).normal(0, noise, (2000, 1))) * directions(2000, 1)
    unit = field.sdf.radius.item()
    sdfs = [field.sdf, *(Bumpy(unit, height) for height in (0.02, 0.03, 0.045)), Folded(unit)]
    nearest, scores = [], []
    for one in (Field(sdf, field.frames, field.config) for sdf in sdfs):
        mesh = one.reconstruct()
        nearest.append(distances_to_mesh(points, np.asarray(mesh.vertices), np.asarray(mesh.faces)).mean())
        scores.append(scored(one, [points], [noise])["validation"] / noise)
    smooth, *bumpy, folded = scores
    assert smooth == pytest.approx(0.8, rel=0.05)
    assert nearest[1] < nearest[0] and nearest[-1] < 0.6 * nearest[0]
    assert 1.02 * smooth < bumpy[0] < 0.97 * bumpy[1] < 0.94 * bumpy[2] and folded > 1.2 * smooth


def test_held_out_points_measure_along_the_normal_of_those_that_were_kept():
    truth = directions(5000, 0)
    cloud = truth * (1 + np.random.default_rng(1).normal(0, 0.02, (5000, 1)))
    data, unseen = ObservationsDataModule([[cloud]]).hold_out(0.1, seed=0)
    held_out = HeldOut.of(unseen[0], data.frames[0], prepare(data, compose(["scaffold=false"]))[0])
    cosine = np.abs((held_out.directions * unit_vectors(held_out.points)).sum(axis=1))
    assert len(cosine) == 500 and np.median(cosine) > 0.99 and np.quantile(cosine, 0.05) > 0.95


def test_a_field_without_a_surface_is_no_good_score(sphere):
    field, _ = sphere
    with pytest.raises(SurfaceError):
        scored(Field(Sphere(-0.1), field.frames, field.config), [CENTRE + directions(9, 0)], [0.5])


def test_points_are_held_out_of_every_observation():
    clouds = [directions(count, count) for count in (100, 201)]
    data = ObservationsDataModule([clouds, [clouds[0]]])
    rest, held_out = data.hold_out(0.1, seed=3)
    assert [[len(cloud) for cloud in shape] for shape in rest.shapes] == [[90, 181], [90]]
    assert [len(points) for points in held_out] == [10 + 20, 10] and rest.frames == data.frames
    assert [[len(cloud) for cloud in shape] for shape in data.shapes] == [[100, 201], [100]]
    both = np.concatenate([rest.frames[0].to_world(torch.cat(rest.shapes[0]).double().numpy()), held_out[0]])
    whole = np.concatenate(clouds)
    order = [np.lexsort(points.round(5).T) for points in (both, whole)]
    np.testing.assert_allclose(both[order[0]], whole[order[1]], atol=1e-6)
    again, other = (data.hold_out(0.1, seed)[1][0] for seed in (3, 4))
    assert np.array_equal(held_out[0], again) and not np.array_equal(held_out[0], other)
    assert data.hold_out(0.0, 3)[0] is data and data.hold_out(1e-6, 3)[1][0].shape == (2, 3)


def test_held_out_points_take_no_part(tmp_path):
    """Moving them far off changes the score and nothing of the fit."""
    from n2n.fitting.fit import fit

    settings = ["iterations=2", "plan_reuse=1", "scaffold=false", "redistance=false", "logger=none", "device=cpu"]
    config = compose([*settings, "terms.scaffold=null", "terms.far_field=null", "validation=0.25"])
    cloud = directions(400, 0) + np.random.default_rng(1).normal(scale=0.01, size=(400, 3))
    first = ObservationsDataModule([[cloud]])
    chosen = np.random.default_rng([0, 0, 0, 0, 2]).choice(len(first.shapes[0][0]), 100, replace=False)
    second = ObservationsDataModule([[cloud]])
    second.shapes[0][0][torch.as_tensor(chosen)] *= 1.3
    fields = [fit(data, config) for data in (first, second)]
    one, two = (result.field.state_dict() for result in fields)
    assert all(torch.equal(one[key], two[key]) for key in one)
    assert not np.allclose(fields[0].held_out[0].points, fields[1].held_out[0].points)


def test_evaluations_are_those_of_the_protocol(sphere, tmp_path):
    field, radius = sphere
    clean = CENTRE + radius * directions(300, 1)
    noisy = CENTRE + (radius + 0.1) * directions(300, 1)
    shape = trimesh.creation.icosphere(3, radius)
    reference = Reference(clean, None, shape.vertices + CENTRE, shape.faces)
    data = SimpleNamespace(noisy=noisy, reference=reference)
    found = evaluate(field, data, ["denoise/sbp", "reconstruct/sap"])
    alone = load_protocol("sbp").evaluate(field.denoise(noisy), reference, noisy)
    assert found["denoise/sbp"]["values"] == alone.values and found["denoise/sbp"]["floors"] == alone.floors
    assert found["reconstruct/sap"]["values"]["watertight"] == 1
    logged = results(field, found, 3.0)
    assert logged["denoise/sbp/cd_sum2"] == alone.values["cd_sum2"]
    assert (logged[names.NOISE], logged[names.SECONDS]) == (0.5, 3.0)
    assert logged[names.VOXEL] == pytest.approx(0.05 * SCALE)
    assert evaluate(field, SimpleNamespace(noisy=noisy), ["denoise/sbp"]) == {}
    with track({**field.config, "logger": {}}, tmp_path) as tracker:
        remark = tracker.finish(field, SimpleNamespace(noisy=noisy), 3.0)
    assert "no reference" in remark
    assert json.loads((tmp_path / "evaluation.json").read_text()) == {"validation": None, "evaluations": {}}


def test_media_show_surface_and_errors_of_shapes_far_from_the_origin(sphere, tmp_path):
    field, radius = sphere
    noisy = CENTRE + (radius + 0.05) * directions(30_000, 2)
    true_radius = radius - 0.25
    shape = trimesh.creation.icosphere(5, true_radius)
    reference = Reference(None, None, shape.vertices + CENTRE, shape.faces)
    shown = media.draw_media(field, SimpleNamespace(noisy=noisy, reference=reference), tmp_path)
    mesh = trimesh.load(tmp_path / "media" / "mesh.glb", force="mesh")
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), radius, atol=0.01)
    with np.load(tmp_path / "media" / "points.npz") as stored:
        points, error, centre = stored["points"], stored["error"], stored["centre"]
    assert points.dtype == error.dtype == np.float32 and points.shape == (20_000, 3)
    np.testing.assert_allclose(centre, CENTRE)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), radius, atol=0.01)
    np.testing.assert_allclose(error, 0.25, atol=0.015)
    with Image.open(shown.picture) as picture:
        assert picture.mode == "P" and len(picture.getcolors()) > 100
    assert shown.colours.shape == (20_000, 3)
    assert (tmp_path / "media" / "mesh.glb").stat().st_size < 2e6
    unknown = media.draw_media(field, SimpleNamespace(noisy=noisy), tmp_path)
    assert unknown.error is None and "error" not in np.load(tmp_path / "media" / "points.npz")


@pytest.mark.parametrize("setting", ["evaluate=[denoise]", "evaluate=[paint/sbp]", "validation=0.6", "validation=-1"])
def test_settings_that_cannot_be_used_are_refused(setting):
    with pytest.raises(ConfigError, match=setting.split("=")[0]):
        compose([setting])


def test_an_unknown_protocol_is_refused_before_the_fit():
    assert Config().evaluate == [] and check_evaluations(["denoise/sbp"]) is None
    with pytest.raises(ConfigError, match="spb"):
        check_evaluations(["denoise/spb"])
