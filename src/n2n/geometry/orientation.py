"""Consistent orientation of normals by maximising a global dipole energy.

For a closed surface with consistently oriented normals the field of surface dipoles is a gradient field: that of the
indicator function, up to a sign. The energy of a Poisson reconstruction is therefore quadratic in the unknown signs s,

    E(s) = s^T M s,    M_ij = a_i a_j (n_i . n_j - 3 (n_i . r)(n_j . r)) / |p_i - p_j|^3,

r being the unit vector along p_i - p_j,
and largest for consistent signs: neighbours on a sheet attract equal signs, opposite sides of a thin wall opposite
ones. No neighbour graph can leak, every pair counts.

Source: the quadratic form is the screened-Poisson energy of Kazhdan and Hoppe 2013 without the screening; Metzer et al.
    2021 propagate the same dipole field greedily. Differs: the energy itself is maximised, by chains of flips.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
from scipy.spatial import cKDTree
from torch import Tensor

_PATIENCE = 20
_GRAPH_NEIGHBOURS = 10
_APART = 3.0  # weight of what tells two sheets from one
_SHEET, _CURVED = 1.5, 0.25  # blurs, spacings; points closer than that along the normal are on one sheet
_PATCH = 40  # points that flip as one at first
_ROWS = 256  # at a time, of everything against everything: what fits the processor's cache
_TINY = 1e-12


def orient(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    areas: NDArray[np.float64],
    blur: float = 0.0,
    seed: int = 0,
) -> NDArray[np.float64]:
    """Flip normals so that they are consistent; every connected sheet with an inside points outwards.

    Args:
        points: (n, 3) positions close to the surface; cost grows with n^2, n <= 5000 is sensible.
        normals: (n, 3) unit normals of arbitrary sign.
        areas: (n,) surface area each point stands for.
        blur: How far off the surface the points may be; closer pairs than this say little about each other.
        seed: Seed of the stochastic search.

    Returns:
        (n, 3) oriented unit normals.
    """
    generator = np.random.default_rng(seed)
    energy = dipole_energy(points, normals, areas, blur)
    graph = _neighbour_graph(points, normals)
    starts = [_spanning_tree_signs(graph, normals), _leading_eigenvector_signs(energy, generator)]
    patches = _patches(graph, normals)
    between = torch.as_tensor(patches.T @ (patches.T @ energy.numpy()).T).fill_diagonal_(0)
    found = []
    for signs in starts:
        majority = torch.as_tensor(np.where(patches.T @ signs.numpy() >= 0, np.float32(1), np.float32(-1)))
        found.append(torch.as_tensor(patches @ _search(between, majority, generator).numpy()))
    best = _search(energy, max(found, key=lambda signs: float(signs @ (energy @ signs))), generator)
    return _point_outwards(points, normals * best.numpy()[:, None], areas, graph)


def dipole_energy(
    points: NDArray[np.float64], normals: NDArray[np.float64], areas: NDArray[np.float64], blur: float = 0.0
) -> Tensor:
    """Return the symmetric coupling matrix M, (n, n) float32, softened at the scale of point spacing and blur."""
    p, n, a = (torch.as_tensor(x, dtype=torch.float32) for x in (points, normals, areas))
    softening = float(a.median()) + blur**2
    own, flat = (p * n).sum(1), 2 * ((_SHEET * blur) ** 2 + _CURVED**2 * float(a.median()))
    coupling = torch.empty((len(p), len(p)))
    for start in range(0, len(p), _ROWS):
        i = slice(start, start + _ROWS)
        squared = torch.cdist(p[i], p).square_().add_(softening)
        # (p_i - p_j) . n_i and (p_i - p_j) . n_j from matrix products instead of an (n, n, 3) array.
        offset = (own[i, None] - n[i] @ p.T).mul_(p[i] @ n.T - own[None])
        parallel = n[i] @ n.T
        apart = 1 - torch.exp(offset.abs().div_(-flat))
        offset += apart.mul_(parallel).mul_(_APART * softening)
        coupling[i] = (parallel - 3 * offset / squared) * squared.rsqrt().pow_(3) * a[i, None] * a[None]
    coupling.fill_diagonal_(0)
    return coupling


def _neighbour_graph(points: NDArray[np.float64], normals: NDArray[np.float64]) -> sparse.csr_matrix:
    """Return the symmetric k-nearest-neighbour graph; small weights between parallel normals of one sheet."""
    k = min(_GRAPH_NEIGHBOURS, len(points) - 1)
    reach, neighbour = cKDTree(points).query(points, k + 1)
    neighbour, reach = neighbour[:, 1:].ravel(), np.maximum(reach[:, 1:].ravel(), 1e-300)
    source = np.repeat(np.arange(len(points)), k)
    along = points[neighbour] - points[source]
    # A neighbour along the normal is on the other side of a wall.
    across = sum(np.abs((along * normals[end]).sum(axis=1)) for end in (source, neighbour)) / (2 * reach)
    weight = 1.001 - np.abs((normals[source] * normals[neighbour]).sum(axis=1)) + across
    graph = sparse.csr_matrix((weight, (source, neighbour)), shape=(len(points),) * 2)
    return graph.maximum(graph.T)


def _patches(graph: sparse.csr_matrix, normals: NDArray[np.float64]) -> sparse.csr_matrix:
    """Join neighbours, the most parallel first, into patches of a bounded size.

    Returns:
        (n, patches): the sign of each point relative to its patch, one entry a row.
    """
    edges = sparse.triu(graph).tocoo()
    patch, sign = np.arange(len(normals)), np.ones(len(normals), np.float32)
    members = [[point] for point in range(len(normals))]
    for edge in np.argsort(edges.data):
        i, j = edges.row[edge], edges.col[edge]
        into, gone = patch[i], patch[j]
        if into == gone or len(members[into]) + len(members[gone]) > _PATCH:
            continue
        agree = 1.0 if normals[i] @ normals[j] >= 0 else -1.0
        sign[members[gone]] *= agree * sign[i] * sign[j]
        patch[members[gone]] = into
        members[into] += members[gone]
        members[gone] = []
    _, column = np.unique(patch, return_inverse=True)
    return sparse.csr_matrix((sign, (np.arange(len(normals)), column)))


def _spanning_tree_signs(graph: sparse.csr_matrix, normals: NDArray[np.float64]) -> Tensor:
    """Propagate signs along a minimum spanning tree (Hoppe et al. 1992)."""
    tree = minimum_spanning_tree(graph)
    tree = tree + tree.T
    signs = np.zeros(len(normals))
    for root in range(len(normals)):
        if signs[root]:
            continue
        order, parent = breadth_first_order(tree, root, directed=False)
        signs[root] = 1
        for node in order[1:]:
            agree = normals[node] @ normals[parent[node]] >= 0
            signs[node] = signs[parent[node]] if agree else -signs[parent[node]]
    return torch.as_tensor(signs, dtype=torch.float32)


def _leading_eigenvector_signs(energy: Tensor, generator: np.random.Generator) -> Tensor:
    vector = torch.as_tensor(generator.standard_normal(len(energy)), dtype=torch.float32)
    for _ in range(60):
        vector = energy @ vector
        vector /= vector.norm()
    return torch.where(vector >= 0, 1.0, -1.0)


def _iterate_signs(energy: Tensor, signs: Tensor) -> Tensor:
    """Give every point the sign its surroundings ask for, until nothing changes."""
    for _ in range(60):
        updated = torch.where(energy @ signs >= 0, 1.0, -1.0)
        if torch.equal(updated, signs):
            break
        signs = updated
    return signs


def _search(energy: Tensor, signs: Tensor, generator: np.random.Generator) -> Tensor:
    """Flip regions, grown point by point from unstable seeds, while that raises the energy."""
    coupling = energy.numpy()
    current = _iterate_signs(energy, signs).numpy()
    failures = 0
    while failures < _PATIENCE:
        field = coupling @ current
        stability = np.maximum(current * field, 0)
        odds = 1 / (stability + 0.05 * np.median(stability) + 1e-30)
        seed = int(generator.choice(len(current), p=odds / odds.sum()))
        region = _grow_region(coupling, current, field, seed)
        failures = 0 if len(region) else failures + 1
        current[region] *= -1
    return torch.as_tensor(current)


def _grow_region(
    coupling: NDArray[np.float32], signs: NDArray[np.float32], field: NDArray[np.float32], seed: int
) -> list[int]:
    """Flip the seed, then always the point that gains most, through losses too; return the prefix that gained most.

    A wrongly oriented bore or wall is a region whose border costs energy however it moves, until it closes: single
    flips and clusters get stuck there, a chain of flips walks over the barrier.

    Source: Fiduccia and Mattheyses 1982, the same move for graph partitioning.
    """
    signs, field = signs.copy(), field.copy()
    locked = np.zeros(len(signs), np.float32)
    order: list[int] = []
    gained = best = 0.0
    length = 0
    point = seed
    for _ in range(len(signs) // 2):
        gained -= 4 * float(signs[point] * field[point])
        signs[point] = -signs[point]
        field += 2 * signs[point] * coupling[point]
        locked[point] = np.inf
        order.append(point)
        if gained > best + 1e-6 * abs(best) + 1e-9:
            best, length = gained, len(order)
        point = int((-signs * field - locked).argmax())
    return order[:length]


def _point_outwards(
    points: NDArray[np.float64], normals: NDArray[np.float64], areas: NDArray[np.float64], graph: sparse.csr_matrix
) -> NDArray[np.float64]:
    """Choose the remaining sign of every connected part: outwards, or towards the hollow if it lies inside another."""
    _, labels = connected_components(graph, directed=False)
    parts = [np.flatnonzero(labels == label) for label in range(labels.max() + 1)]
    parts.sort(key=lambda part: -np.linalg.norm(np.ptp(points[part], axis=0)))
    oriented = normals.copy()
    for rank, part in enumerate(parts):
        centred = points[part] - points[part].mean(axis=0)
        volume = (areas[part] * (centred * oriented[part]).sum(axis=1)).sum()
        if volume < 0:
            oriented[part] *= -1
        if rank:
            outer = np.concatenate(parts[:rank])
            depth = winding_number(points[part], points[outer], oriented[outer], areas[outer])
            if np.median(depth) > 0.5:
                oriented[part] *= -1
    return oriented


def winding_number(
    queries: NDArray[np.float64],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    areas: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the generalised winding number of oriented points at the queries: about 1 inside, 0 outside.

    Args:
        queries: (q, 3).
        points, normals, areas: (n, 3), (n, 3), (n,), normals outwards.

    Source: Barill et al. 2018, Fast Winding Numbers for Soups and Clouds, Eq. 3 (summed directly).
    """
    centre = points.mean(axis=0)
    p, n, a = (torch.as_tensor(x, dtype=torch.float32) for x in (points - centre, normals, areas))
    # |q - p|^2 + area / 4 and the flux area (p - q) . n / 4 pi are both linear in (q, 1), up to |q|^2.
    squared = torch.cat([-2 * p, (p.square().sum(1) + 0.25 * a)[:, None]], 1).T.contiguous()
    flux = torch.cat([-n, (p * n).sum(1)[:, None]], 1).T * (a / (4 * np.pi))
    nearest = (0.25 * a).clamp_min(_TINY)  # rounding errors of the squares may be larger
    result = np.empty(len(queries))
    for start in range(0, len(queries), _ROWS):
        q = torch.as_tensor(queries[start : start + _ROWS] - centre, dtype=torch.float32)
        ahead = torch.cat([q, torch.ones((len(q), 1))], 1)
        inverse = torch.addmm(q.square().sum(1)[:, None], ahead, squared).clamp_min_(nearest).rsqrt_()
        term = (ahead @ flux).mul_(inverse).mul_(inverse).mul_(inverse)
        result[start : start + _ROWS] = term.sum(1).numpy()
    return result
