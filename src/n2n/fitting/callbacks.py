"""Lightning callbacks of a fit."""

from collections.abc import Callable
from typing import Any

import lightning as L

_REPORTS = 1000
Report = Callable[[int, int, dict[str, float]], None]


class ProgressReport(L.Callback):
    """Tell a function how far the fit is: `report(done, total, logged values)` after every block, or 1000 times."""

    def __init__(self, report: Report) -> None:
        self.report = report

    def on_train_batch_end(self, trainer: L.Trainer, pl_module: Any, *unused: Any) -> None:
        # Reading a value waits for the device, so a long fit reports every so many blocks only.
        done, total = trainer.global_step, pl_module.iterations
        if done // pl_module.plan_reuse % max(1, total // pl_module.plan_reuse // _REPORTS) and done < total:
            return
        values = {name: float(value) for name, value in trainer.callback_metrics.items() if name != "step"}
        self.report(done, total, values)
