"""Lightning callbacks of a fit."""

from collections.abc import Callable
from typing import Any

import lightning as L

Report = Callable[[int, int, dict[str, float]], None]


class ProgressReport(L.Callback):
    """Tell a function how far the fit is: `report(done, total, logged values)` after every block."""

    def __init__(self, report: Report) -> None:
        self.report = report

    def on_train_batch_end(self, trainer: L.Trainer, pl_module: Any, *unused: Any) -> None:
        values = {name: float(value) for name, value in trainer.callback_metrics.items()}
        self.report(trainer.global_step, pl_module.iterations, values)
