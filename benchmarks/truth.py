"""What clean data itself says: exact projection where the truth is a cloud (PC), and how much of ShapeNet is thin.

`python -m benchmarks.truth`, with N2N_DATA; some minutes.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from n2n.datamodules.pointcleannet import PCDataModule
from n2n.datamodules.shapenet import ShapeNetDataModule
from n2n.geometry.local_fit import project_to_quadric
from n2n.metrics.chamfer import chamfer

_DENSE = 100_000
_NEIGHBOURS = 16  # clean points of a local fit
_ROUNDS = 3  # from three deviations away the first foot point is a rough one
_SIGMA = 0.005  # noise of the ShapeNet protocol, unit cube
_THICKNESS = (1, 2, 3, 4, 6)  # deviations
_ASKED = 3000
_BESIDE = 2.5  # spacings that a point of another sheet may be off the normal
_FLAT = 8e-4  # height within one sheet: the points are float16
_PARALLEL = 0.9  # cosine between the normals of two sides of a board

_Points = NDArray[np.float64]


def thin_shares(points: _Points, normals: _Points, distances: list[float]) -> list[float]:
    """Return the shares of a surface that have another sheet within each distance along the normal, either side.

    Normals serve without their sign: at every place of ShapeNet's benches and tables there are both.

    Args:
        points, normals: (n, 3) clean points and unit normals.
        distances: In the unit of the points, each more than `_FLAT`.
    """
    tree = cKDTree(points)
    asked = np.random.default_rng(0).choice(len(points), min(_ASKED, len(points)), replace=False)
    beside = _BESIDE * np.median(tree.query(points[asked], 2)[0][:, 1])
    nearest = np.full(len(asked), np.inf)
    for row, k in enumerate(asked):
        others = tree.query_ball_point(points[k], np.hypot(max(distances), beside))
        offset = points[others] - points[k]
        height = np.abs(offset @ normals[k])
        aside = np.sqrt(np.maximum((offset**2).sum(1) - height**2, 0))
        parallel = np.abs(normals[others] @ normals[k]) > _PARALLEL
        nearest[row] = height[(aside < beside) & (height > _FLAT) & parallel].min(initial=np.inf)
    return [float((nearest < distance).mean()) for distance in distances]


def main() -> None:
    """Print both."""
    print("PC, noisy points projected onto the clean cloud: CD-sum x 10^4")
    for count in (10_000, 50_000):
        for noise in (0.01, 0.02, 0.03):
            found = {}
            for shape in PCDataModule.names():
                data = PCDataModule(shape, count, noise)
                dense = PCDataModule(shape, count, noise, reference_points=_DENSE).reference.points
                moved, _ = project_to_quadric(cKDTree(dense), data.noisy, _NEIGHBOURS, _ROUNDS)
                found[shape] = 1e4 * chamfer(moved, data.reference.points, 2, "sum")
            each = ", ".join(f"{shape} {value:.3f}" for shape, value in found.items())
            print(f"{count} {noise:g}: {np.mean(list(found.values())):.3f} ({each})", flush=True)
    print(f"ShapeNet, share of the surface with another sheet within {_THICKNESS} deviations of the noise")
    for shape in ShapeNetDataModule.names():
        truth = ShapeNetDataModule(shape).reference
        shares = thin_shares(truth.points, truth.normals, [count * _SIGMA for count in _THICKNESS])
        print(f"{shape}:", *(f"{share:.2f}" for share in shares), flush=True)


if __name__ == "__main__":
    main()
