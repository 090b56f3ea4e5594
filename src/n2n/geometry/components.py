"""Connected components of a triangle mesh."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


def drop_small_components(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], fraction: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Remove components with less than `fraction` of the largest one's area, and vertices no face uses.

    Args:
        vertices: (v, 3).
        faces: (f, 3) vertex indices.
        fraction: 0 keeps every component.
    """
    if not len(faces):
        return vertices[:0], faces
    count = len(vertices)
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_matrix((np.ones(len(edges), bool), (edges[:, 0], edges[:, 1])), shape=(count, count))
    label = connected_components(graph, directed=False)[1][faces[:, 0]]
    corner = vertices[faces]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    total = np.bincount(label, weights=area)
    kept = faces[total[label] >= fraction * total.max()]
    used, kept = np.unique(kept, return_inverse=True)
    return vertices[used], kept.reshape(-1, 3)
