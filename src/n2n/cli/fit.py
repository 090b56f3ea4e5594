"""`n2n fit`: the Hydra application. Every run has a folder named by its configuration."""

import json
import sys
import time
from pathlib import Path
from typing import Any

from n2n.compose import conf_dir, config_hash, plugin_search_paths, register_schema, validate
from n2n.errors import N2NError

RUNS = Path("runs")


def run_fit(arguments: list[str]) -> int:
    """Hand the command line to Hydra; each job is `fit_job`."""
    import hydra

    if arguments in (["--help"], ["-h"]):
        print(_HELP)
        return 0
    register_schema()
    failures: list[str] = []

    @hydra.main(config_path=str(conf_dir()), config_name="config", version_base="1.3")
    def application(composed: Any) -> None:
        try:
            fit_job(validate(composed))
        except N2NError as error:
            failures.append(str(error))
            print(f"n2n: error: {error}", file=sys.stderr)

    search = ",".join(plugin_search_paths())
    previous = sys.argv
    sys.argv = ["n2n fit", *arguments, *([f"hydra.searchpath=[{search}]"] if search else [])]
    try:
        application()
    except N2NError:
        raise
    except SystemExit as stop:
        return int(stop.code or 0) and 2
    finally:
        sys.argv = previous
    return 2 if failures else 0


_HELP = """\
usage: n2n fit [key=value ...] [-m] [--cfg job]

Fit a field and keep it: leaves runs/<hash>/ with config.yaml, metrics.csv, summary.json and the field. Running the same
configuration again resumes an unfinished fit and leaves a finished one alone.

examples:
  n2n fit datamodule=files datamodule.paths=[scan.ply]
  n2n fit datamodule=files datamodule.paths=[scan.ply] recipe=paper distance=cd
  n2n fit -m seed=0,1,2                    several runs, one after the other
  n2n fit --cfg job                        print the composed configuration
  n2n reconstruct --run runs/HASH -o mesh.ply
"""


def fit_job(config: dict[str, Any]) -> Path:
    """Fit one configuration into runs/<hash>/, resuming what is there; return the folder."""
    from hydra.utils import instantiate
    from omegaconf import OmegaConf

    from n2n.cli.console import progress_bar, say
    from n2n.fitting.fit import fit
    from n2n.registry import DATAMODULES
    from n2n.tasks.field import FIELD_FILE, Field

    run_dir = RUNS / config_hash(config)
    if (run_dir / FIELD_FILE).exists():
        say(f"fit: {run_dir} is finished already; delete it to fit again, or change a setting")
        return run_dir
    data = DATAMODULES.build(config["datamodule"], num_observations=config["num_observations"])
    run_dir.mkdir(parents=True, exist_ok=True)
    OmegaConf.save(OmegaConf.create(config), run_dir / "config.yaml")
    logger = instantiate({**config["logger"], "save_dir": str(run_dir)}) if config["logger"] else False
    start = time.perf_counter()
    with progress_bar("fitting") as report:
        result = fit(data, config, run_dir, report, logger)
    field = Field.of(result)
    field.save(run_dir)
    summary = {**field.report, "seconds": round(time.perf_counter() - start, 2), "config": field.config}
    (run_dir / "summary.json").write_text(json.dumps(summary, indent=1, default=float) + "\n")
    say(f"fit: {field.report['iterations']} iterations -> {run_dir}  ({time.perf_counter() - start:.0f} s)")
    say(f"next: n2n reconstruct --run {run_dir} -o mesh.ply")
    return run_dir

