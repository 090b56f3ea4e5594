"""`n2n tables`: the paper's tables, planned, run and rendered."""

import argparse
from pathlib import Path

_EXAMPLES = """\
examples:
  n2n tables plan                              what the laptop profile needs, what is missing, how long it takes
  n2n tables run T01 T10                       measure two tables; the same command goes on where it stopped
  n2n tables run --profile smoke               all tables on generated shapes, to see that everything works
  n2n tables render --profile laptop           Markdown, LaTeX and CSV in out/tables/laptop
  n2n tables status
  n2n tables run --tables mine --results mine/results    tables of your own: mine/*.yaml
  n2n tables run --profile paper --launcher slurm_gpu --workers 20 hydra.launcher.partition=gpu

Profiles: smoke (generated shapes, minutes), laptop (fast recipe on all real data found), paper (the paper's settings,
for a cluster). Data is looked for in the folder named by N2N_DATA, else in ./data; see `n2n data list`.
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command and its arguments; imports nothing heavy."""
    command = commands.add_parser(
        "tables",
        help="the paper's tables beside numbers of one's own: plan, run, status, render",
        description="Compute the paper's tables and set them beside the published numbers.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("action", choices=["plan", "run", "status", "render"], help="what to do")
    command.add_argument(
        "inputs",
        nargs="*",
        metavar="TABLE",
        help="e.g. T01; all by default; hydra.launcher.KEY=VALUE sets a launcher",
    )
    command.add_argument("--profile", default="laptop", metavar="P", help="smoke, laptop or paper (laptop)")
    command.add_argument(
        "--results", type=Path, metavar="DIR", help="where results are kept, one file per fit (results/PROFILE)"
    )
    command.add_argument("--out", type=Path, metavar="DIR", help="where tables are written (out/tables/PROFILE)")
    command.add_argument(
        "--tables", type=Path, metavar="DIR", help="a folder with tables of your own (*.yaml); without TABLE only these"
    )
    command.add_argument("--workers", type=int, default=1, metavar="K", help="run: fits at a time (1)")
    command.add_argument(
        "--launcher", metavar="L", help="run: what starts the workers: slurm_gpu, slurm_cpu, local, ray_cluster"
    )
    command.add_argument("--again", action="store_true", help="run: also what other sources of n2n have measured")
    command.set_defaults(run_command=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code: 2 where a fit failed."""
    from n2n.cli.table_actions import ACTIONS, Request
    from n2n.errors import ConfigError
    from n2n.tables.plan import make_plan
    from n2n.tables.spec import load_profile
    from n2n.tables.store import Store

    if options.workers < 1:
        raise ConfigError(f"--workers {options.workers} is out of range; give a number >= 1")
    names, settings = split_settings(options.inputs, options.launcher)
    profile = load_profile(options.profile)
    request = Request(
        plan=make_plan(names, profile, folder=options.tables),
        store=Store(options.results or Path("results") / profile.name),
        out=options.out or Path("out/tables") / profile.name,
        workers=options.workers,
        again=options.again,
        launcher=options.launcher,
        settings=tuple(settings),
    )
    return ACTIONS[options.action](request)


def split_settings(arguments: list[str], launcher: str | None) -> tuple[list[str], list[str]]:
    """Tell names of tables from settings of the launcher.

    >>> split_settings(["T01", "hydra.launcher.partition=gpu"], "slurm_gpu")
    (['T01'], ['hydra.launcher.partition=gpu'])
    """
    from n2n.errors import ConfigError

    settings = [text for text in arguments if "=" in text]
    for text in settings:
        if not text.lstrip("+").startswith("hydra.launcher."):
            raise ConfigError(f"{text} is no setting of a launcher; write hydra.launcher.KEY=VALUE")
        if launcher is None:
            raise ConfigError(f"{text} sets a launcher, and none is named; add --launcher, e.g. --launcher slurm_gpu")
    return [text for text in arguments if "=" not in text], settings
