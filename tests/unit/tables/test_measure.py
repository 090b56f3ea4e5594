"""One fit measured: what a record holds, and that a failure is one, too."""

import json

import numpy as np
import pytest

from n2n import registry
from n2n.evaluation.protocol import load_protocol
from n2n.geometry.reference import Reference
from n2n.tables import measure as module
from n2n.tables.measure import measure
from n2n.tables.memory import peak, reset_peak
from n2n.tables.spec import Fit
from n2n.tables.store import lacking, protocol_hash

SMALL = ("datamodule.noise=0.02", "datamodule.points=400", "num_observations=1")


class Still:
    """A method that leaves points where they are."""

    def denoise(self, points):
        return points


@pytest.fixture
def still(monkeypatch):
    monkeypatch.setitem(registry.BASELINES._registered, "still", Still)
    return Fit("still", "generated", "sphere", SMALL)


def test_a_record_holds_what_was_asked_for(still):
    record = measure(still, {"denoise/sbp": {"do_nothing"}, "": set()})
    assert record["status"] == "done" and json.loads(json.dumps(record)) == record
    assert {key: record[key] for key in ("id", "method", "datamodule", "shape")} == {
        "id": still.id, "method": "still", "datamodule": "generated", "shape": "sphere",
    }  # fmt: skip
    result = record["results"]["denoise/sbp"]
    # Doing nothing is what this method does.
    assert result["values"]["cd_sum2"] == result["floors"]["do_nothing"]["cd_sum2"] > 0
    assert list(result["floors"]) == ["do_nothing"] and result["asked"] == ["do_nothing"]
    assert set(record["results"]) == {"denoise/sbp"} and record["cost"]["memory"] > 0
    assert {"n2n", "commit", "sources", "torch", "machine", "date"} == set(record["made"])
    protocols = {"denoise/sbp": protocol_hash("sbp")}
    assert lacking(record, {"denoise/sbp": {"do_nothing"}}, protocols) == set()


def test_numbers_are_those_of_the_protocol(still):
    data = registry.DATAMODULES.build(
        {"name": "generated", "shape": "sphere", "points": 400, "noise": 0.02, "num_observations": 1}
    )
    expected = load_protocol("sbp").evaluate(data.noisy, data.reference, data.noisy)
    values = measure(still, {"denoise/sbp": set()})["results"]["denoise/sbp"]["values"]
    assert {key: values[key] for key in ("cd_sum2", "p2m", "hausdorff")} == {
        key: pytest.approx(expected.values[key], rel=1e-5) for key in ("cd_sum2", "p2m", "hausdorff")
    }


def test_files_of_ones_own_are_measured_against_the_truth_given_with_them(still, tmp_path):
    """The corners of unit cubes in a block of 5 x 5 x 5, all seen 0.1 too high: 0.01 each way."""
    clean = np.stack(np.meshgrid(*[np.arange(6.0)] * 3), axis=-1).reshape(-1, 3)
    np.savetxt(tmp_path / "my clean.xyz", clean)
    np.savetxt(tmp_path / "scan.xyz", clean + [0, 0, 0.1])
    paths = f"datamodule.paths=[{tmp_path / 'scan.xyz'}]"
    truth = f"datamodule.reference=[{tmp_path / 'my clean.xyz'}]"
    record = measure(Fit("still", "files", "block", (paths, truth)), {"denoise/sbp": {"do_nothing"}})
    result = record["results"]["denoise/sbp"]
    # The protocol measures in the unit sphere: half a diagonal of 5 becomes 1.
    assert result["values"]["cd_sum2"] == pytest.approx(2 * 0.01 / (2.5**2 * 3), rel=1e-4)
    assert record["shape"] == "block" and str(tmp_path / "scan.xyz") in record["source"]
    blank = measure(Fit("still", "files", "block", (paths,)), {"denoise/sbp": set()})
    assert blank["results"]["denoise/sbp"]["blank"] == "no ground truth of block is present"


def test_samples_can_be_cut_and_floors_left_out():
    cut = module._protocol("onet", set(), 2000)
    assert (cut.reference["samples"], cut.prediction["samples"], dict(cut.floors)) == (2000, 2000, {})
    assert module._protocol("sbp", {"oracle"}, 2000).reference["samples"] is None
    assert list(module._protocol("sbp", {"oracle"}, None).floors) == ["oracle"]
    assert load_protocol("onet").reference["samples"] == 100_000


@pytest.mark.parametrize(
    ("changed", "error"),
    [
        ({"settings": ("datamodule.points=5",)}, "datamodule.points=5 is out of range"),
        ({"settings": ("iteration=5",)}, "Unknown configuration key 'iteration'"),
        ({"shape": "Utah_teapot_(solid)"}, "unknown shape 'Utah_teapot_(solid)'"),
        ({"shape": "it's"}, 'unknown shape "it\'s"'),
        ({"method": "nobody"}, "Unknown baseline 'nobody'"),
    ],
)
def test_a_failure_is_a_record(changed, error):
    fit = Fit(**{"method": "n2n", "datamodule": "generated", "shape": "sphere", "settings": SMALL, **changed})
    record = measure(fit, {"denoise/sbp": set()})
    assert record["status"] == "failed" and error in record["error"] and "\n" not in record["error"]
    assert record["id"] == fit.id and record["cost"]["seconds"] >= 0 and "results" not in record


def test_what_nobody_foresaw_is_one_line(still, monkeypatch):
    def broken(self, points):
        raise ValueError("first\n  second")

    monkeypatch.setattr(Still, "denoise", broken)
    assert measure(still, {"denoise/sbp": set()})["error"] == "ValueError: first second"
    assert measure(still, {"upsample/sbp": set()})["error"] == "Still cannot upsample"


def test_without_a_truth_nothing_is_fitted_unless_its_cost_counts(still, monkeypatch):
    built = []

    class Blind(registry.DATAMODULES.get("generated")):
        def __init__(self, *arguments, **named):
            super().__init__(*arguments, **named)
            self.reference = Reference(None, None, None, None)

    monkeypatch.setitem(registry.DATAMODULES._registered, "generated", Blind)
    monkeypatch.setattr(Still, "__init__", lambda self: built.append(1))
    record = measure(still, {"denoise/sbp": {"oracle"}})
    assert record["status"] == "done" and built == [] and "minutes" not in record["cost"]
    assert record["results"]["denoise/sbp"]["blank"] == "no ground truth of sphere is present"
    record = measure(still, {"denoise/sbp": {"oracle"}, "": set()})
    assert built == [1] and record["cost"]["minutes"] >= 0 and "blank" in record["results"]["denoise/sbp"]


@pytest.mark.parametrize(
    ("commit", "modified", "expected"),
    [("abc1234def", False, "abc1234"), ("abc1234def", True, "abc1234+"), (None, None, "unknown")],
)
def test_a_record_names_its_commit(still, monkeypatch, commit, modified, expected):
    facts = {"n2n": "1.0", "commit": commit, "modified": modified}
    monkeypatch.setattr("n2n.tables.measure.provenance", lambda paths: facts)
    assert measure(still, {"denoise/sbp": set()})["made"]["commit"] == expected


def test_the_peak_of_memory_sees_what_is_held_and_given_back():
    reset_peak()
    before = peak()
    held = np.ones(30_000_000)
    during = peak()
    assert during - before > 0.8 * held.nbytes
    del held
    # The kernel counts in batches of pages.
    assert peak() > 0.99 * during
