"""Lightning's loggers as n2n uses them: opened before anything expensive, closed however the run ends."""

import hashlib
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hydra.utils import instantiate
from lightning.pytorch.loggers import CSVLogger, Logger, TensorBoardLogger, WandbLogger

from n2n.errors import ConfigError
from n2n.tracking.wandb import require_login

JOB_TYPE = "fit"
_PATIENCE = 20  # seconds for W&B's server to answer
_LAST_PATIENCE = 120  # seconds for what is left to be uploaded at the end
_NOT_IN_ID = re.compile(r"[^\w.-]")


def open_logger(spec: dict[str, Any], config: dict[str, Any], run_dir: Path, sweep: str | None = None) -> Logger | None:
    """Build the logger of a run, ready to take values.

    Args:
        spec: `_target_` of a Lightning logger and its arguments; empty for none.
        config: Of the fit, for tags.
        run_dir: Where it writes; an earlier part of metrics.csv is kept there under another name.
        sweep: The group that the run belongs to.

    Raises:
        ConfigError: The logger's package is missing, or W&B cannot be reached or knows no login.
    """
    if not spec:
        return None
    target = spec["_target_"].rpartition(".")[2]
    extra: dict[str, Any] = {"save_dir": str(run_dir)}
    if target == CSVLogger.__name__:
        _keep_metrics(run_dir)
    elif target == TensorBoardLogger.__name__:
        if not any(map(find_spec, ("tensorboard", "tensorboardX"))):
            raise ConfigError(
                "logger=tensorboard needs the package tensorboard; install it with `pip install 'n2n[tensorboard]'`"
            )
    elif target == WandbLogger.__name__:
        return _open_wandb({**spec, **extra, **_labels(config, run_dir, sweep)})
    return instantiate({**spec, **extra})


def close_logger(logger: Logger | None, failed: bool) -> None:
    """Let a logger write what is left; W&B is also told whether the run failed."""
    if logger is None:
        return
    logger.finalize("failed" if failed else "success")
    if isinstance(logger, WandbLogger):
        # A run that is not closed shows as still running for ever.
        logger.experiment.finish(exit_code=int(failed))


def _labels(config: dict[str, Any], run_dir: Path, sweep: str | None) -> dict[str, Any]:
    """Return what W&B sorts runs by. A resumed run goes on under the identity it had.

    The folder is a part of it: in a project that people share, the same run of another folder is another run.
    """
    name = f"{sweep}-{run_dir.name}" if sweep else run_dir.name
    place = hashlib.sha256(str(run_dir.resolve()).encode()).hexdigest()[:6]
    tags = [config["recipe"], config["datamodule"]["name"], config["task"]]
    return {
        "name": run_dir.name,
        "id": f"{_NOT_IN_ID.sub('-', name)[:120]}-{place}",
        "group": sweep,
        "job_type": JOB_TYPE,
        "tags": [tag for tag in tags if tag],
    }


def _open_wandb(spec: dict[str, Any]) -> Logger:
    import wandb

    offline = bool(spec.get("offline"))
    settings = wandb.Settings(
        mode="offline" if offline else "online",
        silent=True,
        console="off",
        disable_git=True,
        init_timeout=_PATIENCE,
        finish_timeout=_LAST_PATIENCE,
    )
    # Before a run has settings, W&B speaks as it was set up.
    wandb.setup(settings)
    if not offline:
        require_login("logger.offline=false", "leave it true and upload later: `wandb sync`")
    logger = WandbLogger(**{key: value for key, value in spec.items() if key != "_target_"}, settings=settings)
    try:
        logger.experiment  # noqa: B018 (opens the run)
    except wandb.Error as error:
        reason = " ".join(str(error).split())
        raise ConfigError(
            f"logger=wandb: W&B cannot be used ({reason}); leave logger.offline=true and upload later: `wandb sync`"
        ) from error
    return logger


def _keep_metrics(run_dir: Path) -> None:
    """Number the log of an interrupted fit: the logger would write over it."""
    log = run_dir / "metrics.csv"
    if log.exists():
        log.rename(run_dir / f"metrics.{len(list(run_dir.glob('metrics.*.csv')))}.csv")
