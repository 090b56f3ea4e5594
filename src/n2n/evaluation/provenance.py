"""Which n2n computed a number."""

import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import n2n


@cache
def provenance() -> dict[str, Any]:
    """Return version and, where n2n runs from its own checkout, commit and whether files differ from it."""
    facts: dict[str, Any] = {"n2n": n2n.__version__, "commit": None, "modified": None}
    root = Path(n2n.__file__).parents[2]
    # An installed n2n may lie in the repository of something else.
    if (root / ".git").exists() and (root / "src" / "n2n").is_dir():
        commit, changes = (
            _git(root, *arguments) for arguments in (("rev-parse", "HEAD"), ("status", "--porcelain", "-uno"))
        )
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
