"""`python -m benchmarks [SECTION ...]`: measure what is not measured yet, print it, write OUT/report.md."""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks import ROOT, job, machine
from benchmarks.section import NAMES

OUT = ROOT / "out" / "bench"
DOCS = ROOT / "docs" / "benchmarks.md"
_INTRO = """# Benchmarks

Written by `make bench`, which measures all of this anew; do not edit. What is compared was measured in turns (A B A B)
on the same machine; given are medians and, in brackets, smallest and largest. Ratios are those of the same turn.
"""


def main(arguments: list[str] | None = None) -> int:
    options = _options(arguments)
    out = options.out / "trial" if options.trial else options.out
    out.mkdir(parents=True, exist_ok=True)
    failed = []
    if not (options.docs or options.record):
        for name in options.sections or NAMES:
            stored = _measured(name, out, options.trial, options.again)
            failed += [] if stored else [name]
            if stored:
                print(f"\n{_section(stored)}", flush=True)
    report = _report(out)
    (out / "report.md").write_text(report)
    if options.docs:
        DOCS.write_text(report)
        print(f"{out / 'report.md'} -> {DOCS}")
    elif options.record:
        job.record(json.loads((out / "job.json").read_text()), options.record)
        print(f"the ratios of {out / 'job.json'} are now those of release {options.record} in {job.BASELINE}")
    else:
        print(f"\nreport: {out / 'report.md'}")
    if failed:
        print(f"failed: {' '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=f"{' '.join(NAMES)} (all)")
    parser.add_argument("--trial", action="store_true", help="tiny sizes: does it work? Results in OUT/trial")
    parser.add_argument("--again", action="store_true", help="also what is measured already")
    parser.add_argument("--docs", action="store_true", help="only copy the report to docs/benchmarks.md")
    parser.add_argument("--record", metavar="RELEASE", help="only keep the ratios of the job as those of a release")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results (out/bench)")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.sections if name not in NAMES]
    if unknown:
        parser.error(f"unknown section {unknown[0]!r}; known: {' '.join(NAMES)}")
    return options


def _measured(name: str, out: Path, trial: bool, again: bool) -> dict[str, Any] | None:
    """Return a section's result, from its file if it is of these sources; None if it failed."""
    path = out / f"{name}.json"
    if path.exists() and not again:
        stored = json.loads(path.read_text())
        if stored["sources"] == machine.sources():
            return stored
    print(f"measuring {name} ...", file=sys.stderr, flush=True)
    command = [sys.executable, "-m", "benchmarks.section", name, str(path.resolve()), *(["--trial"] if trial else [])]
    done = subprocess.run(command, cwd=ROOT, check=False)
    return json.loads(path.read_text()) if done.returncode == 0 else None


def _section(stored: dict[str, Any]) -> str:
    size = " Trial sizes: these numbers mean nothing." if stored["trial"] else ""
    facts = f"{machine.line(stored['machine'])}; took {stored['seconds']:.0f} s.{size}"
    return f"## {stored['title']}\n<sub>{facts}</sub>\n\n{stored['markdown']}\n"


def _report(out: Path) -> str:
    found = [json.loads(path.read_text()) for name in NAMES if (path := out / f"{name}.json").exists()]
    return "\n".join([_INTRO, *map(_section, found)]) if found else f"{_INTRO}\nNothing measured yet.\n"


if __name__ == "__main__":
    sys.exit(main())
