"""`n2n fit`: the Hydra application. Every run has a folder named by its configuration."""

import sys
from typing import Any, NamedTuple

from n2n.compose import conf_dir, hydra_arguments, register_schema, validate
from n2n.errors import N2NError
from n2n.messages import unexpected

_RESUMES = "the same command resumes the run"

_HELP = """\
usage: n2n fit [key=value ...] [-m] [--cfg job]

Fit a field and keep it: leaves runs/HASH/ with config.yaml, metrics.csv, summary.json and the field. Running the same
configuration again resumes an unfinished fit and leaves a finished one alone.

examples:
  n2n fit                                  a generated scan, to see that all is well
  n2n fit datamodule=files 'datamodule.paths=[scan.ply]'
  n2n fit datamodule=files 'datamodule.paths=[scan.ply]' recipe=paper distance=cd
  n2n fit terms.zero_level.weight=0.1      a further term of the loss; `n2n list regulariser` knows the names
  n2n fit -m seed=0,1,2                    several runs, one after the other
  n2n fit --cfg job                        print the composed configuration
  n2n reconstruct --run runs/HASH -o mesh.ply

Composition and sweeps are Hydra's (hydra.cc); --hydra-help prints its own flags.
"""


def run_fit(arguments: list[str]) -> int:
    """Hand the command line to Hydra; each job is a fit of its own."""
    if {"--help", "-h"} & set(arguments):
        print(_HELP, end="")
        return 0
    import hydra

    from n2n.cli.sweep import check_flags, check_jobs, split_arguments

    settings, flags = split_arguments(arguments)
    check_flags(flags)
    check_jobs(settings, flags)
    register_schema()
    outcomes: list[Outcome] = []

    @hydra.main(config_path=str(conf_dir()), config_name="config", version_base="1.3")
    def application(composed: Any) -> None:
        outcomes.append(_run_job(composed))

    previous = sys.argv
    sys.argv = ["n2n fit", *hydra_arguments(settings), *flags]
    try:
        application()
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(_RESUMES) from stop
    except SystemExit as stop:
        return 2 if stop.code else 0
    finally:
        sys.argv = previous
    return _report(outcomes)


class Outcome(NamedTuple):
    """What became of a job: its exit code, and what to say about it where it failed."""

    code: int
    failure: str = ""


def _run_job(composed: Any) -> Outcome:
    """Run one job; a failure is told and remembered, and does not stop the rest of a sweep."""
    from hydra.core.hydra_config import HydraConfig

    from n2n.cli.console import say
    from n2n.cli.job import fit_job

    settings = " ".join(HydraConfig.get().overrides.task)
    if HydraConfig.get().mode.name == "MULTIRUN":
        say(f"job {HydraConfig.get().job.num}: {settings}")
    try:
        fit_job(validate(composed))
    except Exception as error:
        foreseen = isinstance(error, N2NError)
        message = str(error) if foreseen else unexpected(error)
        print("n2n: error:", message.replace("\n", " "), file=sys.stderr)
        return Outcome(2 if foreseen else 3, f"{settings}: {message}")
    return Outcome(0)


def _report(outcomes: list[Outcome]) -> int:
    """Sum up a sweep; return the worst exit code."""
    from n2n.cli.console import say

    failures = [outcome.failure for outcome in outcomes if outcome.code]
    if len(outcomes) > 1:
        say(f"fit: {len(outcomes) - len(failures)} of {len(outcomes)} jobs finished")
        for failure in failures:
            say(f"  failed: {failure}")
    return max((outcome.code for outcome in outcomes), default=0)
