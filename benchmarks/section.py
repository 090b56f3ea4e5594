"""One section in a process of its own: `python -m benchmarks.section NAME RESULT.json [--trial]`."""

import importlib
import json
import sys
import time
from pathlib import Path
from typing import Any

from benchmarks import machine

NAMES = ("matching", "step", "extraction", "metrics", "overhead", "job", "scaling", "sweep", "dashboard", "gpu")


def module(name: str) -> Any:
    """Return the module of a section: TITLE, TRIAL, `run(...) -> plain data` and `render(data) -> Markdown`."""
    return importlib.import_module(f"benchmarks.{name}")


def measure(name: str, trial: bool = False) -> dict[str, Any]:
    """Run a section, at full size or at the size of a trial, and say where, when and with which sources."""
    section, sources, start = module(name), machine.sources(), time.perf_counter()
    result = section.run(**(section.TRIAL if trial else {}))
    return {
        "section": name,
        "title": section.TITLE,
        "trial": trial,
        "sources": sources,
        "machine": machine.describe(),
        "seconds": round(time.perf_counter() - start, 1),
        "result": result,
        "markdown": section.render(result),
    }


def write(name: str, path: str, trial: bool = False) -> None:
    """Run a section and write what it found, whole or not at all."""
    stored = json.dumps(measure(name, trial), indent=1)
    partial = Path(path).with_suffix(".partial")
    partial.write_text(stored + "\n")
    partial.replace(path)


if __name__ == "__main__":
    write(sys.argv[1], sys.argv[2], "--trial" in sys.argv)
