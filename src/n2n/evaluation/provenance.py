"""Which n2n computed a number."""

import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import n2n


@cache
def provenance(paths: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return version and, where n2n runs from its own checkout, commit and whether files differ from it.

    Args:
        paths: Files that count; empty: all that are tracked.
    """
    facts: dict[str, Any] = {"n2n": n2n.__version__, "commit": None, "modified": None}
    root = Path(n2n.__file__).parents[2]
    # An installed n2n may lie in the repository of something else.
    if (root / ".git").exists() and (root / "src" / "n2n").is_dir():
        counted = ("--", *paths) if paths else ("-uno",)
        commit, changes = _git(root, "rev-parse", "HEAD"), _git(root, "status", "--porcelain", *counted)
        if commit:
            facts |= {"commit": commit, "modified": bool(changes)}
    return facts


def _git(root: Path, *arguments: str) -> str:
    try:
        return subprocess.run(
            ["git", "-C", str(root), *arguments], capture_output=True, text=True, timeout=20, check=True
        ).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""
