"""Claims among real processes: one wins, a dead owner is followed by one, a living one is left alone."""

import multiprocessing
import os
import signal
import time
from collections import Counter
from pathlib import Path

import pytest

from n2n.sweeps import claims
from n2n.sweeps.claims import claim, heartbeat_age, is_held

RACERS, ROUNDS = 6, 25
_spawn = multiprocessing.get_context("spawn")


def _race(folder: Path, machine: str, stale_after: float, barrier, wins) -> None:
    if machine:
        claims._machine = lambda: machine
    for number in range(ROUNDS):
        barrier.wait(20)
        with claim(folder / f"run{number}", stale_after) as mine:
            if mine:
                wins.put(number)
            barrier.wait(20)  # nobody lets go before all have tried


def _hold(folder: Path, numbers: int, stale_after: float, ready) -> None:
    from contextlib import ExitStack

    with ExitStack() as held:
        assert all(held.enter_context(claim(folder / f"run{n}", stale_after)) for n in range(numbers))
        ready.set()
        time.sleep(60)


def _racing(folder: Path, machine: str = "", stale_after: float = 60.0) -> Counter:
    barrier, wins = _spawn.Barrier(RACERS), _spawn.Queue()
    racers = [_spawn.Process(target=_race, args=(folder, machine, stale_after, barrier, wins)) for _ in range(RACERS)]
    for racer in racers:
        racer.start()
    for racer in racers:
        racer.join(40)
    assert [racer.exitcode for racer in racers] == [0] * RACERS
    found = Counter()
    while not wins.empty():
        found[wins.get()] += 1
    return found


@pytest.fixture
def owner(tmp_path):
    """A process that owns all claims, heartbeat every 0.1 s."""
    ready = _spawn.Event()
    process = _spawn.Process(target=_hold, args=(tmp_path, ROUNDS, 0.4, ready))
    process.start()
    assert ready.wait(20)
    yield process
    process.kill()
    process.join()


EACH_ONCE = Counter(range(ROUNDS))


def test_one_of_many_racers_wins(tmp_path):
    assert _racing(tmp_path) == EACH_ONCE


def test_what_was_released_is_won_again_by_one(tmp_path):
    for number in range(ROUNDS):
        with claim(tmp_path / f"run{number}") as mine:
            assert mine
    assert _racing(tmp_path) == EACH_ONCE


def test_killed_owner_is_followed_by_one(tmp_path, owner):
    os.kill(owner.pid, signal.SIGKILL)
    # Not reaped yet: a zombie still has its number.
    assert _racing(tmp_path) == EACH_ONCE


def test_owner_killed_elsewhere_is_followed_by_one_after_the_time(tmp_path, owner):
    os.kill(owner.pid, signal.SIGKILL)
    time.sleep(0.5)
    assert _racing(tmp_path, machine="another", stale_after=0.4) == EACH_ONCE


@pytest.mark.parametrize("machine", ["", "another"])
def test_living_owner_keeps_its_claim(tmp_path, owner, machine, monkeypatch):
    if machine:
        monkeypatch.setattr(claims, "_machine", lambda: machine)
    end = time.monotonic() + 2.0  # five times what counts as dead
    while time.monotonic() < end:
        with claim(tmp_path / "run0", 1.0 if machine else 0.0) as mine:
            assert not mine
        time.sleep(0.05)


def test_suspended_owner_of_this_machine_keeps_its_claim(tmp_path, owner):
    os.kill(owner.pid, signal.SIGSTOP)
    time.sleep(0.6)
    with claim(tmp_path / "run0", 0.4) as mine:
        assert not mine


def test_slow_taker_withdraws_before_a_higher_number(tmp_path, monkeypatch):
    path = tmp_path / "run"
    for _ in range(3):
        with claim(path):
            pass
    assert [file.name for file in tmp_path.iterdir()] == ["run.3"]
    # What it saw is long past: number 1, released.
    seen = [1]
    monkeypatch.setattr(claims, "_newest", lambda path: seen.pop() if seen else max(claims._numbers(path)))
    (tmp_path / "run.1").write_text((tmp_path / "run.3").read_text())
    with claim(path) as mine:
        assert not mine


def test_process_that_got_the_number_of_a_dead_owner_does_not_count(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(claims, "_born", lambda pid: "1")
        held = claim(tmp_path / "run")
        assert held.__enter__()
    with claim(tmp_path / "run") as mine:
        assert mine


def test_without_hard_links(tmp_path, monkeypatch):
    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", refuse)
    with claim(tmp_path / "run") as first, claim(tmp_path / "run") as second:
        assert (first, second) == (True, False)
    with claim(tmp_path / "run") as third:
        assert third


def test_looking_tells_and_touches_nothing(tmp_path):
    path = tmp_path / "run"
    assert not is_held(path) and heartbeat_age(path) is None
    with claim(path):
        before = sorted(file.name for file in tmp_path.iterdir())
        assert is_held(path) and heartbeat_age(path) < 5
        assert sorted(file.name for file in tmp_path.iterdir()) == before
    assert not is_held(path)


def test_released_after_a_failure(tmp_path):
    with pytest.raises(RuntimeError), claim(tmp_path / "run"):
        raise RuntimeError
    with claim(tmp_path / "run") as mine:
        assert mine
