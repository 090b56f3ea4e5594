"""One run: data, fit, and what stays in its folder."""

import json
import shutil
import sys
import time
from pathlib import Path
from typing import Any

from hydra.utils import instantiate
from omegaconf import OmegaConf

from n2n.cli.console import progress_bar, say
from n2n.compose import config_hash
from n2n.errors import ConfigError, OutputError
from n2n.fitting.fit import LAST_CHECKPOINT, fit, pick_device
from n2n.formats import atomic_path
from n2n.registry import DATAMODULES
from n2n.tasks.field import FIELD_FILE, Field

RUNS = Path("runs")


def fit_job(config: dict[str, Any], run_dir: Path | None = None, sweep: str | None = None) -> Path:
    """Fit one configuration, resuming what is there; return the run folder.

    Args:
        config: As composed and validated.
        run_dir: Where; None for runs/<hash of configuration and data>/.
        sweep: Name of the sweep that the run belongs to.

    Raises:
        N2NError: The data or the configuration cannot be used, or the folder cannot be written.
    """
    pick_device(config["device"])
    data = _read_data(config)
    # The content of the files counts, not their names: a scan that was replaced is another run.
    run_dir = run_dir or RUNS / config_hash({**config, "data": data.fingerprint()})
    if (run_dir / FIELD_FILE).exists():
        say(f"fit: {run_dir} is finished already; delete it to fit again, or change a setting")
        return run_dir
    is_new = not run_dir.exists()
    try:
        run_dir.mkdir(parents=True, exist_ok=True)
        OmegaConf.save(OmegaConf.create(config), run_dir / "config.yaml")
    except OSError as error:
        raise OutputError(f"{run_dir}: cannot be written ({error.strerror}); run n2n in another folder") from error
    _keep_metrics(run_dir)
    start = time.perf_counter()
    failed = True
    try:
        logger = instantiate({**config["logger"], "save_dir": str(run_dir)}) if config["logger"] else False
        with progress_bar("fitting") as report:
            result = fit(data, config, run_dir, report, logger)
        failed = False
    except Exception:
        # Nothing there is worth resuming, and nothing else tells a failed run from an unfinished one.
        if is_new and not (run_dir / LAST_CHECKPOINT).exists():
            shutil.rmtree(run_dir, ignore_errors=True)
        raise
    finally:
        # A run that is not closed shows as still running for ever.
        if "wandb" in sys.modules and sys.modules["wandb"].run is not None:
            sys.modules["wandb"].finish(exit_code=int(failed))
    field = Field.of(result)
    seconds = time.perf_counter() - start
    summary = {**field.report, "seconds": round(seconds, 2), "config": field.config}
    with atomic_path(run_dir / "summary.json") as temporary:
        temporary.write_text(json.dumps(summary, indent=1, default=float) + "\n")
    # The field comes last: a folder that holds it is finished.
    field.save(run_dir)
    say(f"fit: {field.report['iterations']:,} iterations -> {run_dir}  ({seconds:.0f} s)")
    say(f"next: n2n reconstruct --run {run_dir} -o mesh.ply")
    return run_dir


def _keep_metrics(run_dir: Path) -> None:
    """Number the log of an interrupted fit: the logger would write over it."""
    log = run_dir / "metrics.csv"
    if log.exists():
        log.rename(run_dir / f"metrics.{len(list(run_dir.glob('metrics.*.csv')))}.csv")


def _read_data(config: dict[str, Any]) -> Any:
    """Build the datamodule; its own complaint about an argument's value becomes an error the user can act on."""
    spec = config["datamodule"]
    try:
        return DATAMODULES.build(spec, num_observations=config["num_observations"])
    except (ValueError, TypeError) as error:
        raise ConfigError(
            f"datamodule {spec['name']!r} cannot use its settings ({error}); see conf/datamodule/"
        ) from error
