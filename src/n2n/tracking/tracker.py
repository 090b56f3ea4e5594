"""One run under observation: its logger, what the fit is to log, and what stays when it is done."""

import json
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from lightning.pytorch.loggers import CSVLogger, Logger

from n2n.errors import SurfaceError
from n2n.evaluation.provenance import provenance
from n2n.formats import atomic_path
from n2n.tasks.field import Field
from n2n.tracking.callback import WATCHED, FitLog
from n2n.tracking.loggers import close_logger, open_logger
from n2n.tracking.names import EVALUATION_FILE
from n2n.tracking.results import evaluate, results
from n2n.tracking.wandb import wandb_at


class Tracker:
    """What a run's logger is told.

    Args:
        logger: None for none: then nothing is measured during the fit.
        config: Of the fit.
        run_dir: Where files go.
    """

    def __init__(self, logger: Logger | None, config: dict[str, Any], run_dir: Path) -> None:
        self.logger, self.config, self.run_dir = logger, config, run_dir
        # Beside metrics.csv the run folder holds configuration and results as files of their own.
        self._elsewhere = logger is not None and not isinstance(logger, CSVLogger)
        if self._elsewhere:
            logger.log_hyperparams({**config, **provenance()})

    def during_fit(self) -> dict[str, Any]:
        """Return the arguments of `n2n.fitting.fit.fit` that make it log."""
        if self.logger is None:
            return {}
        return {"logger": self.logger, "callbacks": [FitLog()], "watched": WATCHED}

    def finish(self, field: Field, data: Any, seconds: float) -> str:
        """Evaluate a fitted field, draw it, and log both.

        Args:
            field: The result.
            data: The datamodule it was fitted to.
            seconds: That the fit took.

        Returns:
            What could not be done; empty if all was.
        """
        step = field.report["iterations"]
        evaluations = evaluate(field, data, self.config["evaluate"])
        record = {"validation": field.report.get("validation"), "evaluations": evaluations}
        with atomic_path(self.run_dir / EVALUATION_FILE) as temporary:
            temporary.write_text(json.dumps(record, indent=1, default=float) + "\n")
        if self._elsewhere:
            self.logger.log_metrics(results(field, evaluations, seconds), step)
        remarks = []
        if self.config["evaluate"] and not evaluations:
            remarks.append("not evaluated: the data have no reference")
        try:
            self._draw(field, data, step)
        except SurfaceError as error:
            remarks.append(f"no pictures: {error}")
        return "; ".join(remarks)

    def _draw(self, field: Field, data: Any, step: int) -> None:
        wanted = self.config["media"]
        if not (self.logger is not None if wanted is None else wanted):
            return
        # Imported where needed: a fit without pictures does without matplotlib.
        from n2n.tracking.media import draw_media
        from n2n.tracking.show import show

        media = draw_media(field, data, self.run_dir)
        if self._elsewhere:
            show(self.logger, media, step)


@contextmanager
def track(config: dict[str, Any], run_dir: Path, sweep: str | None = None) -> Iterator[Tracker]:
    """Yield the tracker of a run; if the block fails, the run is marked as failed.

    Args:
        config: Of the fit, with `logger`.
        run_dir: Of the run.
        sweep: Name of the group of runs it belongs to.

    Raises:
        ConfigError: The logger cannot be used.
    """
    spec = config["logger"]
    with wandb_at(run_dir) if spec and "Wandb" in spec["_target_"] else nullcontext():
        logger = open_logger(spec, config, run_dir, sweep)
        failed = True
        try:
            yield Tracker(logger, config, run_dir)
            failed = False
        finally:
            close_logger(logger, failed)
