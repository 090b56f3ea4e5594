"""`n2n data`: the arguments; the work is in datasets, fetch and prepare beside this file."""

import argparse

_EPILOG = """\
The data folder is the one that the environment variable N2N_DATA names, else ./data.

examples:
  n2n data list                         what is here, what is missing
  n2n data fetch famous                 download and unpack, or print what to do by hand
  n2n data prepare pu -o data           Poisson-disk clouds of the PU meshes, and noisy examples
  n2n data verify srb                   read every file, name each bad one
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command and its arguments; imports nothing heavy."""
    plain = argparse.RawDescriptionHelpFormatter
    command = commands.add_parser(
        "data",
        help="benchmark data: what is here, what is missing, where to get it",
        description="Benchmark data: what is here, what is missing, where to get it.",
        epilog=_EPILOG,
        formatter_class=plain,
    )
    command.set_defaults(run_command=run)
    actions = command.add_subparsers(dest="action", metavar="ACTION", required=True)
    actions.add_parser("list", help="a table of all datasets: present, partial or missing")

    fetch = actions.add_parser(
        "fetch",
        help="download a dataset, or print the steps where a person is needed",
        description="Download and unpack a dataset. An interrupted download goes on where it stopped. Exit code 1: "
        "nothing can be downloaded without you; the steps are printed.",
        epilog="examples:\n  n2n data fetch famous\n  n2n data fetch abc -o /data/benchmarks",
        formatter_class=plain,
    )
    fetch.add_argument("name", metavar="NAME", help="a dataset of `n2n data list`")
    fetch.add_argument("-o", "--output", metavar="DIR", help="data folder to put it in (N2N_DATA, else data)")

    prepare = actions.add_parser(
        "prepare",
        help="make clean clouds with exact counts and noisy examples of pu or pc",
        description="Write clean clouds with exactly the counts asked for and noisy examples, in the layout of "
        "score-denoise, with a record of samplers, seeds and sources beside them.",
        epilog="examples:\n  n2n data prepare pu -o data\n  n2n data prepare pu -o data --points 10000 --noise 0.02",
        formatter_class=plain,
    )
    prepare.add_argument("name", metavar="NAME", choices=["pu", "pc"], help="pu or pc")
    prepare.add_argument("-o", "--output", metavar="DIR", help="data folder to write to (N2N_DATA, else data)")
    prepare.add_argument("--points", metavar="N", type=int, nargs="+", default=[10_000, 50_000], help="(10000 50000)")
    prepare.add_argument(
        "--noise",
        metavar="S",
        nargs="+",
        default=["0.01", "0.02", "0.03"],
        help="standard deviations relative to the radius of the clean cloud (0.01 0.02 0.03)",
    )
    prepare.add_argument("--seed", metavar="S", type=int, default=0, help="seed of clouds and noise (0)")

    verify = actions.add_parser(
        "verify",
        help="read every file, name each bad one",
        description="Read every file that is here as a fit would, name each bad one and what was expected. Exit code "
        "2: something is bad.",
        epilog="examples:\n  n2n data verify\n  n2n data verify famous",
        formatter_class=plain,
    )
    verify.add_argument("name", metavar="NAME", nargs="?", help="a dataset of `n2n data list` (all that are here)")


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    if options.action == "fetch":
        from n2n.cli.fetch import fetch

        return fetch(options.name, options.output)
    if options.action == "prepare":
        from n2n.cli.prepare import prepare

        return prepare(options.name, options.output, options.points, options.noise, options.seed)
    from n2n.cli.datasets import show, verify

    return show() if options.action == "list" else verify(options.name)
