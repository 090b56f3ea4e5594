"""Do two shapes lie in one frame? Where they do not, every number measures that."""

import numpy as np
from numpy.typing import NDArray

from n2n.datamodules.registration import extent, is_moved, middle, positions, same_frame, similarity
from n2n.errors import InputError
from n2n.geometry.reference import Reference

_FEW = 100  # so many points can be moved onto anything
_GAP = 0.05  # of the larger box's longest edge: noise around something flat


def check_overlap(name: str, points: NDArray[np.float64], reference: Reference) -> None:
    """Refuse points that lie wholly beside the reference.

    Args:
        name: What they are, for the message.
        points: (n, 3) world coordinates.
        reference: Cloud or mesh, world coordinates.

    Raises:
        InputError: Their boxes do not overlap.
    """
    truth = positions(reference)
    gap = np.maximum(points.min(axis=0) - truth.max(axis=0), truth.min(axis=0) - points.max(axis=0)).max()
    if gap > _GAP * max(extent(points), extent(truth)):
        raise InputError(f"the {name} lies beside the reference, not on it ({_boxes(points, truth)}); {_ADVICE}")


def misplaced(name: str, points: NDArray[np.float64], reference: Reference) -> str | None:
    """Say how points and reference lie apart in a way that moving, turning or scaling would mend; None if they do not.

    Args:
        name: What the points are.
        points: (n, 3) samples, world coordinates.
        reference: Cloud or mesh, world coordinates.
    """
    if not same_frame(points, reference):
        boxes = _boxes(points, positions(reference))
        return f"the {name} has another size or place than the reference ({boxes}); {_ADVICE}"
    if len(points) < _FEW:
        return None
    fit = similarity(points, reference)
    if not is_moved(fit, reference):
        return None
    change = f"scaled by {fit.scale:.3f} and moved by {fit.shift:.2g}"
    share = fit.after / fit.before
    return f"{change}, the {name} would lie at {share:.2g} of its distance to the reference; {_ADVICE}"


_ADVICE = "give all files in the same coordinates"


def _boxes(points: NDArray[np.float64], truth: NDArray[np.float64]) -> str:
    apart = float(np.linalg.norm(middle(points) - middle(truth)))
    return f"longest edges {extent(points):.3g} and {extent(truth):.3g}, middles {apart:.3g} apart"
