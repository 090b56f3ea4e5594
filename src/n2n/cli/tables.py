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
    command.add_argument("tables", nargs="*", metavar="TABLE", help="e.g. T01; all by default")
    command.add_argument("--profile", default="laptop", metavar="P", help="smoke, laptop or paper (laptop)")
    command.add_argument(
        "--results", type=Path, metavar="DIR", help="where results are kept, one file per fit (results/PROFILE)"
    )
    command.add_argument("--out", type=Path, metavar="DIR", help="where tables are written (out/tables/PROFILE)")
    command.add_argument("--workers", type=int, default=1, metavar="K", help="fits at a time (1)")
    command.add_argument("--again", action="store_true", help="run: also what older sources have measured")
    command.set_defaults(run_command=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code: 2 where a fit failed."""
    from n2n.errors import ConfigError
    from n2n.tables.plan import make_plan
    from n2n.tables.spec import load_profile
    from n2n.tables.store import Store

    if options.workers < 1:
        raise ConfigError(f"--workers {options.workers} is out of range; give a number >= 1")
    plan = make_plan(options.tables, load_profile(options.profile))
    store = Store(options.results or Path("results") / options.profile)
    out = options.out or Path("out/tables") / options.profile
    return {"plan": _plan, "run": _run, "status": _status, "render": _render}[options.action](plan, store, out, options)


def _plan(plan, store, out, options) -> int:
    from n2n.tables.plan import estimate

    print(f"profile {plan.profile.name}: {plan.profile.title}\n")
    print(f"{'table':<34} {'fits':>6} {'to do':>6} {'hours here':>11} {'on a GPU':>9}  missing")
    for table in plan.tables:
        fits = {fit for cell in plan.wanted[table.name] for fit in cell.fits}
        open_jobs = [plan.jobs[fit] for fit in fits if not plan.is_done(plan.jobs[fit], store)]
        hours = [sum(estimate(job, gpu) for job in open_jobs) / 3600 for gpu in (False, True)]
        blank = sorted({cell.reason for cell in plan.wanted[table.name] if cell.reason})
        missing = f"{len(blank)} reasons for blanks" if len(blank) > 1 else "".join(blank)
        print(f"{table.name:<34} {len(fits):>6} {len(open_jobs):>6} {hours[0]:>11.2f} {hours[1]:>9.2f}  {missing}")
    todo = plan.open(store)
    total = [sum(estimate(job, gpu) for job in todo) / 3600 for gpu in (False, True)]
    print(f"{'all, shared fits once':<34} {len(plan.jobs):>6} {len(todo):>6} {total[0]:>11.2f} {total[1]:>9.2f}")
    for reason in sorted({c.reason for cells in plan.wanted.values() for c in cells if c.reason}):
        print(f"blank: {reason}")
    print(f"\nnext: n2n tables run --profile {plan.profile.name}")
    return 0


def _run(plan, store, out, options) -> int:
    from n2n.cli.console import progress_bar, say
    from n2n.tables.run import run as run_plan

    todo = plan.open(store)
    stale = plan.stale(store)
    if stale and not options.again:
        say(f"tables: {len(stale)} results were made by other sources of n2n and are kept; --again measures them anew")
    total, done = len(todo) + (len(stale) if options.again else 0), 0
    with progress_bar(f"{total} fits, {len(plan.jobs) - len(todo)} done before") as report:

        def told(job, error: str) -> None:
            nonlocal done
            done += 1
            if report:
                report(done, total, {})
            if error:
                say(f"failed: {job.fit.datamodule} {job.fit.shape} ({' '.join(job.fit.settings)}): {error}")

        failures = run_plan(plan, store, options.workers, options.again, told)
    say(f"tables: {total - len(failures)} of {total} fits measured -> {store.folder}")
    _write(plan, store, out)
    return 2 if failures else 0


def _status(plan, store, out, options) -> int:
    failed = []
    for table in plan.tables:
        jobs = [plan.jobs[fit] for fit in {fit for cell in plan.wanted[table.name] for fit in cell.fits}]
        done = sum(plan.is_done(job, store) for job in jobs)
        print(f"{table.name:<34} {done:>4} of {len(jobs):>4} fits")
    for fit in plan.jobs:
        record = store.read(fit)
        if record is not None and record["status"] == "failed":
            failed.append(f"failed: {fit.datamodule} {fit.shape} ({' '.join(fit.settings)}): {record['error']}")
    print("\n".join([*failed, f"made by other sources: {len(plan.stale(store))}"]))
    return 2 if failed else 0


def _render(plan, store, out, options) -> int:
    _write(plan, store, out)
    return 0


def _write(plan, store, out) -> None:
    from n2n.cli.console import say
    from n2n.tables.write import write_tables

    made = write_tables(plan, store, out)
    ours, blank = (sum(getattr(table, name) for table in made.values()) for name in ("ours", "blank"))
    say(
        f"tables: {len(made)} rendered, {ours} cells of ours, {blank} blank, each with its reason -> {out / 'index.md'}"
    )
