"""What the environment says about threads."""

import pytest

from n2n.errors import ConfigError
from n2n.sweeps.launchers import told_threads


@pytest.mark.parametrize(("told", "threads"), [(None, None), ("", None), ("3", 3), ("2,1", 2), (" 4 ", 4), ("0", None)])
def test_threads_the_user_wants(monkeypatch, told, threads):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    if told is not None:
        monkeypatch.setenv("OMP_NUM_THREADS", told)
    assert told_threads() == threads


def test_no_number_of_threads(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "all")
    with pytest.raises(ConfigError, match="OMP_NUM_THREADS=all"):
        told_threads()
