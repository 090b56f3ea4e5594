"""SIGKILL at random moments of a sweep: nothing is lost, nothing fitted twice, results as if undisturbed.

`python -m benchmarks.kills` does the same with 24 runs and 20 kills.
"""

from pathlib import Path

import pytest

from benchmarks.kills import differences, disturbed, report, undisturbed
from n2n.sweeps.store import Sweep

RUNS, KILLS = 6, 6


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc to find the workers")
def test_killed_at_random_moments(tmp_path):
    undisturbed(tmp_path, RUNS)
    seen = disturbed(tmp_path, RUNS, KILLS, seed=1, longest=2.0)
    found = report(seen, Sweep.open(tmp_path / "sweeps/killed").runs, differences(tmp_path))
    log = (tmp_path / "log.txt").read_text()
    assert found["kills"] == KILLS, found
    assert (found["exit code"], found["done"]) == (0, RUNS), log
    assert found["fitted again after they were done"] == 0
    assert found["different from an undisturbed sweep"] == 0
    assert found["attempts killed"] <= 2 * KILLS  # a kill ends no more than the runs of two workers
