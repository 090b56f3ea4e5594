"""The arguments of every command."""

import argparse
from collections.abc import Sequence
from typing import NoReturn

from n2n import __version__
from n2n.cli import dashboard, data, evaluate, figure, sweeps, tables
from n2n.config import DEVICES, check_seed
from n2n.errors import ConfigError
from n2n.registry import suggest

_EPILOG = """\
examples:
  n2n reconstruct scan.ply -o mesh.ply                 a noisy scan in, a clean mesh out
  n2n reconstruct a.ply b.ply c.ply -o mesh.ply        several observations of the same thing
  n2n denoise scan.xyz -o clean.xyz                    same points, same order, on the surface
  n2n upsample scan.xyz --rate 4 -o dense.xyz
  n2n demo                                             see it work on a bundled scan
  n2n fit recipe=paper datamodule=files 'datamodule.paths=[scan.ply]'

`n2n COMMAND --help` tells more. Settings are `key=value`, e.g. seed=1; `n2n fit --cfg job` prints them all.
"""
_SETTINGS = """settings:
  key=value             a setting of the fit, e.g. iterations=500 or recipe=paper;
                        `n2n fit --cfg job` lists the keys; quote brackets: 'key=[a,b]'
"""
_READS = "ply xyz txt csv pts npy npz off obj stl pcd las laz bin"
_WRITES = {"reconstruct": "ply obj off stl glb", "denoise": "ply xyz txt csv npy npz pcd las laz"}
_TASKS = {
    "reconstruct": (
        "noisy points to a mesh",
        "n2n reconstruct scan.ply -o mesh.ply --resolution 400 --preview picture.png\n"
        "  n2n reconstruct a.ply b.ply c.ply -o mesh.ply --edge 0.5\n"
        "  n2n reconstruct --run runs/0123456789 -o mesh.ply",
    ),
    "denoise": (
        "move every point onto the surface",
        "n2n denoise scan.xyz -o clean.xyz\n  n2n denoise a.ply b.ply c.ply -o clean/      one result per observation",
    ),
    "upsample": ("denoise and add points on the surface", "n2n upsample scan.xyz --rate 4 -o dense.xyz"),
}


QUALITIES = {"draft": 0.4, "normal": 1.0, "best": 3.0}  # factor on the iterations


class _Parser(argparse.ArgumentParser):
    """A parser whose complaints are one line like every other error, not a usage text and a line."""

    def error(self, message: str) -> NoReturn:
        raise ConfigError(f"{message}; see `{self.prog} --help`")


def parser() -> argparse.ArgumentParser:
    """Build the argument parser."""
    top = _Parser(
        prog="n2n",
        description="Clean surfaces from noisy point clouds, learned from the noise itself.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"n2n {__version__}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for task, (summary, examples) in _TASKS.items():
        _add_task(commands, task, summary, examples)
    fit = commands.add_parser("fit", help="fit a field and keep the run folder (the Hydra application)", add_help=False)
    fit.add_argument("overrides", nargs=argparse.REMAINDER)
    for command in (sweeps, evaluate, data, tables, figure, dashboard):
        command.add(commands)
    demo = commands.add_parser("demo", help="see the main job on a bundled noisy scan")
    demo.add_argument("-o", "--output", default="out/demo", metavar="DIR", help="folder for the results (out/demo)")
    listing = commands.add_parser("list", help="every registered component, one line each")
    listing.add_argument("kind", nargs="?", help="only this kind, e.g. distance")
    commands.add_parser("doctor", help="versions, devices, what is missing and what to do about it")
    return top


def _seed(text: str) -> int:
    try:
        seed = int(text)
        check_seed(seed)
    except ValueError:
        raise argparse.ArgumentTypeError(f"invalid int value: {text!r}") from None
    except ConfigError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return seed


def _add_task(commands: argparse._SubParsersAction, task: str, summary: str, examples: str) -> None:
    command = commands.add_parser(
        task,
        help=summary,
        usage=f"n2n {task} FILE [FILE ...] -o OUTPUT [options] [key=value ...]",
        description=f"{summary[0].upper()}{summary[1:]}. Several files are several observations of one thing.",
        epilog=f"{_SETTINGS}\nexamples:\n  {examples}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    writes = _WRITES.get(task, _WRITES["denoise"])
    command.add_argument("inputs", nargs="*", metavar="FILE", help=f"noisy points: {_READS}")
    command.add_argument(
        "-o", "--output", required=True, metavar="OUTPUT", help=f"file or folder/, made if missing: {writes}"
    )
    if task == "reconstruct":
        command.add_argument(
            "--resolution",
            type=int,
            default=256,
            metavar="N",
            help="voxels along the longest side of the field's box, about a tenth wider than the scan (256)",
        )
        command.add_argument("--edge", type=float, metavar="LENGTH", help="voxel edge in the scan's units instead")
    if task == "upsample":
        command.add_argument("--rate", type=int, default=4, metavar="R", help="points out per point in (4)")
    if task != "reconstruct":
        command.add_argument("--even", action="store_true", help="also spread the points evenly along the surface")
        command.add_argument(
            "--remove-outliers", action="store_true", help="drop points that look like outliers; else they stay"
        )
    command.add_argument(
        "--quality", default="normal", choices=list(QUALITIES), help="less or more of the machine's time (normal)"
    )
    command.add_argument("--preview", metavar="PNG", help="also draw before and after")
    command.add_argument("--run", metavar="RUN", help="use the field of a run folder, no new fit")
    command.add_argument(
        "--shape", type=int, default=0, metavar="K", help="which shape of a run that holds several (0)"
    )
    command.add_argument("--device", default="auto", choices=DEVICES, help="where to compute (auto)")
    command.add_argument("--seed", type=_seed, default=0, metavar="S", help="seed of everything random (0)")
    command.add_argument("-q", "--quiet", action="store_true", help="no progress bar, no summary")


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Parse a command line; files and settings may stand before, between and after the options.

    `n2n fit` keeps its arguments as they are: Hydra parses them.
    """
    if arguments[:1] == ["fit"]:
        return argparse.Namespace(command="fit", overrides=list(arguments[1:]))
    top = parser()
    commands = next(action for action in top._actions if isinstance(action, argparse._SubParsersAction)).choices
    if not arguments:
        raise ConfigError(f"no command given; choose one of: {', '.join(commands)}; see `n2n --help`")
    if not arguments[0].startswith("-") and arguments[0] not in commands:
        raise ConfigError(f"Unknown command {arguments[0]!r}.{suggest(arguments[0], list(commands))}")
    options, rest = top.parse_known_args(arguments)
    unknown = [text for text in rest if text.startswith("-")]
    if unknown or (rest and not hasattr(options, "inputs")):
        _refuse(commands[options.command], (unknown or rest)[0])
    if rest:
        options.inputs += rest
    return options


def _refuse(command: argparse.ArgumentParser, argument: str) -> NoReturn:
    flags = [flag for action in command._actions for flag in action.option_strings if flag.startswith("--")]
    hint = suggest(argument.partition("=")[0], flags) if argument.startswith("-") else ""
    raise ConfigError(f"{command.prog} does not know the argument {argument!r}.{hint} See `{command.prog} --help`")
