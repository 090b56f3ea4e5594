"""`n2n dashboard`: runs and sweeps as one page."""

import argparse
import time
from pathlib import Path
from typing import Any

_EXAMPLES = """\
examples:
  n2n dashboard                                  everything in runs/ and sweeps/ -> dashboard.html
  n2n dashboard weights -o weights.html          the sweep sweeps/weights
  n2n dashboard runs/0123456789 runs/abcdef0123
  n2n dashboard results/laptop                   results of `n2n tables`
  n2n dashboard --wandb TEAM/PROJECT             the same sections as a workspace and a report of W&B

The page needs no server, network or account: open it in a browser, send it by mail. It holds a copy of all it shows.
"""
_MEGABYTES = 12.0


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command and its arguments; imports nothing heavy."""
    command = commands.add_parser(
        "dashboard",
        help="runs and sweeps as one self-contained page",
        usage="n2n dashboard [RUN|SWEEP|FOLDER ...] [-o FILE.html] [--media MB] | --wandb ENTITY/PROJECT",
        description="Write a page with the settings, curves, results, pictures and failures of runs.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("inputs", nargs="*", metavar="RUN", help="runs, sweeps or folders of them (runs/ and sweeps/)")
    command.add_argument("-o", "--output", default="dashboard.html", metavar="FILE", help="page (dashboard.html)")
    command.add_argument(
        "--media",
        type=float,
        default=_MEGABYTES,
        metavar="MB",
        help=f"room for pictures and 3D views, newest runs first; 0: none ({_MEGABYTES:g})",
    )
    command.add_argument(
        "--wandb", metavar="ENTITY/PROJECT", help="make a workspace and a report in a project of W&B instead of a page"
    )
    command.add_argument("-q", "--quiet", action="store_true", help="no summary")
    command.set_defaults(run_command=run)


def run(options: argparse.Namespace) -> int:
    """Write the page; return the exit code."""
    from n2n.cli.outputs import new_folder
    from n2n.dashboard.page import write_page
    from n2n.dashboard.sources import read_runs
    from n2n.errors import ConfigError
    from n2n.formats import check_writable

    if options.wandb is not None:
        return _publish(options)
    if not 0 <= options.media < float("inf"):
        raise ConfigError(f"--media {options.media} is out of range; give megabytes >= 0")
    path = Path(options.output)
    check_writable(path, (".html", ".htm"), new_folder=True)
    start = time.perf_counter()
    runs = read_runs(options.inputs)
    with new_folder(path.parent):
        data = write_page(runs, path, options.media)
    _report(runs, data, path, time.perf_counter() - start, options)
    return 0


def _report(runs: list[Any], data: dict[str, Any], path: Path, seconds: float, options: argparse.Namespace) -> None:
    """Say what is on the page, and what is not."""
    from n2n.cli.console import say
    from n2n.sweeps.store import STATES

    found = [(sum(run.state == state for run in runs), state) for state in STATES]
    counts = ", ".join(f"{count} {state}" for count, state in found if count) or "none"
    size = path.stat().st_size / 1e6
    say(f"dashboard: {len(runs)} runs ({counts}) -> {path}  ({size:.1f} MB, {seconds:.1f} s)", options.quiet)
    left = data["leftOut"]
    if any(left.values()):
        what = f"{left['scenes']} 3D views, {left['pictures']} pictures"
        say(f"left out: {what}; --media {options.media:g} gives them no more room", options.quiet)
    if damaged := sum(bool(run["problems"]) for run in data["runs"]):
        say(f"{damaged} runs have files that cannot be read; their pages say which", options.quiet)


def _publish(options: argparse.Namespace) -> int:
    """Make the workspace and the report of W&B."""
    from n2n.cli.console import say
    from n2n.dashboard.wandb import publish
    from n2n.errors import ConfigError

    entity, _, project = options.wandb.partition("/")
    if not entity or not project or "/" in project:
        raise ConfigError(f"--wandb {options.wandb}: write the project as ENTITY/PROJECT, as in its address")
    if options.inputs:
        raise ConfigError(
            f"{options.inputs[0]} has no effect with --wandb, which shows the project's runs; leave it out"
        )
    for name, address in zip(("workspace", "report"), publish(entity, project), strict=True):
        say(f"{name}: {address}", options.quiet)
    return 0
