"""What a person sees while a command works: one progress bar, then a summary."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

Report = Callable[[int, int, dict[str, float]], None]
_console = Console(stderr=True, highlight=False)


def say(text: str, quiet: bool = False) -> None:
    """Print a line on standard error, where it does not mix with data."""
    if not quiet:
        _console.print(text, markup=False, soft_wrap=True)


@contextmanager
def silenced() -> Iterator[None]:
    """Say nothing and show no bar while the block runs: somebody else reports for many."""
    before, _console.quiet = _console.quiet, True
    try:
        yield
    finally:
        _console.quiet = before


@contextmanager
def progress_bar(label: str, quiet: bool = False) -> Iterator[Report | None]:
    """Yield a function `report(done, total, values)` that moves one bar; None when quiet.

    Where standard error is a file or a pipe, only the label is printed, at the first report: what fails before there is
    progress leaves its error message alone on the screen.
    """
    if quiet or _console.quiet:
        yield None
        return
    if not _console.is_terminal:
        yield _announcing(label)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f}%"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=_console, transient=True) as progress:
        task = progress.add_task(label, total=None)

        def report(done: int, total: int, values: dict[str, float]) -> None:
            progress.update(task, completed=done, total=total)

        yield report


def _announcing(label: str) -> Report:
    """Return a report that prints the label once."""
    announced = False

    def report(done: int, total: int, values: dict[str, float]) -> None:
        nonlocal announced
        if not announced:
            announced = True
            say(f"{label} ...")

    return report
