"""What `n2n tables` does: one function per action."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from n2n.cli.console import progress_bar, say
from n2n.sweeps.launchers import told_threads
from n2n.tables.launch import launch
from n2n.tables.methods import not_installed
from n2n.tables.plan import Job, Plan, estimate
from n2n.tables.run import run as run_plan
from n2n.tables.shared import failure, measured_now, open_jobs
from n2n.tables.spec import Fit
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
        launcher: Starts the workers; None: processes of this one.
        settings: Of the launcher.
    """

    plan: Plan
    store: Store
    out: Path
    workers: int = 1
    again: bool = False
    launcher: str | None = None
    settings: tuple[str, ...] = ()


def plan(request: Request) -> int:
    """Print what is there, what is missing and how long it takes."""
    plan, store = request.plan, request.store
    todo = {job.fit for job in open_jobs(plan, store, request.again)}
    print(f"profile {plan.profile.name}: {plan.profile.title}\n")
    print(f"{'table':<34} {'fits':>6} {'to do':>6} {'hours here':>11} {'on a GPU':>9}  blanks")
    for table in plan.tables:
        jobs = _jobs(plan, table.name)
        blanks = sum(bool(cell.reason) for cell in plan.wanted[table.name])
        _print_row(table.name, jobs, todo, f"{blanks} of {len(plan.wanted[table.name])}" if blanks else "")
    _print_row("all, shared fits once", list(plan.jobs.values()), todo)
    reasons = {cell.reason for cells in plan.wanted.values() for cell in cells if cell.reason}
    for reason in sorted(reasons | _not_installed(plan, store)):
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
    for line in _damaged(plan, store):
        say(f"{line}; measured again")
    todo = {job.fit for job in open_jobs(plan, store, request.again)}
    _tell_kept(request)
    total, before = len(todo), sum(plan.is_done(job, store) for fit, job in plan.jobs.items() if fit not in todo)
    measure = _measure_here if request.launcher is None else _measure_launched
    try:
        failures = measure(request, total, before)
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(str(stop) or "what was measured is kept; the same command goes on") from stop
    rest = {job.fit for job in open_jobs(plan, store, request.again)}
    say(f"tables: {total - len(rest)} of {total} fits measured -> {store.folder}")
    busy = {job.fit for job in measured_now(plan, store)}
    if busy:
        say(f"tables: {len(busy)} more are being measured by other processes; `n2n tables status` looks in")
    if lost := max(0, len(rest - busy) - len(failures)):
        say(f"tables: {lost} are left, their processes were lost; the same command goes on")
    render(request)
    return 2 if failures or lost else 0


def _tell_kept(request: Request) -> None:
    """Say which results were made by other sources and stay as they are."""
    lacks = Counter(not_installed(job.fit.method) for job in request.plan.stale(request.store))
    told = "results were made by other sources of n2n and are kept"
    if not request.again and lacks[""]:
        say(f"tables: {lacks['']} {told}; --again measures them anew")
    for reason in sorted(set(lacks) - {""}) if request.again else ():
        say(f"tables: {lacks[reason]} {told}: {reason}")


def _measure_here(request: Request, total: int, before: int) -> list[tuple[Job, str]]:
    """Measure in processes of this one; return the failures."""
    done = 0
    with progress_bar(f"{total} fits, {before} done before") as report:

        def told(job: Job, error: str) -> None:
            nonlocal done
            done += 1
            if report:
                report(done, total, {})
            if error:
                say(f"failed: {_described(job)}: {error}")

        return run_plan(request.plan, request.store, request.workers, request.again, told, threads=told_threads())


def _measure_launched(request: Request, total: int, before: int) -> list[tuple[Job, str]]:
    """Measure in workers that a launcher starts; return the failures."""
    workers = min(request.workers, total)
    say(f"tables: {total} fits, {before} done before, {workers} workers; `n2n tables status` looks in")
    try:
        failures = launch(
            request.plan, request.store, request.workers, request.launcher or "", request.settings, request.again
        )
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(
            "what was measured is kept; workers of a cluster go on (`n2n tables status` tells; scancel ends them)"
        ) from stop
    for job, error in failures:
        say(f"failed: {_described(job)}: {error}")
    return failures


def status(request: Request) -> int:
    """Print how far it is, what is being measured, what failed, what is damaged; return 2 for the last two."""
    plan, store = request.plan, request.store
    for table in plan.tables:
        jobs = _jobs(plan, table.name)
        done = sum(plan.is_done(job, store) for job in jobs)
        print(f"{table.name:<34} {done:>4} of {len(jobs):>4} fits")
    failed = []
    for job in plan.jobs.values():
        record = store.read(job.fit)
        if record is not None and (error := failure(record)):
            failed.append(f"failed: {_described(job)}: {error}")
    busy = [f"being measured: {_described(job)}" for job in measured_now(plan, store)]
    damaged = _damaged(plan, store)
    counts = [f"damaged: {len(damaged)}; `n2n tables run` measures them again"] if damaged else []
    blank = [f"blank: {reason}" for reason in sorted(_not_installed(plan, store))]
    print("\n".join([*busy, *failed, *damaged, *counts, *blank, f"made by other sources: {len(plan.stale(store))}"]))
    return 2 if failed or damaged else 0


def render(request: Request) -> int:
    """Write the tables of what is there; return 2 where a result is damaged."""
    made = write_tables(request.plan, request.store, request.out)
    ours, blank = (sum(getattr(table, name) for table in made.values()) for name in ("ours", "blank"))
    say(
        f"tables: {len(made)} rendered, {ours} cells of ours, {blank} blank, each with its reason "
        f"-> {request.out / 'index.md'}"
    )
    damaged = _damaged(request.plan, request.store)
    for line in damaged:
        say(f"{line}; left out, `n2n tables run` measures it again")
    return 2 if damaged else 0


def _jobs(plan: Plan, table: str) -> list[Job]:
    """Return the fits of a table, each once."""
    return [plan.jobs[fit] for fit in dict.fromkeys(fit for cell in plan.wanted[table] for fit in cell.fits)]


def _not_installed(plan: Plan, store: Store) -> set[str]:
    """Return which packages the fits lack that are neither done nor to be done here."""
    return {not_installed(job.fit.method) for job in plan.jobs.values() if not plan.is_done(job, store)} - {""}


def _damaged(plan: Plan, store: Store) -> list[str]:
    """Return a line for each result file that cannot be read."""
    records = (store.read(fit) for fit in plan.jobs)
    return [f"damaged: {r['error']}" for r in records if r is not None and r["status"] == "damaged"]


def _print_row(name: str, jobs: list[Job], todo: set[Fit], blanks: str = "") -> None:
    mine = [job for job in jobs if job.fit in todo]
    here, gpu = (sum(estimate(job, on_gpu) for job in mine) / 3600 for on_gpu in (False, True))
    print(f"{name:<34} {len(jobs):>6} {len(mine):>6} {here:>11.2f} {gpu:>9.2f}  {blanks}".rstrip())


def _described(job: Job) -> str:
    return f"{job.fit.datamodule} {job.fit.shape} ({' '.join(job.fit.settings)})"


ACTIONS: dict[str, Callable[[Request], int]] = {"plan": plan, "run": run, "status": status, "render": render}
