"""Queries: where around a noisy cloud the field is asked."""

import torch
from scipy.spatial import cKDTree
from torch import Tensor

from n2n.errors import ConfigError
from n2n.shapes import Points, Values

QUERY_KINDS = ("observation", "neighbour", "jitter")


def neighbour_distance(points: Points, neighbour: int) -> Values:
    """Return the distance of every point to its k-th neighbour, unit coordinates."""
    array = points.cpu().numpy()
    k = min(neighbour, len(array) - 1)
    return torch.as_tensor(cKDTree(array).query(array, k + 1)[0][:, -1], dtype=points.dtype, device=points.device)


class QuerySampler:
    """Draw one query per noisy point.

    Args:
        kind: `observation` (the noisy points themselves: the paper's choice for N > 1), `neighbour` (Gaussian around
            each point, scaled by the distance to its k-th neighbour: NeuralPull's choice, the paper's for N = 1) or
            `jitter` (Gaussian of one deviation everywhere).
        neighbour: k of `neighbour`.
        scale: Factor on the k-th distance, or the deviation of `jitter` in unit coordinates.
        pulls: Times a query is pulled towards the surface before the loss looks at it (the caller does that). The loss
            then no longer depends on how steep f is, and cannot be lowered by leaving noisy points where they are.

    Source: Ma et al. 2023, Sec. 3 and App. B; Ma et al. 2021 (NeuralPull), Sec. 3.
    """

    def __init__(self, kind: str = "observation", neighbour: int = 50, scale: float = 1.0, pulls: int = 0) -> None:
        if kind not in QUERY_KINDS:
            raise ConfigError(f"Unknown queries.kind {kind!r}. Known: {', '.join(QUERY_KINDS)}.")
        self.kind, self.neighbour, self.scale = kind, neighbour, float(scale)
        self.pulls = pulls
        self._deviation: dict[int, Tensor] = {}

    def __call__(self, points: Points, generator: torch.Generator, key: int | None = None) -> Points:
        """Return (n, 3) queries, query k made from point k; `key` names a cloud whose k-th distances may be kept."""
        if self.kind == "observation":
            return points
        noise = torch.randn(points.shape, generator=generator).to(points)
        if self.kind == "jitter":
            return points + self.scale * noise
        deviation = self._deviation.get(key) if key is not None else None
        if deviation is None:
            deviation = neighbour_distance(points, self.neighbour)
            if key is not None:
                self._deviation[key] = deviation
        return points + self.scale * deviation[:, None] * noise
