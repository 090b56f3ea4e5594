"""Rows of a sweep: axes, then results; one set of columns for all."""

import csv
import json

import pytest

from n2n.errors import OutputError
from n2n.sweeps.results import as_csv, rows, write
from n2n.sweeps.status import FIELD_FILE, Status
from n2n.sweeps.store import Sweep


@pytest.fixture
def sweep(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    planned = {f"h{seed}": [f"seed={seed}", "distance=cd"] for seed in range(3)}
    made = Sweep.plan("x", [], {"seed": ["0", "1", "2"], "distance": ["cd"]}, planned)
    for name, state, error in (("h0", "done", None), ("h1", "failed", 'no, "really"')):
        folder = made.run_dir(name)
        folder.mkdir(parents=True)
        Status(state, 1, "", 0, "", planned[name], None, "", 2.5, error).write(folder)
    (made.run_dir("h0") / FIELD_FILE).touch()
    (made.run_dir("h0") / "summary.json").write_text(
        json.dumps({"iterations": 20, "noise": [0.1, 0.2], "spacing": [0.5], "seconds": 2})
    )
    values = {"values": {"cd_sum2": 1e-4}, "floors": {}}
    (made.run_dir("h0") / "evaluation.json").write_text(
        json.dumps({"validation": 0.25, "evaluations": {"denoise/sbp": values}})
    )
    return made


DONE = {
    "run": "h0",
    "state": "done",
    "seed": "0",
    "distance": "cd",
    "seconds": 2.5,
    "iterations": 20,
    "noise[0]": 0.1,
    "noise[1]": 0.2,
    "spacing": 0.5,
    "validation": 0.25,
    "denoise/sbp/cd_sum2": 1e-4,
    "error": None,
}


def test_rows(sweep):
    table = rows(sweep)
    assert [list(row) for row in table] == [list(DONE)] * 3
    assert table[0] == DONE
    assert {key: value for key, value in table[1].items() if value is not None} == {
        "run": "h1",
        "state": "failed",
        "seed": "1",
        "distance": "cd",
        "seconds": 2.5,
        "error": 'no, "really"',
    }
    assert table[2]["state"] == "pending"


def test_written_and_read_again(sweep, tmp_path):
    table = rows(sweep)
    write(table, tmp_path / "x.json")
    assert json.loads((tmp_path / "x.json").read_text()) == table
    write(table, tmp_path / "x.csv")
    read = list(csv.DictReader((tmp_path / "x.csv").open(newline="")))
    assert read == [{key: "" if value is None else str(value) for key, value in row.items()} for row in table]
    assert (tmp_path / "x.csv").read_text() == as_csv(table)


def test_other_endings_are_refused(sweep, tmp_path):
    with pytest.raises(OutputError, match=r"\.csv, \.json"):
        write(rows(sweep), tmp_path / "x.xls")
