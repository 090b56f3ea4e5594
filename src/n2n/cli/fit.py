"""`n2n fit`: the Hydra application. Every run has a folder named by its configuration and data."""

import sys
from typing import Any

from n2n.compose import conf_dir, hydra_arguments, register_schema, validate
from n2n.errors import ConfigError, N2NError
from n2n.messages import unexpected

_RESUMES = "the same command resumes the run"
# Flags of Hydra that print something instead of fitting.
_LOOKS = ("--cfg", "-c", "--info", "-i", "--hydra-help", "--shell-completion", "-sc", "--version")

_HELP = """\
usage: n2n fit [key=value ...] [-m] [--cfg job]

Fit a field and keep it: leaves runs/HASH/ with config.yaml, metrics.csv, summary.json and the field. Running the same
configuration again resumes an unfinished fit and leaves a finished one alone.

examples:
  n2n fit                                  a generated scan, to see that all is well
  n2n fit datamodule=files 'datamodule.paths=[scan.ply]'
  n2n fit datamodule=files 'datamodule.paths=[scan.ply]' recipe=paper distance=cd
  n2n fit terms.zero_level.weight=0.1      a further term of the loss; `n2n list regulariser` knows the names
  n2n fit -m seed=0,1,2 sweep=seeds        a sweep: several runs at a time, in sweeps/seeds; see `n2n sweep --help`
  n2n fit --cfg job                        print the composed configuration
  n2n reconstruct --run runs/HASH -o mesh.ply

Composition and sweeps are Hydra's (hydra.cc); --hydra-help prints its own flags.
"""


def run_fit(arguments: list[str]) -> int:
    """Fit one configuration, or with -m a sweep of them."""
    if {"--help", "-h"} & set(arguments):
        print(_HELP, end="")
        return 0
    from n2n.sweeps.command import check_flags, check_jobs, is_sweep, split_arguments, take_name

    settings, flags = split_arguments(arguments)
    check_flags(flags)
    name, rest = take_name(settings)
    if is_sweep(settings, flags):
        if looks := [flag for flag in flags if flag.partition("=")[0] in _LOOKS]:
            raise ConfigError(f"{looks[0]} shows one configuration; leave -m out and give every setting one value")
        from n2n.cli.multirun import run_multirun

        return run_multirun(settings, flags)
    if name:
        raise ConfigError(f"sweep={name} names a sweep, and this is one fit; add -m, or leave it out")
    check_jobs(rest, flags)
    return _run_one(rest, flags)


def _run_one(settings: list[str], flags: list[str]) -> int:
    """Hand the command line to Hydra, which fits, or prints what the flags ask for."""
    import hydra

    register_schema()
    codes: list[int] = []

    @hydra.main(config_path=str(conf_dir()), config_name="config", version_base="1.3")
    def application(composed: Any) -> None:
        codes.append(_fit(composed))

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
    return max(codes, default=0)


def _fit(composed: Any) -> int:
    """Fit; tell a failure here, or Hydra would, in many lines."""
    from n2n.cli.job import fit_job

    try:
        fit_job(validate(composed))
    except Exception as error:
        foreseen = isinstance(error, N2NError)
        message = str(error) if foreseen else unexpected(error)
        print("n2n: error:", message.replace("\n", " "), file=sys.stderr)
        return 2 if foreseen else 3
    return 0
