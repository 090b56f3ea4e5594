"""`n2n data fetch`."""

from pathlib import Path

from n2n.cli.console import progress_bar, say
from n2n.cli.datasets import describe, has_scans, output_folder, state
from n2n.datamodules.catalog import Dataset, Link, dataset
from n2n.datamodules.download import download
from n2n.datamodules.layouts import data_folder
from n2n.datamodules.unpack import unpack

DONE, BY_HAND = 0, 1


def fetch(name: str, output: str | None) -> int:
    """Download and unpack a dataset; print the steps for what only a person can get.

    Returns:
        0: something was downloaded, or all of it is here already; 1: all of it has to be got by hand.
    """
    entry, folder = dataset(name), data_folder(output)
    parts = entry.find(folder)
    if state(parts) == "present":
        print(f"{describe(entry, parts)}: nothing to do")
        return DONE
    print(f"{entry.title}\nlicence: {entry.licence}", flush=True)
    links = [link for link in entry.links if link.brings_truth or not has_scans(parts)]
    if links:
        output_folder(output)
    for link in links:
        _get(link, folder)
    if links or any(part.scans for part in parts):
        _report(entry, folder)
    if entry.steps:
        print(f"{'for the rest' if links else 'to be got by hand'}:")
        for number, step in enumerate(entry.steps, 1):
            print(f"  {number}. {step.format(folder=folder)}")
        print(f"the folders must look like: {entry.layout}")
    if folder != data_folder():
        print(f"set N2N_DATA={folder} to use it")
    return DONE if links else BY_HAND


def _get(link: Link, folder: Path) -> None:
    """Download an archive, unpack it, remove it; what was interrupted goes on."""
    archive, target = folder / link.file, folder / link.folder
    if not archive.exists():
        say(f"{link.url} ({link.note})")
        with progress_bar(f"downloading {link.file}") as report:
            download(link.url, archive, lambda done, total: report(done, total, {}))
    with progress_bar(f"unpacking {link.file}") as report:
        count = unpack(archive, target, lambda done, total: report(done, total, {}))
    archive.unlink()
    say(f"{count} files of {link.file} unpacked in {target}")


def _report(entry: Dataset, folder: Path) -> None:
    parts = entry.find(folder)
    print(describe(entry, parts))
    if state(parts) == "missing":
        print(f"the archive holds no folder of the expected layout; move its files to: {entry.layout}")
