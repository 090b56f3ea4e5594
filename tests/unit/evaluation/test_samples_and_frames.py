"""Samples lie on their faces and depend on the seed alone; frames are what their sources compute."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.distance import pdist

from n2n.errors import InputError
from n2n.evaluation.frames import FRAMES
from n2n.evaluation.samples import SAMPLERS, draw, take

BOX = trimesh.creation.box((1.0, 2.0, 3.0))
VERTICES, FACES = np.asarray(BOX.vertices), np.asarray(BOX.faces)


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_samples_lie_on_the_surface_and_repeat(sampler):
    samples = draw(VERTICES, FACES, 2000, sampler, 5)
    wall = np.abs(np.abs(samples.points) - [0.5, 1.0, 1.5])
    assert wall.min(axis=1).max() < 1e-12
    assert np.array_equal(samples.points, draw(VERTICES, FACES, 2000, sampler, 5).points)
    assert not np.isin(samples.points, draw(VERTICES, FACES, 2000, sampler, 6).points).all(axis=1).any()


@pytest.mark.parametrize("sampler", ["uniform", "even"])
def test_normals_are_those_of_the_faces(sampler):
    samples = draw(VERTICES, FACES, 500, sampler, 0)
    axis = np.abs(np.abs(samples.points) - [0.5, 1.0, 1.5]).argmin(axis=1)
    outward = np.zeros_like(samples.points)
    rows = np.arange(len(axis))
    outward[rows, axis] = np.sign(samples.points[rows, axis])
    assert np.abs(samples.normals - outward).max() < 1e-12


def test_uniform_samples_are_shared_out_by_area():
    points = draw(VERTICES, FACES, 40_000, "uniform", 1).points
    top = (np.abs(np.abs(points[:, 2]) - 1.5) < 1e-9).mean()
    assert top == pytest.approx(4 / 22, abs=0.01)


def test_even_samples_keep_their_distance():
    points = draw(VERTICES, FACES, 2000, "even", 1).points
    assert pdist(points).min() >= np.sqrt(22 / 6000)
    assert 0.9 * 2000 < len(points) <= 2000


def test_a_cloud_is_cut_without_repetition_and_keeps_its_normals():
    points = np.arange(300.0).reshape(100, 3)
    cut = take(points, points, 30, 2)
    assert len(np.unique(cut.points, axis=0)) == 30
    assert np.allclose(cut.normals, cut.points / np.linalg.norm(cut.points, axis=1, keepdims=True))
    assert np.array_equal(take(points, None, 200, 2).points, points)
    assert np.array_equal(take(points, None, None, 2).points, points)


def test_a_mesh_without_area_is_refused():
    with pytest.raises(InputError, match="no area"):
        draw(np.zeros((3, 3)), np.array([[0, 1, 2]]), 10, "uniform", 0)


OUTLINE = np.array([[0.0, 0, 0], [4, 2, 0], [1, 1, 2]])


@pytest.mark.parametrize(
    ("name", "centre", "scale"),
    [
        ("sphere", (2, 1, 1), np.sqrt(6)),
        ("cube", (2, 1, 1), 4.0),
        # The mean of the samples is (2, 0, 0); the coordinate farthest from it is y = -7.
        ("deviation", (0, 0, 0), 7.0),
        ("world", (0, 0, 0), 1.0),
    ],
)
def test_frames_by_hand(name, centre, scale):
    samples = np.array([[1.0, 7, 0], [3, -7, 0]])
    frame = FRAMES[name](OUTLINE, samples)
    assert frame.centre == pytest.approx(centre) and frame.scale == pytest.approx(scale)


@pytest.mark.parametrize("name", ["sphere", "cube", "deviation"])
def test_a_reference_without_extent_is_refused(name):
    with pytest.raises(InputError, match="no extent"):
        FRAMES[name](np.ones((5, 3)), np.ones((5, 3)))
