"""What `n2n tables` does: one function per action."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from n2n.cli.console import progress_bar, say
from n2n.tables.plan import Job, Plan, estimate
from n2n.tables.run import run as run_plan
from n2n.tables.store import Store
from n2n.tables.write import write_tables


@dataclass(frozen=True)
class Request:
    """What was asked for.

    Attributes:
        plan: The tables and their fits.
        store: Where results are kept.
        out: Where tables are written.
        workers: Fits at a time.
        again: Also what other sources have measured.
    """

    plan: Plan
    store: Store
    out: Path
    workers: int = 1
    again: bool = False


def plan(request: Request) -> int:
    """Print what is there, what is missing and how long it takes."""
    plan, store = request.plan, request.store
    print(f"profile {plan.profile.name}: {plan.profile.title}\n")
    print(f"{'table':<34} {'fits':>6} {'to do':>6} {'hours here':>11} {'on a GPU':>9}  blanks")
    for table in plan.tables:
        jobs = _jobs(plan, table.name)
        blanks = sum(bool(cell.reason) for cell in plan.wanted[table.name])
        _print_row(table.name, jobs, store, plan, f"{blanks} of {len(plan.wanted[table.name])}" if blanks else "")
    _print_row("all, shared fits once", list(plan.jobs.values()), store, plan)
    for reason in sorted({cell.reason for cells in plan.wanted.values() for cell in cells if cell.reason}):
        print(f"blank: {reason}")
    if plan.profile.datamodule is None:
        partial = [cell for cells in plan.wanted.values() for cell in cells if cell.fits and not cell.whole]
        for note in sorted({cell.notes[-1] for cell in partial if cell.notes}):
            print(f"partial: {note}")
    print("\nnext: the same command with `run` in the place of `plan`")
    return 0


def run(request: Request) -> int:
    """Measure what is not done, write the tables; return 2 where a fit failed."""
    plan, store = request.plan, request.store
    todo, stale = plan.open(store), plan.stale(store)
    if stale and not request.again:
        say(f"tables: {len(stale)} results were made by other sources of n2n and are kept; --again measures them anew")
    total, done = len(todo) + (len(stale) if request.again else 0), 0
    with progress_bar(f"{total} fits, {len(plan.jobs) - len(todo)} done before") as report:

        def told(job: Job, error: str) -> None:
            nonlocal done
            done += 1
            if report:
                report(done, total, {})
            if error:
                say(f"failed: {_described(job)}: {error}")

        try:
            failures = run_plan(plan, store, request.workers, request.again, told)
        except KeyboardInterrupt as stop:
            raise KeyboardInterrupt("what was measured is kept; the same command goes on") from stop
    say(f"tables: {total - len(failures)} of {total} fits measured -> {store.folder}")
    render(request)
    return 2 if failures else 0


def status(request: Request) -> int:
    """Print how far it is, and what failed; return 2 where something did."""
    plan, store = request.plan, request.store
    for table in plan.tables:
        jobs = _jobs(plan, table.name)
        done = sum(plan.is_done(job, store) for job in jobs)
        print(f"{table.name:<34} {done:>4} of {len(jobs):>4} fits")
    failed = []
    for job in plan.jobs.values():
        record = store.read(job.fit)
        if record is not None and record["status"] == "failed":
            failed.append(f"failed: {_described(job)}: {record['error']}")
    print("\n".join([*failed, f"made by other sources: {len(plan.stale(store))}"]))
    return 2 if failed else 0


def render(request: Request) -> int:
    """Write the tables of what is there."""
    made = write_tables(request.plan, request.store, request.out)
    ours, blank = (sum(getattr(table, name) for table in made.values()) for name in ("ours", "blank"))
    say(
        f"tables: {len(made)} rendered, {ours} cells of ours, {blank} blank, each with its reason "
        f"-> {request.out / 'index.md'}"
    )
    return 0


def _jobs(plan: Plan, table: str) -> list[Job]:
    """Return the fits of a table, each once."""
    return [plan.jobs[fit] for fit in dict.fromkeys(fit for cell in plan.wanted[table] for fit in cell.fits)]


def _print_row(name: str, jobs: list[Job], store: Store, plan: Plan, blanks: str = "") -> None:
    todo = [job for job in jobs if not plan.is_done(job, store)]
    here, gpu = (sum(estimate(job, on_gpu) for job in todo) / 3600 for on_gpu in (False, True))
    print(f"{name:<34} {len(jobs):>6} {len(todo):>6} {here:>11.2f} {gpu:>9.2f}  {blanks}".rstrip())


def _described(job: Job) -> str:
    return f"{job.fit.datamodule} {job.fit.shape} ({' '.join(job.fit.settings)})"


ACTIONS: dict[str, Callable[[Request], int]] = {"plan": plan, "run": run, "status": status, "render": render}
