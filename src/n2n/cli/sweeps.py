"""`n2n sweep`: the sweeps that `n2n fit -m` makes; looked at, resumed, read."""

import argparse
import os
import shlex
import sys
from contextlib import chdir
from dataclasses import replace
from pathlib import Path

_EXAMPLES = """\
examples:
  n2n fit -m sweep=seeds seed=0,1,2 distance=emd,cd    make one, in sweeps/seeds
  n2n sweep                                            the sweeps here
  n2n sweep status seeds                               every run: state, settings, how far, why it failed
  n2n sweep resume seeds                               fit what is not done; unfinished fits go on where they stopped
  n2n sweep resume seeds hydra/launcher=serial         the same, one run after the other in this process
  n2n sweep retry seeds                                also what failed
  n2n sweep results seeds -o seeds.csv                 settings and results, one row a run; .csv or .json

Exit code of status, resume and retry: 0 where every run is done, else 2.
"""
_ACTIONS = ("list", "status", "resume", "retry", "results")
# A failed run fails again unless something was mended; whoever says `retry` has done that.
_RESUMED = ("pending", "stale")


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command and its arguments; imports nothing heavy."""
    command = commands.add_parser(
        "sweep",
        help="many fits of one command: status, resume, retry, results",
        description="Look at, resume and read sweeps; `n2n fit -m` makes them.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("action", nargs="?", default="list", choices=_ACTIONS, help="what to do (list)")
    command.add_argument("sweep", nargs="?", metavar="SWEEP", help="name or folder of a sweep")
    command.add_argument("settings", nargs="*", metavar="key=value", help="resume, retry: another launcher")
    command.add_argument("-o", "--output", type=Path, metavar="FILE", help="results: .csv or .json (CSV, printed)")
    command.set_defaults(run_command=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    from n2n.errors import ConfigError
    from n2n.sweeps.store import Sweep

    if options.action == "list":
        return _list()
    if options.sweep is None:
        raise ConfigError(f"n2n sweep {options.action}: which sweep? `n2n sweep` lists them")
    if options.settings and options.action not in ("resume", "retry"):
        raise ConfigError(f"n2n sweep {options.action} takes no settings; {options.settings[0]!r} is one too many")
    if options.output and options.action != "results":
        raise ConfigError(f"n2n sweep {options.action} writes no file; leave -o {options.output} out")
    sweep = Sweep.open(options.sweep)
    if options.action == "status":
        return _status(sweep)
    if options.action == "results":
        return _results(sweep, options.output)
    states = (*_RESUMED, "failed") if options.action == "retry" else _RESUMED
    return _resume(sweep, options.settings, states)


def _list() -> int:
    from n2n.sweeps.store import STATES, SWEEPS, all_sweeps

    sweeps, damaged = all_sweeps()
    for error in damaged:
        print("n2n: error:", error, file=sys.stderr)
    if not sweeps and damaged:
        return 2
    if not sweeps:
        print(f"no sweeps in {SWEEPS.absolute()}; `n2n fit -m key=a,b` makes one")
        return 0
    table = [["sweep", "runs", *STATES, "created", "settings"]]
    for sweep in sweeps:
        runs = sweep.runs
        counts = [sum(run.state == state for run in runs) for state in STATES]
        axes = " ".join(f"{key}={','.join(values)}" for key, values in sweep.axes.items())
        table.append([sweep.name, str(len(runs)), *(str(n or "") for n in counts), sweep.created[:16], axes])
    _print(table)
    return 2 if damaged else 0


def _status(sweep) -> int:
    from n2n.sweeps.store import STATES

    runs = sweep.runs
    counts = [f"{n} {state}" for state in STATES if (n := sum(run.state == state for run in runs))]
    print(f"{sweep.folder}: {len(runs)} runs, {', '.join(counts)}")
    print(f"n2n fit {shlex.join(sweep.command)}\n")
    axes = list(dict.fromkeys([*sweep.axes, *(key for run in runs for key in run.settings)]))
    table = [["run", "state", *axes, "seconds", "iteration", "tries", "heard of", "error"]]
    for run in runs:
        values = [run.settings.get(key, "") for key in axes]
        iteration = run.iteration()
        row = [run.hash, run.state, *values, "" if run.seconds is None else f"{run.seconds:.1f}"]
        row += ["" if iteration is None else f"{iteration:,}", str(run.attempt or "")]
        row += [f"{run.heartbeat:.0f} s ago" if run.state == "running" and run.heartbeat is not None else ""]
        table.append([*row, run.error or ""])
    _print(table)
    return 0 if all(run.state == "done" for run in runs) else 2


def _results(sweep, output: Path | None) -> int:
    from n2n.cli.console import say
    from n2n.sweeps.results import as_csv, rows, write

    table = rows(sweep)
    if output is None:
        print(as_csv(table), end="")
    else:
        write(table, output)
        say(f"results: {len(table)} runs -> {output}")
    return 0


def _resume(sweep, settings: list[str], states: tuple[str, ...]) -> int:
    """Run the sweep's commands again, for runs in these states."""
    from n2n.cli.multirun import OtherRunsError, run_multirun
    from n2n.errors import ConfigError
    from n2n.sweeps.command import is_about_launcher, split_arguments, take_name

    other = [text for text in settings if not is_about_launcher(text)]
    if other:
        raise ConfigError(
            f"{other[0]} would make other runs; a sweep is resumed with its own settings, only the launcher may change "
            "(hydra/launcher=..., hydra.launcher.key=...)"
        )
    codes, refused = [], []
    # Paths in the command are those of the folder it was given in.
    # Neither `..` nor a link to another disk may make its parent another one.
    folder = Path(os.path.abspath(sweep.folder))  # noqa: PTH100 - resolve() follows links
    home = folder.parent.parent
    with chdir(home):
        for command in sweep.commands:
            kept, flags = split_arguments(command)
            if any(text.startswith("hydra/launcher=") for text in settings):
                kept = [text for text in kept if not is_about_launcher(text)]
            wanted = [*take_name(kept)[1], *settings, f"sweep={folder.name}"]
            part = replace(sweep, folder=folder.relative_to(home), command=command)
            try:
                codes.append(run_multirun(wanted, flags, states, part))
            except OtherRunsError as error:
                # A command whose defaults have changed since keeps no other from its runs.
                refused.append(str(error))
    if refused:
        raise OtherRunsError("\n".join(refused))
    return codes[-1]


def _print(table: list[list[str]]) -> None:
    """Print rows in columns, the first row as their names; columns without a value are left out."""
    columns = [column for column in zip(*table, strict=True) if any(column[1:])]
    widths = [max(map(len, column)) for column in columns]
    for row in zip(*columns, strict=True):
        print("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip())
