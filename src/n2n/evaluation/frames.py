"""Frames of measurement: the coordinates in which a protocol's numbers are lengths."""

import numpy as np
from numpy.typing import NDArray

from n2n.errors import InputError
from n2n.geometry.frame import Frame

_Points = NDArray[np.float64]


def sphere(outline: _Points, samples: _Points) -> Frame:
    """Centre the outline's box, scale its farthest point to radius 1.

    Source: score-denoise, models/utils.py:49-62.
    """
    return Frame.fit([outline])


def cube(outline: _Points, samples: _Points) -> Frame:
    """Centre the outline's box, scale its longest edge to 1.

    Source: Occupancy Networks, scripts/sample_mesh.py:89-101; Points2Surf, make_dataset.py:71-88.
    """
    lower, upper = outline.min(axis=0), outline.max(axis=0)
    return _frame((lower + upper) / 2, float((upper - lower).max()))


def deviation(outline: _Points, samples: _Points) -> Frame:
    """Divide by the largest coordinate's deviation from the samples' mean; nothing is shifted.

    Source: CAP-UDF, evaluation/srb/eval_mesh.py:45-49, after issue 5 of Shape As Points.
    """
    return _frame(np.zeros(3), float(np.abs(samples - samples.mean(axis=0)).max()))


def world(outline: _Points, samples: _Points) -> Frame:
    """Leave coordinates as they are in the files."""
    return Frame((0.0, 0.0, 0.0), 1.0)


FRAMES = {"sphere": sphere, "cube": cube, "deviation": deviation, "world": world}
"""Name -> function of the reference's outline (mesh vertices, or all points) and samples, both (n, 3) world points."""


def _frame(centre: _Points, scale: float) -> Frame:
    if not 0 < scale < np.inf:
        raise InputError("the reference has no extent: all its points are equal; give a cloud or mesh of a surface")
    return Frame(tuple(float(c) for c in centre), scale)
