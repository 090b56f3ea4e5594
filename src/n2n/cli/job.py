"""One run: data, fit, and what stays in its folder."""

import json
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from n2n.cli.console import progress_bar, say
from n2n.compose import config_hash
from n2n.errors import ConfigError, OutputError
from n2n.fitting.fit import LAST_CHECKPOINT, fit, pick_device
from n2n.formats import atomic_path
from n2n.formats.atomic import make_folder
from n2n.registry import DATAMODULES
from n2n.sweeps.claims import claim
from n2n.sweeps.status import CLAIM
from n2n.tasks.field import FIELD_FILE, Field
from n2n.tracking.results import check_evaluations
from n2n.tracking.tracker import track

RUNS = Path("runs")


def fit_job(config: dict[str, Any], run_dir: Path | None = None, sweep: str | None = None, data: Any = None) -> Path:
    """Fit one configuration, resuming what is there; return the run folder.

    Args:
        config: As composed and validated.
        run_dir: Where; None for runs/<hash of configuration and data>/.
        sweep: Name of the sweep that the run belongs to.
        data: Its datamodule, where it has been read already.

    Raises:
        N2NError: The data or the configuration cannot be used, or the folder cannot be written.
    """
    pick_device(config["device"])
    check_evaluations(config["evaluate"])
    data = _read_data(config) if data is None else data
    run_dir = run_dir or RUNS / _name(config, data)
    if (run_dir / FIELD_FILE).exists():
        say(f"fit: {run_dir} is finished already; delete it to fit again, or change a setting")
        return run_dir
    is_new = not run_dir.exists()
    make_folder(run_dir)
    # Whoever fits a sweep has claimed its runs.
    with _alone(run_dir) if sweep is None else nullcontext():
        _fit(config, data, run_dir, sweep, is_new)
    return run_dir


@contextmanager
def _alone(run_dir: Path) -> Iterator[None]:
    """Own a run; two processes would mix up its log and its checkpoints."""
    with claim(run_dir / CLAIM) as mine:
        if not mine:
            raise ConfigError(f"{run_dir}: another process is fitting this; wait for it, or change a setting")
        yield


def _fit(config: dict[str, Any], data: Any, run_dir: Path, sweep: str | None, is_new: bool) -> None:
    """Fit into a folder of our own."""
    try:
        OmegaConf.save(OmegaConf.create(config), run_dir / "config.yaml")
    except OSError as error:
        raise OutputError(f"{run_dir}: cannot be written ({error.strerror}); run n2n in another folder") from error
    start, tracker = time.perf_counter(), None
    try:
        with track(config, run_dir, sweep) as tracker:
            with progress_bar("fitting") as report:
                result = fit(data, config, run_dir, report, **tracker.during_fit())
            field = Field.of(result)
            seconds = time.perf_counter() - start
            summary = {**field.report, "seconds": round(seconds, 2), "config": field.config}
            with atomic_path(run_dir / "summary.json") as temporary:
                temporary.write_text(json.dumps(summary, indent=1, default=float) + "\n")
            if remark := tracker.finish(field, data, seconds):
                say(f"fit: {remark}")
    except Exception:
        # Nothing there is worth resuming, and nothing else tells a failed run from an unfinished one. What W&B was
        # told stays: it is to show the failure.
        shows = tracker is not None and (run_dir / "wandb").exists()
        if is_new and not shows and not (run_dir / LAST_CHECKPOINT).exists():
            shutil.rmtree(run_dir, ignore_errors=True)
        raise
    # The field comes last: a folder that holds it is finished.
    field.save(run_dir)
    say(f"fit: {field.report['iterations']:,} iterations -> {run_dir}  ({seconds:.0f} s)")
    say(f"next: n2n reconstruct --run {run_dir} -o mesh.ply")


def _name(config: dict[str, Any], data: Any) -> str:
    """Return the hash of configuration and data: where it computes and who is told makes no other run.

    The content of the files counts, not their names: a scan that was replaced is another run.
    """
    decisive = {key: value for key, value in config.items() if key not in ("logger", "device")}
    return config_hash({**decisive, "data": data.fingerprint()})


def _read_data(config: dict[str, Any]) -> Any:
    """Build the datamodule; its own complaint about an argument's value becomes an error the user can act on."""
    spec = config["datamodule"]
    try:
        return DATAMODULES.build(spec, num_observations=config["num_observations"])
    except (ValueError, TypeError) as error:
        raise ConfigError(
            f"datamodule {spec['name']!r} cannot use its settings ({error}); see conf/datamodule/"
        ) from error
