"""`n2n`: the argument parser and the one place where errors become exit codes."""

import argparse
import sys
from collections.abc import Sequence

from n2n import __version__
from n2n.errors import N2NError

_EPILOG = """\
examples:
  n2n reconstruct scan.ply -o mesh.ply                 a noisy scan in, a clean mesh out
  n2n reconstruct a.ply b.ply c.ply -o mesh.ply        several observations of the same thing
  n2n denoise scan.xyz -o clean.xyz                    same points, same order, on the surface
  n2n upsample scan.xyz --rate 4 -o dense.xyz
  n2n demo                                             see it work on a bundled scan
  n2n fit recipe=paper datamodule=files datamodule.paths=[scan.ply]

`n2n COMMAND --help` tells more. Settings are `key=value`, e.g. seed=1; `n2n fit --cfg job` prints them all.
"""


def parser() -> argparse.ArgumentParser:
    """Build the argument parser."""
    top = argparse.ArgumentParser(
        prog="n2n",
        description="Clean surfaces from noisy point clouds, learned from the noise itself.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"n2n {__version__}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)

    verbs = {
        "reconstruct": ("noisy points to a mesh", "MESH", "n2n reconstruct scan.ply -o mesh.ply --resolution 256"),
        "denoise": ("move every point onto the surface", "CLOUD", "n2n denoise scan.xyz -o clean.xyz"),
        "upsample": ("denoise and add points on the surface", "CLOUD", "n2n upsample scan.xyz --rate 4 -o dense.xyz"),
    }
    for verb, (summary, output, example) in verbs.items():
        command = commands.add_parser(
            verb, help=summary, description=summary.capitalize() + ".", epilog=f"example: {example}"
        )
        command.add_argument(
            "inputs",
            nargs="+",
            metavar="FILE | key=value",
            help="noisy clouds, all observations of one thing (ply xyz txt csv pts npy npz off obj stl pcd las laz bin), "
            "and settings",
        )
        command.add_argument("-o", "--output", required=True, metavar=output, help="file; a folder for one result per input")
        if verb == "reconstruct":
            command.add_argument("--resolution", type=int, default=256, help="voxels along the longest side (256)")
            command.add_argument("--edge", type=float, help="voxel edge in the scan's units, instead of --resolution")
        if verb == "upsample":
            command.add_argument("--rate", type=int, default=4, help="points out per point in (4)")
        command.add_argument("--run", metavar="RUN", help="use the field of a run folder, no new fit")
        command.add_argument("--preview", metavar="PNG", help="also draw before and after")
        command.add_argument("--device", default="auto", help="auto, cpu, cuda or mps")
        command.add_argument("--seed", type=int, default=0, help="seed of everything random (0)")
        command.add_argument("-q", "--quiet", action="store_true", help="no progress bar, no summary")

    commands.add_parser(
        "fit",
        help="fit a field and keep the run folder (the Hydra application)",
    )

    demo = commands.add_parser("demo", help="see the main job on a bundled noisy scan")
    demo.add_argument("-o", "--output", default="out/demo", metavar="DIR", help="folder for the results (out/demo)")
    listing = commands.add_parser("list", help="every registered component, one line each")
    listing.add_argument("kind", nargs="?", help="only this kind, e.g. distance")
    commands.add_parser("doctor", help="versions, devices, what is missing and what to do about it")
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; return the exit code: 0 done, 1 something is missing (doctor), 2 an error, 130 interrupted."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    try:
        if arguments[:1] == ["fit"]:
            # Hydra parses its own command line.
            from n2n.cli.fit import run_fit

            return run_fit(arguments[1:])
        return _dispatch(_parse(arguments))
    except N2NError as error:
        print(f"n2n: error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("n2n: interrupted; nothing was written", file=sys.stderr)
        return 130
    except BrokenPipeError:
        sys.stderr.close()
        return 0


def _parse(arguments: list[str]) -> argparse.Namespace:
    """Parse, letting files and settings stand after options too (`-o mesh.ply seed=1`)."""
    top = parser()
    options, rest = top.parse_known_args(arguments)
    unknown = [word for word in rest if word.startswith("-")]
    if unknown or (rest and not hasattr(options, "inputs")):
        top.error(f"unrecognized arguments: {' '.join(unknown or rest)}")
    if rest:
        options.inputs += rest
    return options


def _dispatch(options: argparse.Namespace) -> int:
    if options.command == "list":
        from n2n.cli.listing import run_list

        return run_list(options.kind)
    if options.command == "doctor":
        from n2n.cli.doctor import run_doctor

        return run_doctor()
    if options.command == "demo":
        from n2n.cli.demo import run_demo

        return run_demo(options.output)
    from n2n.cli.work import run_work

    return run_work(options)


if __name__ == "__main__":
    sys.exit(main())
