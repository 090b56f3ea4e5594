"""A point cloud as it is in a file."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass
class Cloud:
    """Points with their attributes.

    Attributes:
        points: (n, 3) float64, world coordinates.
        attributes: Name -> (n,) or (n, k) array, in file order, dtype kept: colours, reflectance, labels, ...
        meta: What a writer of the same format needs to write the file back as it was (header, delimiter, ...).
    """

    points: NDArray[np.float64]
    attributes: dict[str, NDArray[Any]] = field(default_factory=dict)
    meta: dict[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.points)

    def finite(self) -> NDArray[np.bool_]:
        """Return which rows have finite coordinates, (n,)."""
        return np.isfinite(self.points).all(axis=1)

    def columns(self, texts: bool = False) -> dict[str, NDArray[Any]]:
        """Return the attributes as (n,) columns, (n, k) arrays split into name_0 ... name_(k-1).

        An attribute called like a coordinate gets an underscore. Dates are left out: only .npz holds them.

        Args:
            texts: Whether texts are wanted, too; text files hold them.
        """
        flat = {}
        for name, values in self.attributes.items():
            values = np.asarray(values)
            if values.dtype.kind not in ("biufU" if texts else "biuf"):
                continue
            if values.ndim == 1:
                flat[f"{name}_" if name.lower() in ("x", "y", "z") else name] = values
            else:
                flat.update({f"{name}_{i}": values[:, i] for i in range(values.shape[1])})
        return flat

    def replace(self, points: NDArray[np.float64], rows: NDArray[np.int64] | None = None) -> "Cloud":
        """Return a cloud at new positions.

        Args:
            points: (m, 3) new positions.
            rows: (m,) row of this cloud whose attributes each new point takes; None: the same rows (m = n).
        """
        if rows is None:
            return Cloud(points, dict(self.attributes), dict(self.meta))
        return Cloud(points, {name: values[rows] for name, values in self.attributes.items()}, dict(self.meta))
