"""Benchmarks of n2n: `make bench`. Everything is paired with what it replaces, measured in the same run, in turns."""

import os
from pathlib import Path

ROOT = Path(__file__).parents[1]

# As the commands do it (n2n.cli); read when torch is imported, so it stands before that.
os.environ.setdefault("GOMP_SPINCOUNT", "3000")
