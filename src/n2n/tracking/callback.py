"""What is logged beside the losses while a field is fitted."""

import os
import time
from pathlib import Path
from typing import Any

import lightning as L
import torch
from torch import Tensor

from n2n.losses.state import FieldState
from n2n.tracking import names

_STATM = Path("/proc/self/statm")
_GIB = 2**30


def gradient_norm(state: FieldState) -> Tensor:
    """Return the mean length of the gradient at the queries."""
    return state.gradient.detach().norm(dim=-1).mean()


def eikonal_deviation(state: FieldState) -> Tensor:
    """Return the mean distance of the gradient's length from 1, which it is for a distance."""
    return (state.gradient.detach().norm(dim=-1) - 1).abs().mean()


WATCHED = {names.GRADIENT_NORM: gradient_norm, names.EIKONAL_DEVIATION: eikonal_deviation}


class FitLog(L.Callback):
    """Log matched distance, learning rate, speed and memory with every row of losses."""

    def __init__(self) -> None:
        self._step, self._time = 0, 0.0

    def on_train_start(self, trainer: L.Trainer, pl_module: Any) -> None:
        self._step, self._time = trainer.global_step, time.perf_counter()

    def on_train_batch_end(self, trainer: L.Trainer, pl_module: Any, outputs: Any, batch: Any, batch_idx: int) -> None:
        # Lightning's own count: after a fit was resumed no other one tells which blocks become a row.
        if not trainer._logger_connector.should_update_logs:
            return
        # Unit coordinates to the power of the exponent -> a length in world units.
        exponent = getattr(pl_module.objective.distance, "p", 1)
        matched = float(trainer.callback_metrics[names.DISTANCE]) ** (1 / exponent)
        step, now = trainer.global_step, time.perf_counter()
        values = {
            names.MATCHED_DISTANCE: matched * trainer.datamodule.frames[batch.condition].scale,
            names.LEARNING_RATE: trainer.optimizers[0].param_groups[0]["lr"],
            names.STEPS_PER_SECOND: (step - self._step) / (now - self._time),
            **memory(pl_module.device),
        }
        self._step, self._time = step, now
        pl_module.log_dict(values, batch_size=1)


def memory(device: torch.device) -> dict[str, float]:
    """Return the memory in use in GiB: resident memory now and, on a GPU, the largest allocation so far."""
    used = {}
    if _STATM.exists():
        used[names.MEMORY] = int(_STATM.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / _GIB
    if device.type == "cuda":
        used[names.GPU_MEMORY] = torch.cuda.max_memory_allocated(device) / _GIB
    return used
