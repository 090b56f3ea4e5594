import numpy as np
import pytest

from n2n.geometry.frame import Frame
from n2n.tasks.field import Field
from n2n.testing import Ball


@pytest.fixture
def ball():
    """A fitted field that is exactly a sphere of radius 1 around the origin of the world."""
    return Field(Ball(0.5), [Frame((0.0, 0.0, 0.0), 2.0)], {"architecture": {"name": "ball"}, "pulls": 3})


@pytest.fixture
def far_ball():
    """A sphere of radius 20 m around a place in UTM coordinates."""
    return Field(Ball(0.5), [Frame((5e5, 5e6, 100.0), 40.0)], {"architecture": {"name": "ball"}, "pulls": 3})


@pytest.fixture
def noisy():
    """Points around the unit sphere, 5 % off."""
    random = np.random.default_rng(0)
    points = random.normal(size=(400, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True) + 0.05 * random.normal(size=(400, 3))
