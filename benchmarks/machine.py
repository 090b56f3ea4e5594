"""Which machine, which sources: what a number means nothing without."""

import datetime
import hashlib
import os
import platform
import subprocess
from pathlib import Path
from typing import Any

from benchmarks import ROOT

_SOURCES = ("src/n2n", "conf", "benchmarks")


def describe() -> dict[str, Any]:
    """Return CPU, cores, threads, versions, date and commit."""
    import torch

    return {
        "cpu": _cpu(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "threads": torch.get_num_threads(),
        "gpu": torch.cuda.get_device_name() if torch.cuda.is_available() else None,
        "torch": torch.__version__,
        "python": platform.python_version(),
        "date": datetime.datetime.now().astimezone().isoformat(timespec="minutes"),
        "commit": commit(),
    }


def line(machine: dict[str, Any]) -> str:
    """Write a description in one line."""
    gpu = f", {machine['gpu']}" if machine["gpu"] else ""
    return (
        f"{machine['date'][:16].replace('T', ' ')}, commit {machine['commit']}, {machine['cpu']}, "
        f"{machine['cores']} cores{gpu}, "
        f"{machine['threads']} torch threads, torch {machine['torch']}, Python {machine['python']}"
    )


def commit() -> str:
    """Return the commit, and whether the sources differ from it."""
    name = _git("rev-parse", "--short", "HEAD")
    if not name:
        return "unknown"
    return f"{name} + changes" if _git("status", "--porcelain", "--", *_SOURCES) else name


def sources() -> str:
    """Return 10 hex digits that name the sources by content: results of other sources are measured again."""
    digest = hashlib.sha256()
    for path in sorted(p for folder in _SOURCES for p in (ROOT / folder).rglob("*") if p.suffix in {".py", ".yaml"}):
        digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:10]


def _git(*arguments: str) -> str:
    try:
        done = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _cpu() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for text in info.read_text().splitlines():
            if text.startswith("model name"):
                return text.partition(":")[2].strip()
    return platform.processor() or platform.machine()
