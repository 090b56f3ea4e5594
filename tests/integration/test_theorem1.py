"""Theorem 1, run: scipy judges what examples/theorem1.py optimised."""

import runpy
from pathlib import Path

import pytest
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from n2n.geometry.shapes import sample_surface

EXAMPLE = runpy.run_path(str(Path(__file__).parents[2] / "examples" / "theorem1.py"))


def matched_distance(first, second):
    cost = cdist(first, second)
    return cost[linear_sum_assignment(cost)].mean()


@pytest.fixture(scope="module")
def problem():
    clean = sample_surface("torus", 250, seed=5)
    return clean, EXAMPLE["observe"](clean, 0.03, 40, seed=6)


def test_emd_recovers_the_clean_cloud_and_chamfer_does_not(problem):
    clean, observations = problem
    noisy = matched_distance(observations[0].numpy(), clean)
    under_emd = matched_distance(EXAMPLE["optimise"]("emd", observations), clean)
    under_cd = matched_distance(EXAMPLE["optimise"]("cd", observations), clean)
    assert under_emd < 0.25 * noisy
    assert under_cd > noisy


def test_more_observations_are_cleaner(problem):
    clean, observations = problem
    few, many = (matched_distance(EXAMPLE["optimise"]("emd", observations[:n]), clean) for n in (4, 40))
    assert many < 0.6 * few


def test_the_picture_is_drawn(problem, tmp_path):
    clean, observations = problem
    path = tmp_path / "new" / "theorem1.png"
    EXAMPLE["draw"](path, clean, {"a": observations[0].numpy().astype(float), "b": clean})
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
