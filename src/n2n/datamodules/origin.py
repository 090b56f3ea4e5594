"""Where a file comes from: the benchmark, or this program. Imports no torch."""

from pathlib import Path

from n2n.datamodules.layouts import data_folder


def shown(path: Path, root: str | None) -> str:
    """Return how a file is named in `source`: below the data folder, the same on every machine."""
    return _below(path, root) + (" (made by n2n data prepare)" if is_made(path, root) else "")


def is_made(path: Path, root: str | None) -> bool:
    """Tell files that `n2n data prepare` made from the benchmark's own, in whose places they lie."""
    records = data_folder(root).glob("n2n-prepared-*.json")
    return any(f'"{_below(path, root)}"' in record.read_text() for record in records)


def _below(path: Path, root: str | None) -> str:
    folder = data_folder(root)
    return (path.relative_to(folder) if path.is_relative_to(folder) else path).as_posix()
