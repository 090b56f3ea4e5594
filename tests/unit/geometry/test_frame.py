import numpy as np
import pytest

from n2n.errors import InputError
from n2n.geometry.frame import Frame


def test_utm_coordinates_come_back_to_a_tenth_of_a_micrometre():
    cloud = np.random.default_rng(0).normal(size=(500, 3)) * [40, 30, 5] + [5e5, 5e6, 100]
    frame = Frame.fit([cloud])
    assert np.abs(frame.to_world(frame.to_unit(cloud)) - cloud).max() < 1e-7
    assert np.linalg.norm(frame.to_unit(cloud), axis=1).max() == pytest.approx(1.0)


def test_single_precision_in_between_keeps_a_tenth_of_a_millimetre():
    cloud = np.random.default_rng(0).normal(size=(500, 3)) * [40, 30, 5] + [5e5, 5e6, 100]
    frame = Frame.fit([cloud])
    rounded = frame.to_unit(cloud).astype(np.float32).astype(np.float64)
    assert np.abs(frame.to_world(rounded) - cloud).max() < 1e-4


def test_all_clouds_share_one_frame():
    frame = Frame.fit([np.array([[0.0, 0, 0]]), np.array([[4.0, 0, 0]])])
    assert frame == Frame((2.0, 0.0, 0.0), 2.0)


def test_state_restores_the_frame():
    frame = Frame((1.0, 2.0, 3.0), 4.0)
    assert Frame(**frame.state()) == frame


def test_a_cloud_without_extent_is_refused():
    with pytest.raises(InputError, match="no extent"):
        Frame.fit([np.zeros((5, 3))])
