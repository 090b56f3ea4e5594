"""Where results go, decided and checked before anything expensive starts."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from n2n.errors import OutputError
from n2n.formats import check_writable
from n2n.formats.atomic import ELSEWHERE, make_folder


def plan_outputs(output: str, paths: list[Path], extensions: tuple[str, ...], per_input: bool) -> list[Path]:
    """Decide which files will be written, and check that they can be; nothing is created yet.

    Args:
        output: What the user gave to -o: a file, or a folder (existing, or ending in a separator). Missing folders are
            no mistake; they are made with the first result.
        paths: The inputs.
        extensions: What this task can write.
        per_input: A folder gets one result per input; otherwise one result, named after the first.

    Raises:
        OutputError: Unknown extension, unwritable place, or a result that would overwrite an input or another result.
    """
    folder = Path(output)
    if not (output.endswith(("/", "\\")) or folder.is_dir()):
        targets = [folder]
    else:
        named = paths if per_input else paths[:1]
        targets = [folder / (p.name if p.suffix.lower() in extensions else f"{p.stem}{extensions[0]}") for p in named]
        if not targets:
            raise OutputError(f"{folder}: is a folder; give a file name with -o, as no input names the result")
        if len(set(targets)) < len(targets):
            raise OutputError(f"{folder}: two inputs have the same file name, so one result would overwrite the other")
    for target in targets:
        check_writable(target, extensions, new_folder=True)
    inputs = {path.resolve() for path in paths}
    for target in targets:
        if target.resolve() in inputs:
            raise OutputError(f"{target}: is an input; choose another name or folder with -o")
    return targets


def check_preview(preview: Path, folder: Path) -> None:
    """Check that a picture can be written, perhaps into the folder that the results will have made by then.

    Raises:
        OutputError: Not a .png, or an unwritable place.
    """
    check_writable(preview, (".png",), new_folder=preview.parent.absolute() == folder.absolute())


@contextmanager
def new_folder(folder: Path) -> Iterator[None]:
    """Create a folder for the result written inside; take it away again, if it is new and empty, when that fails."""
    missing = [part for part in (folder, *folder.parents) if not part.exists()]
    make_folder(folder, ELSEWHERE)
    try:
        yield
    except BaseException:
        with suppress(OSError):
            for part in missing:
                part.rmdir()
        raise
