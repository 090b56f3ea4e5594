"""One run of a sweep in a worker: of this machine or another."""

import functools
import gc
import os
import signal
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from n2n.cli.console import silenced
from n2n.compose import validate
from n2n.errors import ConfigError
from n2n.sweeps.attempt import attempt
from n2n.sweeps.data import fingerprint, read_data
from n2n.sweeps.grid import run_hash, varied
from n2n.sweeps.score import score


@dataclass(frozen=True)
class SweepJob:
    """What a worker does with a composed configuration; travels to it as a pickle.

    Attributes:
        sweep: Folder of the sweep, absolute.
        axes: Keys that are varied.
        planned: What is varied, joined, -> hash of the run; None where an optimiser plans as it goes.
        threads: For the numerical libraries; None leaves them alone.
        parent: Process whose end is to end the worker as well; None where workers live on their own.
    """

    sweep: Path
    axes: tuple[str, ...]
    planned: dict[str, str] | None = None
    threads: int | None = None
    parent: int | None = None

    def __call__(self, composed: Any) -> float | None:
        """Fit; return the run's score, which an optimising sweeper goes by."""
        from hydra.core.hydra_config import HydraConfig

        self._settle()
        from n2n.cli.job import fit_job

        config = validate(composed)
        settings = varied(HydraConfig.get().overrides.task, self.axes)
        name = run_hash(config)
        planned = (self.planned or {}).get(" ".join(settings), name)
        folder = self.sweep / "runs" / planned

        @functools.cache
        def data() -> Any:
            return read_data(config)

        def fit() -> None:
            if name != planned:
                raise ConfigError(
                    "the defaults in conf/ or n2n itself changed while the sweep ran: this would be another run; "
                    "give the command again"
                )
            fit_job(config, folder, self.sweep.name, data())

        with silenced():
            state = attempt(folder, settings, lambda: fingerprint(data()), fit)
        return score(folder) if state == "done" else None

    def _settle(self) -> None:
        """Take the share of the cores; in a process of its own, leave Ctrl-C to the parent and end with it."""
        if self.parent and os.getpid() != self.parent and not any(t.name == _FOLLOWER for t in threading.enumerate()):
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            threading.Thread(target=_follow, args=(os.getppid(),), name=_FOLLOWER, daemon=True).start()
            _import_once()
        if self.threads:
            import torch

            torch.set_num_threads(self.threads)


def _import_once() -> None:
    """Import what runs need without looking for garbage, of which there is none, and never look through it again.

    That took a third of the time of the imports, and a quarter of a second after each run, when joblib looks.
    """
    gc.disable()
    import n2n.cli.job  # noqa: F401

    gc.freeze()
    gc.enable()


_FOLLOWER = "n2n-follow-parent"


def _follow(parent: int) -> None:
    """End when the parent has ended, however that was: a killed one cannot say so."""
    while os.getppid() == parent:
        time.sleep(1)
    os._exit(1)
