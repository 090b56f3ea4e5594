"""What clean data itself says: exact projection where the truth is a cloud (PC), and how much of ShapeNet is thin.

`python -m benchmarks.truth`, with N2N_DATA; some minutes.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from n2n.datamodules.pointcleannet import PCDataModule
from n2n.datamodules.shapenet import ShapeNetDataModule
from n2n.metrics.chamfer import chamfer

_DENSE = 100_000
_PLANE = 8  # clean points that make a plane
_EDGE = 0.02  # radii; further from their centre a plane has passed an edge
_SIGMA = 0.005  # noise of the ShapeNet protocol, unit cube
_ASKED = 3000

_Points = NDArray[np.float64]


def project(points: _Points, clean: _Points) -> _Points:
    """Move points (n, 3) onto the plane of the clean points (m, 3) around their nearest; beyond an edge, to that."""
    tree = cKDTree(clean)
    nearest = clean[tree.query(points)[1]]
    around = clean[tree.query(nearest, _PLANE)[1]]
    centre = around.mean(1)
    offset = around - centre[:, None]
    normal = np.linalg.eigh(np.einsum("nki,nkj->nij", offset, offset))[1][:, :, 0]
    moved = points - ((points - centre) * normal).sum(1, keepdims=True) * normal
    passed = np.linalg.norm(moved - centre, axis=1) > _EDGE
    moved[passed] = nearest[passed]
    return moved


def thin_share(points: _Points, normals: _Points, distance: float) -> float:
    """Return the share of clean points (n, 3) that have one within `distance` whose normal points the other way."""
    asked = np.random.default_rng(0).choice(len(points), min(_ASKED, len(points)), replace=False)
    near = cKDTree(points).query_ball_point(points[asked], distance)
    return float(np.mean([(normals[others] @ normals[k] < -0.5).any() for k, others in zip(asked, near, strict=True)]))


def main() -> None:
    """Print both."""
    print("PC, noisy points projected onto the clean cloud: CD-sum x 10^4")
    for count in (10_000, 50_000):
        for noise in (0.01, 0.02, 0.03):
            found = {}
            for shape in PCDataModule.names():
                data = PCDataModule(shape, count, noise)
                dense = PCDataModule(shape, count, noise, reference_points=_DENSE).reference.points
                found[shape] = 1e4 * chamfer(project(data.noisy, dense), data.reference.points, 2, "sum")
            each = ", ".join(f"{shape} {value:.3f}" for shape, value in found.items())
            print(f"{count} {noise:g}: {np.mean(list(found.values())):.3f} ({each})", flush=True)
    print("ShapeNet, share of the surface whose other side is less than one deviation of the noise away")
    for shape in ShapeNetDataModule.names():
        truth = ShapeNetDataModule(shape).reference
        print(f"{shape}: {thin_share(truth.points, truth.normals, _SIGMA):.2f}", flush=True)


if __name__ == "__main__":
    main()
