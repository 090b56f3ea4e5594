"""Local quadric fits: project points onto the surface that their neighbourhood suggests, with a normal."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

_CHUNK = 4096


def project_to_quadric(
    tree: cKDTree, queries: NDArray[np.float64], neighbours: int, iterations: int = 2
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Move queries onto weighted quadric fits of their neighbours (moving least squares of order two).

    Args:
        tree: The noisy cloud.
        queries: (q, 3) positions near it.
        neighbours: Size k >= 10 of a neighbourhood; Gaussian weights fall to 0.01 at the k-th neighbour.
        iterations: Repetitions, each around the previous result.

    Returns:
        Projected positions (q, 3) and unit normals (q, 3) of arbitrary sign.
    """
    position, normal = queries.copy(), np.empty_like(queries)
    neighbours = min(neighbours, tree.n)
    for start in range(0, len(queries), _CHUNK):
        chunk = slice(start, start + _CHUNK)
        for _ in range(iterations):
            position[chunk], normal[chunk] = _project_once(tree, position[chunk], neighbours)
    return position, normal


def _project_once(
    tree: cKDTree, queries: NDArray[np.float64], neighbours: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    distance, index = tree.query(queries, neighbours)
    patch = tree.data[index]
    radius = np.maximum(distance[:, -1:], 1e-300)
    weight = np.exp(-4.5 * (distance / radius) ** 2)
    mean = np.einsum("qk,qki->qi", weight, patch) / weight.sum(axis=1, keepdims=True)
    centred = patch - mean[:, None]
    _, axes = np.linalg.eigh(np.einsum("qk,qki,qkj->qij", weight, centred, centred))
    local = np.einsum("qki,qij->qkj", patch - queries[:, None], axes)
    height, u, v = local[..., 0], local[..., 1] / radius, local[..., 2] / radius
    basis = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    gram = np.einsum("qk,qki,qkj->qij", weight, basis, basis) + 1e-6 * np.eye(6)
    moment = np.einsum("qk,qki,qk->qi", weight, basis, height)
    fit = np.linalg.solve(gram, moment[..., None])[..., 0]
    slope = (fit[:, 1:2] * axes[:, :, 1] + fit[:, 2:3] * axes[:, :, 2]) / radius
    normal = axes[:, :, 0] - slope
    return queries + fit[:, :1] * axes[:, :, 0], normal / np.linalg.norm(normal, axis=1, keepdims=True)
