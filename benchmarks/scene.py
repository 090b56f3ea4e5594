"""The work that is measured: generated scans, and fits stopped where the training would begin."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from unittest import mock

import lightning as L
import numpy as np
import torch

from n2n.compose import compose
from n2n.datamodules.generated import GeneratedDataModule
from n2n.datamodules.observations import ObservationsDataModule
from n2n.fitting.fit import fit
from n2n.fitting.module import FitModule
from n2n.fitting.objective import Block
from n2n.geometry.shapes import scan

SHAPE = "bracket"
NOISE = 0.01


def write_scans(folder: Path, points: int, observations: int = 1) -> list[Path]:
    """Write scans of the bracket as npy files."""
    paths = []
    for seed in range(observations):
        paths.append(folder / f"scan{points}_{seed}.npy")
        if not paths[-1].exists():
            np.save(paths[-1], scan(SHAPE, points, NOISE, seed))
    return paths


class _EnoughError(Exception):
    """The fit has come as far as it should."""


def at_training(
    points: int,
    train: Callable[[L.Trainer, FitModule, ObservationsDataModule], Any],
    overrides: Sequence[str] = (),
    device: str = "cpu",
    report: Any = None,
) -> Any:
    """Prepare a fit of a scan as `n2n.fitting.fit` does, and let `train` take the place of `Trainer.fit`.

    Returns:
        What `train` returned; the fit ends there.
    """
    results = []

    def instead(trainer: L.Trainer, module: FitModule, data: ObservationsDataModule, *_: Any, **__: Any) -> None:
        results.append(train(trainer, module, data))
        raise _EnoughError

    with mock.patch.object(L.Trainer, "fit", instead), suppress(_EnoughError):
        fit(GeneratedDataModule(SHAPE, points, NOISE), compose([f"device={device}", *overrides]), report=report)
    return results[0]


def first_block(points: int, device: str = "cpu") -> tuple[FitModule, Block]:
    """Return a fit ready to begin, and its first matching."""
    module, data = at_training(points, lambda trainer, module, data: (module, data), device=device)
    module.to(device)
    draw = data.transfer_batch_to_device(next(iter(data.train_dataloader().dataset)), torch.device(device), 0)
    return module, module.objective.begin(module.field, draw, torch.Generator().manual_seed(0))
