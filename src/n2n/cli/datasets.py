"""`n2n data list` and `n2n data verify`."""

import os
from collections.abc import Sequence
from pathlib import Path

from n2n.cli.console import progress_bar
from n2n.datamodules.catalog import DATASETS, Dataset, dataset
from n2n.datamodules.layouts import Part, data_folder
from n2n.errors import InputError, OutputError


def show() -> int:
    """Print what of every dataset is here."""
    root = data_folder()
    set_by = "N2N_DATA" if os.environ.get("N2N_DATA") else "N2N_DATA is not set"
    print(f"data folder: {root} ({set_by}{'' if root.is_dir() else '; no such folder'})\n")
    rows = [("dataset", "state", "here", "looked in")]
    for entry in DATASETS:
        parts = entry.find(root)
        rows.append((entry.name, state(parts), summary(parts), _folder(parts)))
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    for row in rows:
        print("  ".join(text.ljust(width) for text, width in zip(row, (*widths, 0), strict=True)).rstrip())
    print("\n`n2n data fetch NAME` gets a dataset or tells how; `n2n data verify` reads what is here.")
    return 0


def state(parts: Sequence[Part]) -> str:
    """Return present, partial or missing."""
    if not any(part.scans for part in parts):
        return "missing"
    needed = [part for part in parts if not part.optional]
    whole = has_scans(parts) and not any(part.with_truth and _truths(part) < len(part.scans) for part in needed)
    return "present" if whole else "partial"


def has_scans(parts: Sequence[Part]) -> bool:
    """Tell whether all scans are here, with or without their ground truth."""
    needed = [part for part in parts if not part.optional]
    return all(part.scans and len(part.scans) >= (part.expected or 1) for part in needed)


def summary(parts: Sequence[Part]) -> str:
    """Count the shapes of each part that is here, and the parts that are not."""
    here = [part for part in parts if part.scans]
    texts = [_count(part, named=len(parts) > 1) for part in here]
    absent = sum(not part.scans and not part.optional for part in parts)
    if not here:
        return "-"
    return "; ".join(texts) + (f"; {absent} more missing" if absent else "")


def output_folder(output: str | None) -> Path:
    """Return the data folder to write to.

    Raises:
        OutputError: A file is in the way, or the folder is marked read-only; an administrator could write there all the
            same, and would spoil data that others share.
    """
    folder = data_folder(output)
    nearest = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
    if not nearest.is_dir():
        raise OutputError(f"{folder}: {nearest} is a file, not a folder; choose another folder with -o")
    if not nearest.stat().st_mode & 0o222 or not os.access(nearest, os.W_OK):
        raise OutputError(f"{nearest}: is read-only; choose another folder with -o")
    return folder


def verify(name: str | None) -> int:
    """Read every file of one dataset, or of all; return 2 if something is bad.

    Raises:
        InputError: Nothing is there to read.
    """
    root = data_folder()
    entries = DATASETS if name is None else [dataset(name)]
    found = [(entry, part) for entry in entries for part in entry.find(root) if part.scans or part.problems]
    if not found:
        layout = f"; expected {entries[0].layout}; {entries[0].how()}" if name else "; see `n2n data list`"
        raise InputError(f"{root}: nothing of {name or 'any dataset'} found there{layout}")
    total, done, bad = sum(len(part.scans) for _, part in found), 0, 0
    lines = []
    with progress_bar("reading", quiet=False) as report:
        for entry, part in found:
            wrong = list(part.problems)
            for scan in part.scans:
                problem = _read(scan)
                wrong += [problem] if problem else []
                done += 1
                report(done, total, {})
            lines += [f"BAD {line}" for line in wrong]
            label = entry.name if part.label == entry.name else f"{entry.name} {part.label}"
            lines.append(f"{label}: {len(part.scans)} read, {len(wrong)} bad")
            bad += len(wrong)
    print("\n".join(lines))
    print(f"{total} files read: " + (f"{bad} problems" if bad else "all good"))
    return 2 if bad else 0


def _read(scan) -> str | None:
    """Read one shape; return what is wrong with it."""
    from n2n.datamodules.reading import read_scan

    try:
        read_scan(scan)
    except InputError as error:
        return str(error)
    return None


def _count(part: Part, named: bool) -> str:
    of = f" of {part.expected}" if part.expected and len(part.scans) <= part.expected else ""
    truths = _truths(part)
    with_truth = f" ({truths} with truth)" if part.with_truth and truths < len(part.scans) else ""
    return f"{part.label + ' ' if named else ''}{len(part.scans)}{of}{with_truth}"


def _truths(part: Part) -> int:
    return sum(scan.truth is not None and scan.truth.is_file() for scan in part.scans)


def _folder(parts: Sequence[Part]) -> str:
    """Return the folder of all that is here, else where it was looked for first."""
    here = [part.folder for part in parts if part.scans]
    return os.path.commonpath(here) if here else str(parts[0].folder)


def describe(entry: Dataset, parts: Sequence[Part]) -> str:
    """Say in one line what of a dataset is here."""
    return f"{entry.name}: {state(parts)}, {summary(parts)} in {_folder(parts)}"
