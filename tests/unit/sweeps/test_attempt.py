"""One run: fitted once, resumed, begun anew for other data, and its failure kept."""

import pytest

from n2n.errors import InputError
from n2n.sweeps.attempt import attempt, give_up
from n2n.sweeps.claims import claim
from n2n.sweeps.status import CLAIM, FIELD_FILE, read_status
from n2n.sweeps.store import RunInfo


class Fit:
    """Leaves a checkpoint, then the field; counts how often it was called and what it found."""

    def __init__(self, folder, error=None):
        self.folder, self.error, self.calls, self.found = folder, error, 0, []

    def __call__(self):
        self.calls += 1
        checkpoint = self.folder / "last.ckpt"
        self.found.append(checkpoint.exists())
        checkpoint.touch()
        if self.error:
            raise self.error
        (self.folder / FIELD_FILE).touch()


def run(folder, fit, data="d"):
    return attempt(folder, ["seed=1"], lambda: data, fit)


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "runs" / "h"


def test_done_once(folder):
    fit = Fit(folder)
    assert [run(folder, fit), run(folder, fit)] == ["done", "done"]
    assert fit.calls == 1
    status = read_status(folder)
    assert (status["state"], status["attempt"], status["settings"]) == ("done", 1, ["seed=1"])
    assert status["seconds"] >= 0 and status["ended"] >= status["started"]


def test_failure_is_kept_in_one_line_and_tried_again(folder):
    fit = Fit(folder, InputError("scan.ply: no\nsuch file"))
    assert run(folder, fit) == "failed"
    found = RunInfo.read(folder)
    assert (found.state, found.error, found.attempt) == ("failed", "scan.ply: no such file", 1)
    fit.error = None
    assert run(folder, fit) == "done"
    found = RunInfo.read(folder)
    assert (found.state, found.error, found.attempt, fit.found) == ("done", None, 2, [False, True])


def test_data_that_cannot_be_read_cost_nothing(folder):
    fit = Fit(folder)
    assert [run(folder, fit), run(folder, fit, data=None)] == ["done", "done"]
    assert fit.calls == 1 and (folder / FIELD_FILE).exists()


def test_unfinished_fit_outlives_data_that_are_away(folder):
    fit = Fit(folder, KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        run(folder, fit)
    fit.error = InputError("scan.ply: no such file")
    assert run(folder, fit, data=None) == "failed"
    fit.error = None
    assert run(folder, fit) == "done"
    assert fit.found == [False, True, True]


def test_killed_while_the_data_are_read_counts_as_begun(folder):
    def killed():
        assert RunInfo.read(folder).state == "running"
        raise KeyboardInterrupt

    fit = Fit(folder)
    for attempts in (1, 2):
        with pytest.raises(KeyboardInterrupt):
            attempt(folder, ["seed=1"], killed, fit)
        assert (RunInfo.read(folder).state, RunInfo.read(folder).attempt) == ("stale", attempts)
    assert (run(folder, fit), fit.calls, read_status(folder)["data"]) == ("done", 1, "d")


def test_unforeseen_failure_says_where(folder):
    assert run(folder, Fit(folder, ZeroDivisionError("division by zero"))) == "failed"
    error = RunInfo.read(folder).error
    assert error.startswith("ZeroDivisionError at sweeps/attempt.py:") and "division by zero" in error


def test_interrupted_goes_on_from_its_checkpoint(folder):
    fit = Fit(folder, KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        run(folder, fit)
    assert RunInfo.read(folder).state == "stale"
    fit.error = None
    assert run(folder, fit) == "done"
    assert fit.found == [False, True]


def test_killed_between_field_and_status_is_not_fitted_again(folder):
    fit = Fit(folder, KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        run(folder, fit)
    (folder / FIELD_FILE).touch()
    assert run(folder, fit) == "done"
    assert (fit.calls, RunInfo.read(folder).state, RunInfo.read(folder).attempt) == (1, "done", 1)


@pytest.mark.parametrize("error", [None, KeyboardInterrupt()])
def test_other_data_begin_anew(folder, error):
    fit = Fit(folder, error)
    if error:
        with pytest.raises(KeyboardInterrupt):
            run(folder, fit, "before")
    else:
        run(folder, fit, "before")
    (folder / "media").mkdir()
    fit.error = None
    assert run(folder, fit, "after") == "done"
    assert fit.found == [False, False]
    assert RunInfo.read(folder).data == "after"
    assert not (folder / "media").exists()


def test_what_another_process_has_is_left_alone(folder):
    folder.mkdir(parents=True)
    fit = Fit(folder)
    with claim(folder / CLAIM):
        assert run(folder, fit) == "taken"
    assert fit.calls == 0
    assert run(folder, fit) == "done"


def test_given_up(folder):
    with pytest.raises(KeyboardInterrupt):
        run(folder, Fit(folder, KeyboardInterrupt()))
    with claim(folder / CLAIM):
        give_up(folder, ["seed=1"], "killed")
    assert RunInfo.read(folder).state == "stale"
    give_up(folder, ["seed=1"], "killed")
    found = RunInfo.read(folder)
    assert (found.state, found.error, found.attempt) == ("failed", "killed", 1)
