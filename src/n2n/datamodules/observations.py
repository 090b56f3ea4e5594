"""The data of a fit: noisy observations of one or several shapes, in unit coordinates, drawn in pairs."""

import copy
import hashlib
from dataclasses import dataclass
from typing import Any

import lightning as L
import numpy as np
import torch
from numpy.typing import NDArray
from torch.utils.data import DataLoader, IterableDataset

from n2n.errors import InputError
from n2n.geometry.frame import Frame
from n2n.geometry.outliers import first_of_equal, outliers_of_each

# Follows the seed, so that no other draw of the fit repeats this one.
_HELD_OUT = (0, 2)


@dataclass
class Draw:
    """One pair (i, j) of observations of one shape (Eq. 5).

    Attributes:
        source, target: N_i and N_j, (n, 3) unit coordinates; with i = j several observations, merged.
        same: i = j.
        key: Names N_i while it is a single observation, so that what only depends on it is computed once.
        condition: Which shape.
    """

    source: torch.Tensor
    target: torch.Tensor
    same: bool
    key: int | None
    condition: int


class ObservationsDataModule(L.LightningDataModule):
    """Observations held in memory.

    Attributes:
        frames: One world <-> unit map per shape.
        shapes: Per shape its observations, (n_i, 3) float32 unit coordinates; repeated points and outliers left out.
        left_out: Per shape how many points those were.
        outliers: Per shape how many of these look like outliers.

    Args:
        shapes: Per shape its observations, (n_i, 3) float64 world coordinates; point counts may differ.
        num_observations: N, how many observations of each shape to use; None uses all.
    """

    def __init__(self, shapes: list[list[NDArray[np.float64]]], num_observations: int | None = None) -> None:
        super().__init__()
        if not shapes or not all(shapes):
            raise InputError("no observations given; pass at least one noisy point cloud")
        self.frames, self.shapes, self.left_out, self.outliers = [], [], [], []
        for clouds in shapes:
            used = clouds if num_observations is None else clouds[:num_observations]
            if num_observations is not None and len(used) < num_observations:
                raise InputError(
                    f"num_observations={num_observations}, but only {len(used)} given; add observations or lower it"
                )
            # Each by itself: next to a denser or cleaner observation all points of another would look like outliers.
            stray = outliers_of_each(used)
            kept = [cloud[first_of_equal(cloud) & ~out] for cloud, out in zip(used, stray, strict=True)]
            self.left_out.append(sum(map(len, used)) - sum(map(len, kept)))
            self.outliers.append(int(sum(out.sum() for out in stray)))
            used = kept
            frame = Frame.fit(used)
            self.frames.append(frame)
            self.shapes.append([torch.as_tensor(frame.to_unit(c), dtype=torch.float32) for c in used])
        self._blocks: dict[str, Any] = {"pairs": "random", "points": 1, "seed": 0}

    def hold_out(self, share: float, seed: int) -> tuple["ObservationsDataModule", list[NDArray[np.float64]]]:
        """Split points off every observation; which ones depends on the seed alone.

        Args:
            share: Of each observation's points, 0 to 1; at least one point of each if above 0.
            seed: Of the choice.

        Returns:
            The data without these points, in the same frames, and per shape these points (n, 3), world coordinates.
        """
        if not share:
            return self, [np.empty((0, 3)) for _ in self.shapes]
        shapes, held_out = [], []
        for condition, (frame, clouds) in enumerate(zip(self.frames, self.shapes, strict=True)):
            kept, taken = [], []
            for index, cloud in enumerate(clouds):
                random = np.random.default_rng([seed, condition, index, *_HELD_OUT])
                chosen = np.zeros(len(cloud), bool)
                chosen[random.choice(len(cloud), max(1, round(share * len(cloud))), replace=False)] = True
                kept.append(cloud[torch.as_tensor(~chosen)])
                taken.append(cloud[torch.as_tensor(chosen)].double().numpy())
            shapes.append(kept)
            held_out.append(frame.to_world(np.concatenate(taken)))
        return self.only(shapes), held_out

    def only(self, shapes: list[list[torch.Tensor]]) -> "ObservationsDataModule":
        """Return these observations of the same shapes, unit coordinates, in the same frames."""
        other = copy.copy(self)
        other.shapes = shapes
        return other

    def configure_draws(self, pairs: str, points: int, seed: int, first: int = 0, step: int = 1) -> None:
        """Say how pairs are drawn.

        Args:
            pairs: `random` (i and j independent, as in Eq. 5) or `same` (i = j).
            points: With i = j, observations are merged until a draw holds this many points.
            seed: Of the draws.
            first: Iteration to start at (a resumed fit).
            step: Iterations per draw.
        """
        self._blocks = {"pairs": pairs, "points": points, "seed": seed, "first": first, "step": step}

    def fingerprint(self) -> str:
        """Return 16 hex digits that name the data by content."""
        digest = hashlib.sha256()
        for frame, clouds in zip(self.frames, self.shapes, strict=True):
            digest.update(repr((frame, [len(cloud) for cloud in clouds])).encode())
            for cloud in clouds:
                digest.update(cloud.numpy().tobytes())
        return digest.hexdigest()[:16]

    def train_dataloader(self) -> DataLoader:
        return DataLoader(_Draws(self.shapes, **self._blocks), batch_size=None)

    def transfer_batch_to_device(self, batch: Draw, device: torch.device, dataloader_idx: int) -> Draw:
        batch.source, batch.target = batch.source.to(device), batch.target.to(device)
        return batch


class _Draws(IterableDataset):
    """An endless stream of draws; the draw at iteration t depends on the seed and t alone."""

    def __init__(
        self, shapes: list[list[torch.Tensor]], pairs: str, points: int, seed: int, first: int = 0, step: int = 1
    ) -> None:
        self.shapes, self.pairs, self.points = shapes, pairs, points
        self.seed, self.first, self.step = seed, first, step

    def __iter__(self):
        iteration = self.first
        while True:
            yield self.draw(iteration)
            iteration += self.step

    def draw(self, iteration: int) -> Draw:
        random = np.random.default_rng([self.seed, iteration])
        condition = int(random.integers(len(self.shapes)))
        clouds = self.shapes[condition]
        merged = self.pairs == "same"
        count = min(len(clouds), -(-self.points // min(map(len, clouds)))) if merged else 1
        first = random.choice(len(clouds), count, replace=False)
        second = first if merged or len(clouds) == 1 else random.choice(len(clouds), 1)
        same = bool((first == second).all())
        source = _merge([clouds[i] for i in first])
        target = source if same else _merge([clouds[j] for j in second])
        key = int(first[0]) + 1_000_000 * condition if count == 1 else None
        return Draw(source, target, same, key, condition)


def _merge(clouds: list[torch.Tensor]) -> torch.Tensor:
    return clouds[0] if len(clouds) == 1 else torch.cat(clouds)
