"""The metrics as torchmetrics: `update` once per shape, `compute` the mean over shapes."""

from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor
from torchmetrics import Metric

from n2n.errors import InputError
from n2n.metrics import chamfer, emd, fscore, hausdorff, normals, point_mesh, sdf_error


class ShapeMean(Metric):
    """Mean over shapes of one or more numbers per shape; subclasses measure one shape in `measure`.

    Calling the metric measures one shape, adds it and returns its value, as every torchmetrics metric does. States add
    up, so shapes may be measured in several processes. Arguments are arrays or tensors; results are float64.
    """

    full_state_update = False
    higher_is_better: bool | None = False
    names: tuple[str, ...] = ()  # of several numbers per shape; without names it is one

    total: Tensor
    shapes: Tensor

    def __init__(self) -> None:
        super().__init__()
        size = (len(self.names),) if self.names else ()
        self.add_state("total", torch.zeros(size, dtype=torch.float64), dist_reduce_fx="sum")
        self.add_state("shapes", torch.zeros((), dtype=torch.float64), dist_reduce_fx="sum")

    def measure(self, *arrays: NDArray[np.float64]) -> Any:
        """Return the numbers of one shape, in the order of `names`."""
        raise NotImplementedError

    def update(self, *arrays: ArrayLike | Tensor) -> None:
        """Measure one shape; the arguments are those of the function behind the metric."""
        self.total += torch.as_tensor(self.measure(*map(_array, arrays)), dtype=torch.float64, device=self.total.device)
        self.shapes += 1

    def compute(self) -> Tensor | dict[str, Tensor]:
        """Return the mean over the shapes seen since `reset`: a number, or a dict of them by name.

        Raises:
            InputError: No shape was seen.
        """
        if not self.shapes:
            raise InputError(f"{type(self).__name__}: no shape was measured yet; call update first")
        mean = self.total / self.shapes
        return dict(zip(self.names, mean, strict=True)) if self.names else mean


class L1Chamfer(ShapeMean):
    """Both directions' mean distances, combined; `update(prediction, truth)`, see `chamfer.chamfer`."""

    p = 1

    def __init__(self, combine: str = "mean") -> None:
        chamfer.check_chamfer(self.p, combine)
        super().__init__()
        self.combine = combine

    def measure(self, prediction: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
        return chamfer.chamfer(prediction, truth, self.p, self.combine)


class L2Chamfer(L1Chamfer):
    """Both directions' mean squared distances, combined; `update(prediction, truth)`, see `chamfer.chamfer`."""

    p = 2


class Hausdorff(ShapeMean):
    """Largest distance to the nearest point, both directions; `update(prediction, truth)`."""

    def measure(self, prediction: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
        return hausdorff.hausdorff(prediction, truth)


class FScore(ShapeMean):
    """F-score, precision and recall; `update(prediction, truth)`.

    Args:
        threshold: Largest distance that counts, unit of the coordinates.
    """

    higher_is_better = True
    names = ("fscore", "precision", "recall")

    def __init__(self, threshold: float = 0.01) -> None:
        fscore.check_threshold(threshold)
        super().__init__()
        self.threshold = threshold

    def measure(self, prediction: NDArray[np.float64], truth: NDArray[np.float64]) -> fscore.FScore:
        return fscore.fscore(*chamfer.directions(prediction, truth), self.threshold)


class NormalConsistency(ShapeMean):
    """Agreement of normals at nearest points; `update(pred_pts, pred_normals, ref_pts, ref_normals)`.

    Args:
        inflated: The released code's variant, see `normals.normal_consistency`.
    """

    higher_is_better = True

    def __init__(self, inflated: bool = False) -> None:
        super().__init__()
        self.inflated = inflated

    def measure(self, *arrays: NDArray[np.float64]) -> float:
        return normals.normal_consistency(*arrays, inflated=self.inflated)


class PointToMesh(ShapeMean):
    """P2M and its two directions; `update(points, vertices, faces)`.

    Args:
        min_triangle_area: The guard of pytorch3d, see `point_mesh.point_to_mesh`.
    """

    names = ("p2m", "p2m_forward", "p2m_backward")

    def __init__(self, min_triangle_area: float = 0.0) -> None:
        super().__init__()
        self.min_triangle_area = min_triangle_area

    def measure(
        self, points: NDArray[np.float64], vertices: NDArray[np.float64], faces: NDArray[np.float64]
    ) -> tuple[float, float, float]:
        found = point_mesh.point_to_mesh(points, vertices, faces.astype(np.int64), self.min_triangle_area)
        return found.total, found.forward, found.backward


class EMD(ShapeMean):
    """Mean distance of the best one-to-one matching; `update(prediction, truth)`.

    Args:
        p: Exponent of the distances, 1 or 2.
    """

    def __init__(self, p: int = 1) -> None:
        emd.check_exponent(p)
        super().__init__()
        self.p = p

    def measure(self, prediction: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
        return emd.emd(prediction, truth, self.p)


class SDFError(ShapeMean):
    """Errors of a signed distance; `update(predicted, true)`.

    Args:
        band: Queries at most this far from the true surface count.
    """

    names = sdf_error.SDFErrors._fields

    def __init__(self, band: float = float("inf")) -> None:
        sdf_error.check_band(band)
        super().__init__()
        self.band = band

    def measure(self, predicted: NDArray[np.float64], true: NDArray[np.float64]) -> sdf_error.SDFErrors:
        return sdf_error.sdf_error(predicted, true, self.band)


def _array(values: ArrayLike | Tensor) -> NDArray[np.float64]:
    return np.asarray(values.detach().cpu() if isinstance(values, Tensor) else values, np.float64)
