"""The command line."""

import os

# torch's OpenMP threads spin for milliseconds while they wait for each other. On a machine that is busy otherwise each
# wait then lasts a time slice, and a fit of 3 s took over 60 s; a short spin costs nothing when the machine is free.
os.environ.setdefault("GOMP_SPINCOUNT", "3000")
