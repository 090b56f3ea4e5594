"""The definition names numbers that the paper has, and runs meet those of their own settings."""

import pytest

from n2n.dashboard.counterparts import COUNTERPARTS
from n2n.dashboard.definition import SECTIONS
from n2n.dashboard.paper import curve_of, versus
from n2n.dashboard.run import Run
from n2n.tables.grid import published

CURVES = [curve for section in SECTIONS for panel in section.panels for curve in panel.paper]


@pytest.mark.parametrize("curve", CURVES, ids=lambda curve: f"{curve.table}-{curve.row}")
def test_curves_of_the_paper_have_points(curve):
    assert len(curve_of(curve)["points"]) >= 4


def test_curves_are_in_the_units_of_settings():
    by_row = {(curve.table, curve.row): dict(curve_of(curve)["points"]) for curve in CURVES}
    assert by_row["T11_ablation_metric_lambda", "Denoise"][0.1] == 4.252
    assert by_row["T08_ablation_B", "L2CD_x1e4"][250] == 4.221
    assert by_row["T09_ablation_iterations", "P2M_x1e4"][800_000] == 1.847
    assert 73.786 not in by_row["T11_ablation_metric_lambda", "Denoise"].values()  # the column of another distance


@pytest.mark.parametrize("counterpart", COUNTERPARTS, ids=lambda one: f"{one.table}-{one.row}-{one.column}")
def test_counterparts_exist(counterpart):
    assert published(counterpart.table).grid.cells[counterpart.row, counterpart.column].value is not None


def test_runs_meet_the_number_of_their_own_settings(tmp_path):
    def run(**changes):
        settings = {"datamodule.name": "pu", "datamodule.points": 10000, "datamodule.noise": 0.03, **changes}
        return Run("a", tmp_path, effective=settings, values={"denoise/sbp/cd_sum2": 4e-4})

    runs = [run(), run(**{"datamodule.noise": 0.025}), run(**{"datamodule.name": "generated"}), run(seed=1)]
    (row,) = versus(runs)
    assert row["paper"] == 4.221 and row["table"] == "T01" and row["scale"] == 1e4
    assert row["runs"] == [0, 3]
    assert any("9 to 21 %" in note for note in row["notes"])


def test_sections_have_keys_of_their_own_and_say_what_is_missing():
    keys = [section.key for section in SECTIONS]
    assert len(set(keys)) == len(keys)
    assert all(panel.empty for section in SECTIONS for panel in section.panels if panel.kind in {"ablation", "scene"})
