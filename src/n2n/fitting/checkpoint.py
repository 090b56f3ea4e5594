"""Checkpoints and fields on disk: plain dicts and tensors, there whole or not at all."""

import io
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import torch
from lightning.fabric.plugins import TorchCheckpointIO

from n2n.errors import InputError
from n2n.formats.atomic import atomic_path


def write_state(path: Path, state: dict[str, Any]) -> None:
    """Write nested dicts of numbers and tensors.

    Raises:
        OutputError: The folder cannot be written, or the disk is full.
    """
    # torch reports a full disk as an error of its own kind; written by ourselves it is an OSError like any other.
    content = io.BytesIO()
    torch.save(state, content)
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.getbuffer())


def read_state(path: Path) -> dict[str, Any]:
    """Read what `write_state` wrote, to the CPU.

    Raises:
        InputError: The file is damaged or something else.
    """
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except (RuntimeError, EOFError, ValueError, UnpicklingError) as error:
        raise unreadable(path, error) from error
    if not isinstance(state, dict):
        raise unreadable(path, TypeError(f"holds a {type(state).__name__}"))
    return state


def unreadable(path: Path, error: Exception) -> InputError:
    """Return the message for a file whose content is not what it should be."""
    reason = (str(error) or type(error).__name__).splitlines()[0]
    return InputError(f"{path} cannot be read as an n2n field ({reason}); delete it and fit again")


class AtomicCheckpointIO(TorchCheckpointIO):
    """Lightning's checkpoints written as `write_state` does: Lightning moves them between disks piece by piece."""

    def save_checkpoint(self, checkpoint: dict[str, Any], path: str | Path, storage_options: Any = None) -> None:
        write_state(Path(path), checkpoint)
