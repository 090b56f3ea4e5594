"""`n2n tables`: plan, run, status, render, on generated shapes, with one fit that cannot work."""

import csv
import json
from pathlib import Path

import pytest

from n2n.cli.main import main

OWN = """\
title: our own shapes
experiments:
  - datamodule: generated
    axes: {points: {good: 600, too few: 5}}
    settings: ["datamodule.points={points}", datamodule.noise=0.03, num_observations=1]
    evaluate: denoise/sbp
    note: "made here"
    cells:
      - {row: "n2n, CD", column: "{points}", value: cd_sum2, scale: 1.0e+4}
      - {row: "do nothing, CD", column: "{points}", value: do_nothing.cd_sum2, scale: 1.0e+4}
"""
TABLES = ("T10", "mine", "--tables", "own", "--profile", "smoke", "--results", "kept", "--out", "out")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder in which the tables have been run once; its `code` tells the exit code."""
    folder = tmp_path_factory.mktemp("tables")
    (folder / "own").mkdir()
    (folder / "own" / "mine.yaml").write_text(OWN)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        (folder / "code").write_text(str(main(["tables", "run", *TABLES])))
    return folder


@pytest.fixture
def tables(folder, monkeypatch, capsys):
    """Run the command there; return exit code, out, err."""
    monkeypatch.chdir(folder)

    def command(*arguments):
        code = main(["tables", *arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return command


def test_what_works_is_kept_and_what_fails_is_told(folder):
    assert (folder / "code").read_text() == "2"
    records = [json.loads(path.read_text()) for path in sorted((folder / "kept").rglob("*.json"))]
    assert sorted(record["status"] for record in records) == ["done", "done", "failed"]
    (failed,) = [record for record in records if record["status"] == "failed"]
    assert "datamodule.points=5 is out of range" in failed["error"] and "datamodule.points=5" in failed["settings"]
    for record in records:
        assert {"id", "shape", "settings", "made", "status"} <= set(record)
    # A fit that both tables want is there once.
    assert len({record["id"] for record in records}) == 3


def test_the_files_that_come_of_it(folder):
    assert {path.name for path in (folder / "out").iterdir()} == {
        "index.md",
        *(f"{name}.{suffix}" for name in ("T10_observations", "mine") for suffix in ("md", "tex", "csv")),
    }
    rows = {(row["row"], row["column"]): row for row in csv.DictReader((folder / "out" / "mine.csv").open())}
    assert float(rows["n2n, CD", "good"]["value"]) > 0 and rows["n2n, CD", "good"]["remark"] == "made here"
    assert rows["n2n, CD", "too few"]["value"] == "" and "is out of range" in rows["n2n, CD", "too few"]["remark"]
    assert float(rows["do nothing, CD", "good"]["value"]) > 0
    paper = {
        (row["row"], row["column"]): row for row in csv.DictReader((folder / "out" / "T10_observations.csv").open())
    }
    assert paper["L2CD_x1e4", "200"]["value"] == "4.221" and paper["L2CD_x1e4", "200"]["best"] == "1"
    assert paper["n2n, L2CD_x1e4", "1"]["value"] == rows["n2n, CD", "good"]["value"]
    assert not any(row["best"] == "1" for row in paper.values() if row["origin"] != "paper")


def test_the_same_command_tries_only_what_failed(tables, folder):
    before = {path: path.stat().st_mtime_ns for path in (folder / "kept").rglob("*.json")}
    code, out, error = tables("run", *TABLES)
    changed = [path for path, time in before.items() if path.stat().st_mtime_ns != time]
    assert (code, out) == (2, "") and len(changed) == 1
    assert "1 fits, 2 done before" in error and error.count("failed: generated") == 1
    assert "tables: 0 of 1 fits measured -> kept" in error


def test_status_and_plan(tables):
    code, out, error = tables("status", *TABLES)
    assert (code, error) == (2, "")
    lines = out.splitlines()
    assert lines[0].split() == ["T10_observations", "2", "of", "2", "fits"]
    assert lines[1].split() == ["mine", "1", "of", "2", "fits"]
    assert lines[2].startswith("failed: generated ") and lines[-1] == "made by other sources: 0"
    code, out, error = tables("plan", *TABLES)
    assert (code, error) == (0, "")
    rows = {line.split()[0]: line.split() for line in out.splitlines() if line}
    assert rows["T10_observations"][1:3] == ["2", "0"] and rows["mine"][1:3] == ["2", "1"]
    assert rows["all,"][4:6] == ["3", "1"]
    code, out, _ = tables("status", "T10", *TABLES[2:])
    assert code == 0 and "failed" not in out


def test_render_makes_the_same_tables_anywhere(tables, folder):
    code, _, error = tables("render", *TABLES, "--out", "again")
    assert code == 0 and "2 rendered" in error and str(Path("again") / "index.md") in error
    for path in (folder / "out").iterdir():
        assert (folder / "again" / path.name).read_text() == path.read_text()


def test_a_damaged_result_is_named_and_the_rest_is_shown_and_run_measures_it_again(tables, folder):
    path = next(p for p in (folder / "kept").rglob("*.json") if '"done"' in p.read_text())
    text = path.read_text()
    path.write_text(text[:100])
    code, out, error = tables("status", *TABLES)
    assert (code, error) == (2, "") and out.count(str(path.relative_to(folder))) == 1
    assert f"damaged: {path.relative_to(folder)}: cannot be read" in out
    assert "damaged: 1; `n2n tables run` measures them again" in out and "failed: generated" in out
    code, out, error = tables("render", *TABLES, "--out", "holed")
    assert (code, out) == (2, "") and "2 rendered" in error and f"damaged: {path.relative_to(folder)}" in error
    holed = [
        row for name in ("mine", "T10_observations") for row in csv.DictReader((folder / f"holed/{name}.csv").open())
    ]
    assert any("its result file is damaged" in row["remark"] and row["value"] == "" for row in holed)
    assert any(row["value"] and row["origin"] == "n2n" for row in holed)
    code, out, error = tables("run", *TABLES)
    assert code == 2 and f"damaged: {path.relative_to(folder)}" in error and "1 of 2 fits measured" in error
    before, after = json.loads(text), json.loads(path.read_text())
    assert after["results"].keys() == before["results"].keys()
    for evaluation, result in before["results"].items():
        # Alone it has all threads, and sums come out otherwise in the last digits.
        assert after["results"][evaluation]["values"] == pytest.approx(result["values"], rel=0.01)
    assert "damaged" not in tables("status", *TABLES)[1]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("plan", "T99"), "Unknown table 'T99'."),
        (("plan", "T1"), "table 'T1' may be any of T10_observations,"),
        (("plan", "--profile", "lapto"), "Unknown profile 'lapto'. Did you mean 'laptop'?"),
        (("run", "--workers", "0"), "--workers 0 is out of range; give a number >= 1"),
        (("run", "--tables", "nowhere"), "nowhere: no table found there"),
        (("paint",), "invalid choice: 'paint'"),
        (("render", "T10", "--profile", "smoke", "--out", "own/mine.yaml"), "give another one with --out"),
    ],
)
def test_mistakes_are_one_line(tables, arguments, expected):
    code, out, error = tables(*arguments)
    assert (code, out) == (2, "") and error.count("\n") == 1
    assert error.startswith("n2n: error: ") and expected in error


def test_without_data_the_tables_are_blank_for_a_reason(tables, monkeypatch, folder):
    monkeypatch.setenv("N2N_DATA", str(folder / "empty"))
    assert tables("run", "T10", "T03", "--results", "none", "--out", "blank")[0] == 0
    text = (folder / "blank" / "T10_observations.md").read_text()
    assert "| L2CD_x1e4 | 4.976 |" in text and "get it with `n2n data fetch pu`" in text
    assert "get it with `n2n data fetch shapenet`" in (folder / "blank" / "T03_shapenet.md").read_text()
    assert not (folder / "none").exists()
    out = tables("plan", "T10")[1]
    assert "blank: PU meshes not present: " in out


PLUGIN = {
    "lab-0.1.dist-info/METADATA": "Metadata-Version: 2.1\nName: lab\nVersion: 0.1\n",
    "lab-0.1.dist-info/entry_points.txt": (
        "[n2n.datamodules]\nscanner = lab.scanner:Scanner\n[n2n.baselines]\nstill = lab.scanner:Still\n"
        "[n2n.conf]\nlab = lab.conf\n"
    ),
    "lab/__init__.py": "",
    "lab/conf/__init__.py": "",
    "lab/conf/datamodule/scanner.yaml": "name: scanner\nshape: ???\n",
    "lab/conf/profile/lab.yaml": "title: what our laboratory has\n",
    "lab/conf/table/lab.yaml": """\
title: our scanner
experiments:
  - datamodule: scanner
    method: still
    evaluate: denoise/sbp
    cells:
      - {row: still, column: CD, value: cd_sum2}
      - {row: still, column: by class, value: cd_sum2, mean: class}
""",
    "lab/scanner.py": '''\
import numpy as np

from n2n.datamodules.benchmark import BenchmarkDataModule
from n2n.geometry.reference import Reference


class Scanner(BenchmarkDataModule):
    """Corners of a cube, seen 0.1 too far along x: no frame but a sphere of radius sqrt(3)."""

    def __init__(self, shape, root=None, num_observations=None):
        name = self.check_present(shape, root)
        corners = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1, 1) for z in (-1, 1)])
        clean = np.concatenate([corners * s for s in np.linspace(0.5, 1, 20)])
        far = {"a/1": 0.1, "a/2": 0.2, "b/1": 0.3}[name] * np.array([1.0, 0, 0])
        super().__init__(name, [clean + far], Reference(clean, None, None, None), f"scanner/{name}", num_observations)

    @classmethod
    def names(cls, root=None):
        return ["a/1", "a/2", "b/1"]

    @classmethod
    def missing(cls, root=None):
        return None


class Still:
    def denoise(self, points):
        return points
''',
}


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """A folder to work in, and the plugin on the path."""
    for name, text in PLUGIN.items():
        path = tmp_path / "site" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path / "site"))


def test_what_other_sources_made_is_kept_and_told(lab, tmp_path, monkeypatch, capsys):
    def tables(action, *options):
        code = main(["tables", action, "lab", "--profile", "lab", *options])
        captured = capsys.readouterr()
        return code, captured.out + captured.err

    assert tables("run")[0] == 0
    for path in (tmp_path / "results" / "lab" / "scanner").glob("*.json"):
        path.write_text(
            json.dumps({**(record := json.loads(path.read_text())), "made": record["made"] | {"sources": ""}})
        )
    before = {path: path.read_text() for path in (tmp_path / "results").rglob("*.json")}
    told = "tables: 3 results were made by other sources of n2n and are kept"
    code, out = tables("run")
    assert code == 0 and f"{told}; --again measures them anew" in out and "0 of 0 fits measured" in out
    rows = [tables("plan", *options)[1].split("all, shared fits once")[1].split()[:2] for options in ([], ["--again"])]
    assert rows == [["3", "0"], ["3", "3"]]
    # On a machine that lacks the package of the method nobody can measure them anew.
    for module in ("tables.shared", "cli.table_actions"):
        monkeypatch.setattr(f"n2n.{module}.not_installed", lambda method: "pip install it")
    code, out = tables("run", "--again")
    assert code == 0 and f"{told}: pip install it" in out and "0 of 0 fits measured" in out
    assert "--again" not in tables("run")[1]
    assert {path: path.read_text() for path in before} == before


def test_a_plugin_brings_data_a_method_a_table_and_a_profile(lab, tmp_path, capsys):
    assert main(["tables", "run", "lab", "--profile", "lab"]) == 0, capsys.readouterr().err
    records = [json.loads(path.read_text()) for path in (tmp_path / "results" / "lab" / "scanner").glob("*.json")]
    values = {record["shape"]: record["results"]["denoise/sbp"]["values"]["cd_sum2"] for record in records}
    assert set(values) == {"a/1", "a/2", "b/1"} and values["a/1"] > 0
    rows = {row["column"]: row for row in csv.DictReader((tmp_path / "out" / "tables" / "lab" / "lab.csv").open())}
    assert float(rows["CD"]["value"]) == pytest.approx(sum(values.values()) / 3, rel=1e-5)
    by_class = ((values["a/1"] + values["a/2"]) / 2 + values["b/1"]) / 2
    assert float(rows["by class"]["value"]) == pytest.approx(by_class, rel=1e-5)
    assert rows["by class"]["remark"] == "mean over 2 classes: a, b" and rows["CD"]["shapes"] == "3"
