"""What `benchmarks.truth` says of surfaces whose thickness is known."""

import numpy as np
import pytest

from benchmarks.truth import thin_shares


def _board(thickness, turned):
    """Points of a horizontal board and their normals, each side's or of any sign."""
    random = np.random.default_rng(0)
    points = random.uniform(size=(20_000, 3))
    top = random.random(len(points)) < 0.5
    points[:, 2] = np.where(top, thickness, 0.0)
    up = random.random(len(points)) < 0.5 if turned else top
    return points, np.where(up, 1.0, -1.0)[:, None] * [0, 0, 1]


@pytest.mark.parametrize("turned", [False, True])
def test_a_board_is_as_thin_as_it_is_whatever_the_sign_of_its_normals(turned):
    below, above = thin_shares(*_board(0.01, turned), [0.009, 0.011])
    assert below == 0 and above > 0.95


def test_a_single_sheet_with_normals_both_ways_is_not_thin():
    assert thin_shares(*_board(0.0, turned=True), [0.005, 0.02]) == [0, 0]
