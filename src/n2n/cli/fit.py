"""`n2n fit`: the Hydra application. Every run has a folder named by its configuration."""

import sys
import traceback
from typing import Any

from n2n.compose import conf_dir, hydra_arguments, register_schema, validate
from n2n.errors import N2NError

_HELP = """\
usage: n2n fit [key=value ...] [-m] [--cfg job]

Fit a field and keep it: leaves runs/HASH/ with config.yaml, metrics.csv, summary.json and the field. Running the same
configuration again resumes an unfinished fit and leaves a finished one alone.

examples:
  n2n fit                                  a generated scan, to see that all is well
  n2n fit datamodule=files datamodule.paths=[scan.ply]
  n2n fit datamodule=files datamodule.paths=[scan.ply] recipe=paper distance=cd
  n2n fit terms.zero_level.weight=0.1      a further term of the loss; `n2n list regulariser` knows the names
  n2n fit -m seed=0,1,2                    several runs, one after the other
  n2n fit --cfg job                        print the composed configuration
  n2n reconstruct --run runs/HASH -o mesh.ply

Composition and sweeps are Hydra's (hydra.cc); --hydra-help prints its own flags.
"""


def run_fit(arguments: list[str]) -> int:
    """Hand the command line to Hydra; each job is a fit of its own."""
    if arguments in (["--help"], ["-h"]):
        print(_HELP, end="")
        return 0
    import hydra

    from n2n.cli.sweep import check_jobs, split_arguments

    settings, flags = split_arguments(arguments)
    check_jobs(settings, flags)
    register_schema()
    outcomes: list[str | None] = []

    @hydra.main(config_path=str(conf_dir()), config_name="config", version_base="1.3")
    def application(composed: Any) -> None:
        outcomes.append(_run_job(composed))

    previous = sys.argv
    sys.argv = ["n2n fit", *hydra_arguments(settings), *flags]
    try:
        application()
    except KeyboardInterrupt:
        print("\nthe same command resumes the run", file=sys.stderr)
        raise
    except SystemExit as stop:
        if isinstance(stop.__context__, KeyboardInterrupt):
            print("\nthe same command resumes the run", file=sys.stderr)
            raise
        return 2 if stop.code else 0
    finally:
        sys.argv = previous
    return _report(outcomes)


def _run_job(composed: Any) -> str | None:
    """Run one job; a failure is told and remembered, and does not stop the rest of a sweep."""
    from hydra.core.hydra_config import HydraConfig

    from n2n.cli.console import say
    from n2n.cli.job import fit_job

    settings = HydraConfig.get().overrides.task
    if HydraConfig.get().mode.name == "MULTIRUN":
        say(f"job {HydraConfig.get().job.num}: {' '.join(settings)}")
    try:
        fit_job(validate(composed))
    except N2NError as error:
        print(f"n2n: error: {error}", file=sys.stderr)
        return f"{' '.join(settings)}: {error}"
    except Exception as error:
        traceback.print_exc()
        return f"{' '.join(settings)}: {type(error).__name__}: {error}"
    return None


def _report(outcomes: list[str | None]) -> int:
    from n2n.cli.console import say

    failures = [outcome for outcome in outcomes if outcome]
    if len(outcomes) > 1:
        say(f"fit: {len(outcomes) - len(failures)} of {len(outcomes)} jobs finished")
        for failure in failures:
            say(f"  failed: {failure}")
    return 2 if failures else 0
