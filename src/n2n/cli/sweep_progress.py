"""What a person sees of a sweep: one bar for all of it; in a file or a pipe, one line for each run that ends."""

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from n2n.sweeps.store import RunInfo
from n2n.sweeps.watch import Watch

_EVERY = 0.5  # seconds between looks


@contextmanager
def watching(watch: Watch) -> Iterator[None]:
    """Show how runs end while the block runs."""
    # A console of its own: those who fit in this process are told to be silent.
    console = Console(stderr=True, highlight=False)
    with _bar(watch, console) if console.is_terminal else _lines(watch, console) as show:
        stop = threading.Event()
        thread = threading.Thread(target=_look, args=(watch, show, stop), daemon=True)
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join()


def _look(watch: Watch, show: Callable[[list[RunInfo]], None], stop: threading.Event) -> None:
    while not stop.wait(_EVERY):
        show(watch.look())
    show(watch.look())


@contextmanager
def _bar(watch: Watch, console: Console) -> Iterator[Callable[[list[RunInfo]], None]]:
    columns = (
        TextColumn("sweep"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("starting", total=None if watch.wanted is None else len(watch.wanted))

        def show(news: list[RunInfo]) -> None:
            for run in news:
                if run.state == "failed":
                    progress.console.print(line(watch, run), markup=False, soft_wrap=True)
            failed, running = watch.count("failed"), watch.states["running"]
            progress.update(task, completed=len(watch.ended), description=f"{failed} failed, {running} running")

        yield show


@contextmanager
def _lines(watch: Watch, console: Console) -> Iterator[Callable[[list[RunInfo]], None]]:
    shown = 0

    def show(news: list[RunInfo]) -> None:
        nonlocal shown
        for run in news:
            shown += 1
            console.print(line(watch, run, shown), markup=False, soft_wrap=True)
        sys.stderr.flush()

    yield show


def line(watch: Watch, run: RunInfo, number: int | None = None) -> str:
    """Return what is said about a run that ended."""
    total = "" if watch.wanted is None else f"/{len(watch.wanted)}"
    count = "" if number is None else f"{number}{total} "
    time = "" if run.seconds is None else f"  ({run.seconds:.1f} s)"
    return f"{count}{run.state}: {run.label}{f': {run.error}' if run.error else ''}{time}"
