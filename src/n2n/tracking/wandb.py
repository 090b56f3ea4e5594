"""W&B's process, kept to itself: what it writes, what it prints, whether it would let this user in."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from n2n.errors import ConfigError


@contextmanager
def wandb_at(folder: Path) -> Iterator[None]:
    """Let W&B keep everything it writes in `folder`/wandb; stop its process at the end, and be as before."""
    before = _settings()
    os.environ["WANDB_ERROR_REPORTING"] = "false"
    for kind in ("CACHE", "DATA", "CONFIG"):
        os.environ.setdefault(f"WANDB_{kind}_DIR", str(folder.resolve() / "wandb" / kind.lower()))
    try:
        yield
    finally:
        if "wandb" in sys.modules:
            sys.modules["wandb"].teardown()
        # Lightning sets WANDB_MODE, which would outlive the run.
        for key in _settings():
            del os.environ[key]
        os.environ.update(before)


def require_login(what: str, instead: str) -> None:
    """Raise ConfigError unless the user is logged in to W&B; looks at this machine only and asks nobody.

    Args:
        what: Needs it.
        instead: What can be done without.
    """
    import wandb

    if not wandb.login(prompt=False, verify=False):
        raise ConfigError(f"{what} needs a login to W&B; run `wandb login`, or {instead}")


def _settings() -> dict[str, str]:
    return {key: value for key, value in os.environ.items() if key.startswith("WANDB_")}
