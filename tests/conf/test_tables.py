"""Every table of conf/table under every profile: what it names exists, and the paper's part stays as printed."""

from fnmatch import fnmatch
from pathlib import Path

import pytest
import yaml

import n2n.tables
from n2n.compose import compose, conf_dir
from n2n.errors import ConfigError
from n2n.tables import plan as planning
from n2n.tables.expand import expand
from n2n.tables.fill import fill
from n2n.tables.grid import OURS, PAPER, published
from n2n.tables.plan import make_plan
from n2n.tables.spec import load_profile, load_tables
from n2n.tables.store import Store

TABLES = {table.name: table for table in load_tables()}
PROFILES = ("smoke", "laptop", "paper")
PRINTED = {
    table["id"]: table
    for table in yaml.safe_load((Path(n2n.tables.__file__).parent / "published.yaml").read_text())["tables"]
}
# Some shapes of every dataset, as they are called.
SHAPES = {
    "pu": ["casting", "duck", "eight", "pig", "star"],
    "pc": ["galera", "netsuke"],
    "shapenet": [
        *("airplane/1", "bench/1", "cabinet/1", "car/1", "chair/1", "display/1", "lamp/1", "speaker/1", "rifle/1"),
        *("sofa/1", "table/1", "telephone/1", "vessel/1"),
    ],
    "scene3d": ["copyroom", "lounge"],
}


def present(datamodule, variant=None, root=None):
    return SHAPES.get(datamodule, ["a", "b"]), None


def leaves(node, path=()):
    """Yield (path, number) of every number and dash of a printed table."""
    if isinstance(node, dict):
        for key, value in node.items():
            yield from leaves(value, (*path, str(key)))
    else:
        yield path, node


def printed(name):
    """Return the numbers of a printed table, and which are bold, by the joined path; shares nothing with the reader."""
    table = PRINTED[name]
    numbers = {
        "/".join(path).replace("time_min", "time").replace("mem_GB", "mem"): v for path, v in leaves(table["rows"])
    }
    bold = {f"{'/'.join(path)}/{column}" for path, columns in leaves(table["bold"]) for column in columns}
    return numbers, bold


def test_there_are_the_tables_of_the_paper():
    assert len(TABLES) == len(PRINTED) == 18
    assert {table.spec["published"] for table in TABLES.values()} == set(PRINTED)


@pytest.mark.parametrize("name", PRINTED)
def test_the_paper_s_numbers_and_marks_are_as_printed(name):
    numbers, bold = printed(name)
    grid = published(name).grid
    assert {f"{row}/{column}": cell.value for (row, column), cell in grid.cells.items()} == numbers
    assert {f"{row}/{column}" for (row, column), cell in grid.cells.items() if cell.bold} == bold
    assert all(cell.origin == PAPER and bool(cell.reason) == (cell.value is None) for cell in grid.cells.values())


def test_the_paper_marks_127_numbers():
    assert sum(len(printed(name)[1]) for name in PRINTED) == 127
    assert sum(cell.bold for name in PRINTED for cell in published(name).grid.cells.values()) == 127


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("name", TABLES)
def test_every_cell_of_ours_has_fits_or_a_reason(name, profile):
    cells = expand(TABLES[name], load_profile(profile), present)
    assert cells
    for cell in cells:
        assert bool(cell.fits) != bool(cell.reason)
        assert not any("{" in text for f in cell.fits for text in (*f.settings, cell.row, cell.column))
    places = [(cell.row, cell.column) for cell in cells]
    # A floor is asked for along with every N: the same cell again must be the same number.
    for place in {place for place in places if places.count(place) > 1}:
        same = [cell for cell in cells if (cell.row, cell.column) == place]
        assert all(cell.floor for cell in same) and len({cell.value for cell in same}) == 1


@pytest.mark.parametrize("name", TABLES)
def test_ours_stand_beside_the_paper_s_and_never_over_them(name, tmp_path, monkeypatch):
    monkeypatch.setattr(planning, "shapes_present", present)
    plan = make_plan([name], load_profile("laptop"))
    grid, _ = fill(TABLES[name], plan, Store(tmp_path))
    numbers, bold = printed(TABLES[name].spec["published"])
    found = {f"{row}/{column}": cell for (row, column), cell in grid.cells.items()}
    assert {place: found[place].value for place in numbers} == numbers
    assert {place for place, cell in found.items() if cell.bold} == bold
    assert all(found[place].origin == PAPER for place in numbers)
    ours = [cell for cell in found.values() if cell.origin == OURS]
    # Nothing is measured here.
    assert ours and all(cell.value is None and cell.reason for cell in ours)


@pytest.mark.parametrize("name", TABLES)
def test_footnotes_and_rules_hit_something(name):
    spec, grid = TABLES[name].spec, published(TABLES[name].spec["published"]).grid
    derived = [rule["row"] for rule in spec.get("derived", [])]
    for rule in spec.get("footnotes", []):
        for row in rule.get("rows", []):
            assert row in (*grid.rows, *derived)
        for column in rule.get("columns", []):
            assert column in grid.columns
        assert any(
            (row, column) in grid.cells
            for row in rule.get("rows", grid.rows)
            for column in rule.get("columns", grid.columns)
        )
    for rule in spec.get("derived", []):
        assert rule["from"] in grid.rows and set(rule["factor"]) <= set(grid.columns)
    own = expand(TABLES[name], load_profile("laptop"), present)
    labels = {*grid.rows, *grid.columns, *(label for cell in own for label in (cell.row, cell.column))}
    # Rows of ours that are not measured yet may be named in advance.
    theirs = {label for label in spec.get("unfair", []) if not label.startswith("n2n")}
    assert theirs <= labels | {label.rpartition("/")[2] for label in labels}


@pytest.mark.parametrize("name", TABLES)
def test_values_are_measured_by_their_protocols(name):
    for profile in PROFILES:
        for cell in expand(TABLES[name], load_profile(profile), present):
            if not cell.evaluation:
                assert cell.value in ("cost.minutes", "cost.memory")
                continue
            protocol = yaml.safe_load((conf_dir() / "protocol" / f"{cell.evaluation.split('/')[1]}.yaml").read_text())
            floor, _, metric = cell.value.rpartition(".")
            if metric.endswith("_cropped"):
                assert protocol["crop"]
                metric = metric.removesuffix("_cropped")
            assert metric in protocol["metrics"]
            assert not floor or floor in protocol["floors"]
            # The paper's tables are on the scale the protocol prints.
            assert cell.scale == protocol["metrics"][metric]


@pytest.mark.parametrize("profile", ["laptop", "paper"])
def test_settings_compose(profile):
    """One fit for every set of keys that some table sets: values vary, keys are what can be mistyped."""
    seen = {}
    for table in TABLES.values():
        for cell in expand(table, load_profile(profile), present):
            for f in cell.fits[:1]:
                seen.setdefault((f.datamodule, tuple(text.split("=")[0] for text in f.settings)), f)
    for f in seen.values():
        config = compose([f"datamodule={f.datamodule}", f"datamodule.shape='{f.shape}'", *f.settings])
        assert config["datamodule"]["shape"] == f.shape


def test_profiles_are_what_they_say(monkeypatch):
    monkeypatch.setattr(planning, "shapes_present", present)
    plans = {name: make_plan([], load_profile(name)) for name in PROFILES}
    for f in plans["smoke"].jobs:
        settings = dict(text.split("=") for text in f.settings)
        assert f.datamodule == "generated" and int(settings["iterations"]) <= 4
        assert int(settings["datamodule.points"]) <= 600 and int(settings["num_observations"]) <= 2
    assert all("recipe=paper" in f.settings for f in plans["paper"].jobs)
    tasks = {
        (evaluation.split("/")[0], setting.removeprefix("task="))
        for f, job in plans["paper"].jobs.items()
        for evaluation in job.evaluations
        for setting in f.settings
        if evaluation and setting.startswith("task=")
    }
    # The paper fits anew for every task.
    assert tasks == {("denoise", "denoise"), ("reconstruct", "reconstruct"), ("upsample", "upsample")}
    assert {f.datamodule for f in plans["paper"].jobs} == {
        "pu",
        "pc",
        "shapenet",
        "abc",
        "famous",
        "dfaust",
        "srb",
        "scene3d",
    }
    names = {
        f.shape
        for f, job in plans["laptop"].jobs.items()
        if "T10_observations" in job.tables and "num_observations=20" in f.settings
    }
    assert names == {"casting", "duck", "eight", "pig"}


def test_patterns_of_shapes_find_shapes():
    for table in TABLES.values():
        for experiment in table.spec["experiments"]:
            pattern = experiment.get("shapes", "*")
            if "{" not in pattern:
                assert any(fnmatch(shape, pattern) for shape in SHAPES.get(experiment["datamodule"], ["a"]))


def test_a_profile_says_nothing_unknown(tmp_path, monkeypatch):
    (tmp_path / "profile").mkdir()
    (tmp_path / "profile" / "mine.yaml").write_text("title: mine\nshape: 3\n")
    monkeypatch.setattr("n2n.evaluation.options.conf_dir", lambda: tmp_path)
    with pytest.raises(ConfigError, match=r"mine.yaml: Unknown key 'shape'. Did you mean 'shapes'\?"):
        load_profile("mine")
