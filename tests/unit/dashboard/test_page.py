"""The page holds its data safely, keeps to its size, and the command says what it did."""

import json
import re

import pytest

from n2n.cli.main import main
from n2n.dashboard.data import curve_points, find_differing, page_data
from n2n.dashboard.page import write_page
from n2n.dashboard.sources import read_runs
from tests.unit.dashboard.conftest import write_run, write_sweep

HOSTILE = "</script><script>alert(1)</script><img src=x onerror=alert(2)><!--"


def data_of(path):
    text = path.read_text(encoding="utf-8")
    (found,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)
    return json.loads(found)


def test_the_page_holds_everything_and_asks_for_nothing(sweep, tmp_path):
    write_page(read_runs([str(sweep)]), tmp_path / "page.html")
    text, data = (tmp_path / "page.html").read_text(), data_of(tmp_path / "page.html")
    assert [len(data["runs"]), data["axes"]] == [8, ["regulariser_weight", "seed"]]
    assert sum("picture" in run for run in data["runs"]) == sum("scene" in run for run in data["runs"]) == 3
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", text)
    assert "default-src 'none'" in text and "unsafe-inline" not in text


def test_hostile_text_stays_text(tmp_path):
    folder = write_sweep(
        tmp_path / "s", {"a": {"settings": [f"experiment={HOSTILE}"], "state": "failed", "error": HOSTILE}}
    )
    write_page(read_runs([str(folder)]), tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    assert "alert(1)</script>" not in text and "<img" not in text and "<!--" not in text
    (run,) = data_of(tmp_path / "page.html")["runs"]
    assert run["error"] == HOSTILE and run["swept"]["experiment"] == HOSTILE


def test_numbers_json_does_not_know_are_left_out(tmp_path):
    folder = write_run(tmp_path / "a", effort=float("inf"))
    (folder / "metrics.csv").write_text("loss,step\ninf,1\n2,2\n")
    write_page(read_runs([str(folder)]), tmp_path / "page.html")
    (run,) = data_of(tmp_path / "page.html")["runs"]
    assert run["curves"]["loss"] == [[2], [2.0]] and run["config"]["effort"] == "inf"


def test_media_keep_to_their_room_and_what_is_left_out_is_counted(sweep):
    runs = read_runs([str(sweep)])
    whole = page_data(runs, 10**9)
    size = sum(len(run["picture"]) for run in whole["runs"] if "picture" in run)
    only_pictures = page_data(runs, size)
    assert only_pictures["leftOut"] == {"pictures": 0, "scenes": 3}
    nothing = page_data(runs, 0)
    assert nothing["leftOut"] == {"pictures": 3, "scenes": 3}
    assert not any("picture" in run or "scene" in run for run in nothing["runs"])


def test_many_curves_are_thinned_more():
    assert curve_points(1) == 300
    assert curve_points(200 * 14) < 130
    assert curve_points(10**6) == 40


def test_settings_that_differ_are_found(sweep, tmp_path):
    assert find_differing(read_runs([str(sweep)])) == ["regulariser_weight", "seed"]
    a = write_run(tmp_path / "a", media="x")
    b = write_run(tmp_path / "b", datamodule={"name": "pu", "shape": "pig", "points": 10000, "noise": 0.01})
    differing = find_differing(read_runs([str(a), str(b)]))
    assert set(differing) == {"datamodule.shape", "datamodule.noise"}


def test_scans_are_told_apart_by_their_files(tmp_path):
    folders = [
        write_run(tmp_path / name, datamodule={"name": "files", "paths": [f"scans/{name}.ply", "x.ply"]})
        for name in "ab"
    ]
    runs = read_runs([str(folder) for folder in folders])
    assert [run.shape for run in runs] == ["a.ply +1", "b.ply +1"]
    assert find_differing(runs) == ["datamodule.shape"]


def test_the_command_writes_the_page(sweep, tmp_path, capsys):
    page = tmp_path / "out" / "page.html"
    assert main(["dashboard", str(sweep), "-o", str(page), "--media", "0"]) == 0
    said = capsys.readouterr().err
    assert "8 runs (6 done, 1 failed, 1 pending)" in said and "left out: 3 3D views" in said
    assert len(data_of(page)["runs"]) == 8


def test_no_runs_is_a_page_that_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["dashboard"]) == 0
    assert data_of(tmp_path / "dashboard.html")["runs"] == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere"], "nowhere"),
        (["-o", "page.pdf"], ".html"),
        (["--media", "-1"], "--media"),
        (["--media", "nan"], "--media"),
    ],
)
def test_mistakes_are_one_line(tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert main(["dashboard", *arguments]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
    assert not list(tmp_path.iterdir())
