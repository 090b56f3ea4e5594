"""Light for a picture: two lamps, highlights, darkened creases, a soft shadow on the ground."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from n2n.report.raster import Seen


def _unit(*vector: float) -> NDArray[np.float32]:
    return np.array(vector, np.float32) / np.float32(np.linalg.norm(vector))


KEY = _unit(-0.45, 0.85, 0.62)  # towards the lamp, view coordinates
_FILL = _unit(0.85, 0.10, 0.55)
_HALF = _unit(*(KEY + [0, 0, 1]))
_SHADOW = 0.34
_CREASE_REACH = (0.006, 0.02, 0.05)  # of the picture's longer side
_CREASE_DEPTH = 0.30


def shade(seen: Seen, shadow: NDArray[np.bool_] | None = None) -> NDArray[np.float32]:
    """Return the lit picture (h, w, 3), 0 to 1, on white; `shadow` (h, w) is the part of the ground in the dark."""
    image = np.ones_like(seen.colour)
    if shadow is not None:
        soft = _blur(shadow.astype(np.float32), 0.012 * max(shadow.shape))
        image *= (1 - _SHADOW * soft)[..., None]
    normal = seen.normal[seen.covered]
    key, fill = np.clip(normal @ KEY, 0, 1), np.clip(normal @ _FILL, 0, 1)
    gloss = np.clip(normal @ _HALF, 0, 1) ** 50
    # The ambient term is brighter for what faces up, as under a sky.
    ambient = 0.36 + 0.10 * normal[:, 1]
    light = (ambient + 0.20 * fill) * creases(seen)[seen.covered] + 0.56 * key
    image[seen.covered] = seen.colour[seen.covered] * light[:, None] + 0.10 * gloss[:, None]
    return np.clip(image, 0, 1)


def creases(seen: Seen) -> NDArray[np.float32]:
    """Return how open each pixel's surroundings are, 0 to 1: it is darker where nearer things stand around it.

    Source: the idea of Luft, Colditz and Deussen 2006, unsharp masking of the depth buffer, at three scales.
    """
    longest = max(seen.depth.shape)
    depth = np.where(seen.covered, seen.depth, 0)
    weight = seen.covered.astype(np.float32)
    openness = np.ones_like(depth)
    for reach in _CREASE_REACH:
        sigma = reach * longest
        nearer = (_blur(depth, sigma) / np.maximum(_blur(weight, sigma), 1e-3) - depth) / (1.5 * sigma)
        # What stands far in front casts no darkness: else silhouettes get a black rim.
        openness -= _CREASE_DEPTH * np.where(nearer < 1, nearer, np.exp(1 - np.maximum(nearer, 1))).clip(0)
    return np.clip(openness, 0.1, 1)


def _blur(image: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Return a Gaussian blur, by three boxes: the cost does not grow with sigma."""
    side = 2 * round(sigma) + 1
    for _ in range(3):
        image = uniform_filter(image, side, mode="nearest")
    return image
