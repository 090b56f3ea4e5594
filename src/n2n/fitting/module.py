"""The LightningModule: a field, an objective and an optimiser; no maths of its own."""

from collections.abc import Callable
from typing import Any

import lightning as L
import torch
from torch.optim.swa_utils import AveragedModel

from n2n.architectures.base import SDF
from n2n.datamodules.observations import Draw
from n2n.fitting.objective import Objective, diverged


class FitModule(L.LightningModule):
    """Fits one field. One `training_step` is a block: one matching and the optimiser steps that reuse it.

    Args:
        field: The SDF to fit.
        objective: Eq. 7.
        optimizer: Parameters -> torch optimiser.
        scheduler: Optimiser, iterations -> torch scheduler, stepped once per iteration.
        iterations: Optimiser steps of the whole fit.
        plan_reuse: Optimiser steps per matching, >= 1.
        seed: Every block draws from a generator of its own, seeded by this and its first iteration, so a resumed fit
            draws what an undisturbed one would have drawn.
        average_from: Share of the fit from which on the weights are averaged: every matching sees other points, and the
            last one would count most. 1 for never.

    Attributes:
        kept: What checkpoints hold besides; plain values.
    """

    def __init__(
        self,
        field: SDF,
        objective: Objective,
        optimizer: Callable[..., torch.optim.Optimizer],
        scheduler: Callable[..., Any],
        iterations: int,
        plan_reuse: int = 1,
        seed: int = 0,
        average_from: float = 1.0,
    ) -> None:
        super().__init__()
        self.automatic_optimization = False
        self.field, self.objective = field, objective
        self._optimizer, self._scheduler = optimizer, scheduler
        self.iterations, self.plan_reuse, self.seed = iterations, plan_reuse, seed
        self.kept: dict[str, Any] = {}
        self._average_from = average_from
        self._averaged = AveragedModel(field) if average_from < 1 else None

    @property
    def result(self) -> SDF:
        """The field of the averaged weights, where they were averaged."""
        return self._averaged.module if self._averaged is not None and self._averaged.n_averaged else self.field

    def configure_optimizers(self) -> dict[str, Any]:
        optimizer = self._optimizer(self.field.parameters())
        return {"optimizer": optimizer, "lr_scheduler": self._scheduler(optimizer, self.iterations)}

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        checkpoint.update(self.kept)

    def training_step(self, draw: Draw, batch_idx: int) -> None:
        first = self.global_step
        generator = torch.Generator().manual_seed(self.seed * 1_000_003 + first)
        optimizer, scheduler = self.optimizers(), self.lr_schedulers()
        block = self.objective.begin(self.field, draw, generator, first / self.iterations)
        for iteration in range(first, min(first + self.plan_reuse, self.iterations)):
            optimizer.zero_grad()
            with self.field.shared():
                loss, parts = self.objective.loss(self.field, block, iteration / self.iterations, generator)
                self.manual_backward(loss)
            optimizer.step()
            scheduler.step()
            if self._averaged is not None and iteration >= self._average_from * self.iterations:
                self._averaged.update_parameters(self.field)
        if not all(weights.isfinite().all() for weights in self.field.parameters()):
            raise diverged()
        # Lightning would count blocks; `step` is its name for the x axis of every logger.
        self.log_dict({"loss": loss.detach(), **parts, "step": float(self.global_step)}, batch_size=1)
