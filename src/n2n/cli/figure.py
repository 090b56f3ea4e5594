"""`n2n figure`: the paper's figures, drawn from fits of one's own."""

import argparse
import time

_EPILOG = """\
settings:
  shape=NAME            bracket, sphere, torus, or a PU-Net test shape where its data is present (bracket)
  scan=FILE             a noisy scan of your own instead of a shape
  points=N noise=S      of the shape's scan; S relative to the bounding radius
  seed=K                of the scan and of the fit (0)
  size=PIXELS           size of a panel's longer side (480)
  resolution=N          voxels along the longest side of the surfaces shown (128)
  key=value             any setting of the fit, e.g. effort=3

examples:
  n2n figure list
  n2n figure denoising -o denoising.png noise=0.02
  n2n figure level_sets -o levels.png scan=my_scan.ply
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command and its arguments; imports nothing heavy."""
    command = commands.add_parser(
        "figure",
        help="the paper's figures, drawn from fits of one's own",
        usage="n2n figure NAME -o FILE.png [key=value ...] | n2n figure list",
        description="Draw a figure: fits what it shows, writes a PNG, keeps nothing else.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("name", metavar="NAME", help="which figure; `n2n figure list` names them")
    command.add_argument("inputs", nargs="*", metavar="key=value", help="settings, see below")
    command.add_argument("-o", "--output", metavar="FILE.png", help="picture to write")
    command.add_argument("-q", "--quiet", action="store_true", help="no progress, no summary")
    command.set_defaults(run_command=run)


def run(options: argparse.Namespace) -> int:
    """Draw one figure, or list them; return the exit code."""
    from n2n.report.figures import FIGURES, draw_figure, find

    if options.name == "list":
        for name, figure in FIGURES.items():
            print(f"{name:<16} {figure.summary}")
        return 0
    from pathlib import Path

    from n2n.cli.console import progress_bar, say
    from n2n.cli.outputs import new_folder
    from n2n.errors import OutputError
    from n2n.formats import check_writable

    start = time.perf_counter()
    find(options.name)
    if not options.output:
        raise OutputError(f"no picture to write; give one with -o {options.name}.png")
    path = Path(options.output)
    check_writable(path, (".png",), new_folder=True)
    with new_folder(path.parent):
        draw_figure(options.name, path, options.inputs, lambda label: progress_bar(label, options.quiet))
    say(f"figure {options.name} -> {path}  ({time.perf_counter() - start:.0f} s)", options.quiet)
    return 0
