"""Commands in processes of their own: wall time and peak memory."""

import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks import ROOT


@dataclass(frozen=True)
class Usage:
    """What a command took.

    Attributes:
        seconds: Wall time from its start to its end.
        peak: Largest resident memory, bytes.
        output: Its standard output.
    """

    seconds: float
    peak: int
    output: str


def measure(command: Sequence[str]) -> Usage:
    """Run a command, given by its full path, in the root of the repository.

    Raises:
        RuntimeError: It failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "usage.json"
        launcher = [sys.executable, "-S", str(ROOT / "benchmarks" / "launcher.py"), str(result)]
        done = subprocess.run([*launcher, *command], cwd=ROOT, capture_output=True, text=True, check=False)
        usage = json.loads(result.read_text()) if result.exists() else {"code": done.returncode}
    if usage["code"]:
        raise RuntimeError(f"{' '.join(command)} failed with code {usage['code']}: {done.stderr.strip()[-600:]}")
    return Usage(usage["seconds"], usage["peak"], done.stdout)


def child(module: str, *arguments: object) -> dict[str, Any]:
    """Run a module of this package whose last line of output is JSON; return that."""
    usage = measure([sys.executable, "-m", f"benchmarks.{module}", *map(str, arguments)])
    return json.loads(usage.output.splitlines()[-1])


def n2n(*arguments: object) -> Usage:
    """Run the command `n2n` as installed beside this Python."""
    return measure([str(Path(sys.executable).parent / "n2n"), *map(str, arguments)])


def peak_memory() -> int:
    """Return the largest resident memory of this process so far, bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def resident_memory() -> int:
    """Return the resident memory of this process now, bytes; where it is not known, the largest so far."""
    status = Path("/proc/self/statm")
    return int(status.read_text().split()[1]) * resource.getpagesize() if status.exists() else peak_memory()
