"""Tables and profiles as files: what they may say, and which cells and fits come of it."""

from importlib.metadata import EntryPoint

import pytest

from n2n.errors import ConfigError
from n2n.tables.spec import Fit, Profile, load_profile, load_tables


def message(call, *arguments, **named):
    with pytest.raises(ConfigError) as caught:
        call(*arguments, **named)
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_a_table_is_found_by_its_name_or_by_how_it_begins():
    assert [table.name for table in load_tables(["t10", "T02_upsampling", "T10"])] == [
        "T10_observations",
        "T02_upsampling",
    ]
    assert len(load_tables()) == 18
    assert "Unknown table 'T10_obsrvations'. Did you mean 'T10_observations'?" in message(
        load_tables, ["T10_obsrvations"]
    )
    assert message(load_tables, ["T03", "T1"]).startswith("table 'T1' may be any of T10_observations, T11_")


def test_a_profile_is_found_by_its_name():
    assert load_profile("smoke").datamodule == "generated"
    assert message(load_profile, "smok") == "Unknown profile 'smok'. Did you mean 'smoke'? Known: laptop, paper, smoke."


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"titel": "x"}, "Unknown key 'titel'. Did you mean 'title'?"),
        ({"title": 3}, "title is 3; it needs text; put it in quotes"),
        ({"experiments": {}}, "experiments is {}; it needs a list, [a, b]"),
        ({"experiments": ["pu"]}, "experiment 1 is 'pu'; it needs key: value"),
        ({"competitors": "row"}, "competitors is 'row'; choose one of: none, rows, columns"),
        ({"experiment": {"axis": {}}}, "experiment 1: Unknown key 'axis'. Did you mean 'axes'?"),
        ({"experiment": {"axes": {"noise": [1, 2]}}}, "experiment 1: the axis 'noise' needs label: value"),
        ({"experiment": {"axes": {"noise": {"1%": {"skp": "x"}}}}}, "noise: 1% needs one value, or {skip: the reason}"),
        ({"experiment": {"cells": [{"row": "a", "column": "b"}]}}, "experiment 1: a cell: value is missing"),
        (
            {"experiment": {"cells": [{"row": "a", "column": "b", "value": "p2m", "scale": "1e4"}]}},
            "a cell: scale is '1e4'; it needs a number",
        ),
        (
            {"experiment": {"cells": [{"row": "a", "column": "b", "value": "p2m", "mean": "clas"}]}},
            "a cell: mean is 'clas'; choose one of: class",
        ),
        ({"profiles": {"laptop": {"shape": []}}}, "profile laptop: Unknown key 'shape'. Did you mean 'shapes'?"),
        (
            {"profiles": {"laptop": {"axes": {"nose": {}}}}},
            "profile laptop: Unknown axis 'nose'. Did you mean 'noise'?",
        ),
        ({"footnotes": [{"row": ["a"], "text": "x"}]}, "a footnote: Unknown key 'row'. Did you mean 'rows'?"),
        ({"footnotes": [{"rows": ["a"]}]}, "a footnote: text is missing"),
        ({"experiment": {"shapes": 3}}, "shapes is 3; it needs a pattern of names, or a list of names"),
        ({"experiment": {"datamodule": "files"}}, "name them, shapes: [cup, vase], and their files by the settings"),
        ({"derived": [{"from": "a", "row": "b", "note": "c"}]}, "a derived row: factor is missing"),
    ],
)
def test_what_no_table_may_say(write_table, changes, expected):
    folder = write_table(**changes)
    text = message(load_tables, folder=folder)
    assert text.startswith(f"{folder / 'mine.yaml'}: ") and expected in text


def test_files_that_are_no_tables(tmp_path):
    (tmp_path / "mine.yaml").write_text("a: [")
    assert message(load_tables, folder=tmp_path).startswith(f"{tmp_path / 'mine.yaml'}: is not YAML (")
    (tmp_path / "mine.yaml").write_text("- a")
    assert "holds no settings" in message(load_tables, folder=tmp_path)
    (tmp_path / "mine.yaml").write_text("title: x")
    assert message(load_tables, folder=tmp_path).endswith("experiments is missing")
    assert "no table found there" in message(load_tables, folder=tmp_path / "absent")


def test_tables_of_a_folder_stand_beside_ours(write_table):
    folder = write_table()
    assert [table.name for table in load_tables(["T01", "mine"], folder)] == ["T01_denoising", "mine"]
    assert len(load_tables(folder=folder)) == 19
    write_table("T01_denoising")
    assert message(load_tables, folder=folder).endswith(
        "T01_denoising.yaml: a table 'T01_denoising' exists already; give yours another name"
    )


def test_an_installed_package_adds_tables_and_profiles(write_table, tmp_path, monkeypatch):
    package = tmp_path / "table_plugin"
    write_table("theirs").rename(tmp_path / "table")
    package.mkdir()
    (package / "__init__.py").touch()
    (tmp_path / "table").rename(package / "table")
    (package / "profile").mkdir()
    (package / "profile" / "night.yaml").write_text("title: over night\nsettings: [recipe=fast, iterations=480]\n")
    (package / "profile" / "paper.yaml").write_text("title: not ours\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(
        "n2n.evaluation.options.entry_points", lambda group: [EntryPoint("theirs", "table_plugin", group)]
    )
    assert [table.title for table in load_tables(["theirs"])] == ["a table"]
    assert load_profile("night") == Profile("night", "over night", ["recipe=fast", "iterations=480"])
    assert load_profile("paper").title != "not ours"


def test_every_place_on_the_axes_is_a_cell(cells):
    found = cells({"axes": {"noise": {"1%": 0.01, "2%": 0.02}, "N": {"one": 1, "many": 200}}, "note": "so it is"})
    assert len(found) == 4
    assert [(cell.row, cell.column) for cell in cells()] == [("ours", "1%"), ("ours", "2%")]
    first = cells()[0]
    assert (first.evaluation, first.value, first.scale, first.floor) == ("denoise/sbp", "p2m", 10000.0, "")
    assert first.fits == [Fit("n2n", "pu", name, ("datamodule.noise=0.01",)) for name in ("cow", "duck")]
    assert first.whole and first.reason == "" and first.notes == [] and found[0].notes == ["so it is"]


def test_labels_may_have_no_value_but_a_reason(cells):
    skipped, measured = cells({"axes": {"noise": {"1%": {"skip": "it takes a year"}, "2%": 0.02}}})
    assert (skipped.fits, skipped.reason) == ([], "it takes a year")
    assert measured.fits and not measured.reason


def test_of_two_settings_of_one_key_the_last_counts_and_limits_cut_it(cells):
    profile = Profile(
        "p", "", settings=["iterations=160 seed=1", "batch_size=auto"], limits={"iterations": 100, "batch_size": 5}
    )
    fit = cells({"settings": ["iterations=800", "datamodule.noise={noise}"]}, profile)[0].fits[0]
    assert fit.settings == ("batch_size=5", "datamodule.noise=0.01", "iterations=100", "seed=1")
    assert cells({"settings": ["iterations=80"]}, profile)[0].fits[0].settings == (
        "batch_size=5",
        "iterations=80",
        "seed=1",
    )
    own = {"p": {"settings": ["seed=2", "iterations=7"], "shapes": ["duck"], "axes": {"noise": {"2%": 0.5}}}}
    last = cells(None, profile, profiles=own)[-1]
    assert [fit.shape for fit in last.fits] == ["duck"] and not last.whole
    assert last.fits[0].settings == ("batch_size=5", "datamodule.noise=0.5", "iterations=7", "seed=2")


def test_the_task_is_a_word_for_settings(cells):
    (cell, _) = cells({"settings": ["task={task}"], "evaluate": "upsample/sbp"})
    assert cell.fits[0].settings == ("task=upsample",)
    costs = cells(
        {"settings": ["task={task}"], "cells": [{"row": "a", "column": "b", "value": "cost.minutes"}], "evaluate": ""}
    )
    assert costs[0].fits[0].settings == ("task=denoise",) and costs[0].floor == ""


def test_a_floor_is_named_by_the_value(cells):
    (cell, _) = cells({"cells": [{"row": "a", "column": "{noise}", "value": "oracle.p2m"}]})
    assert cell.floor == "oracle"


def test_generated_shapes_stand_in_for_every_dataset(cells):
    profile = Profile("p", "", datamodule="generated", keep=["datamodule.noise"], shapes=1)
    present = {"generated": (["ball", "cube"], None)}
    changed = {"shapes": "duck", "settings": ["datamodule.variant=x datamodule.noise={noise}"]}
    first = cells(changed, profile, lambda name, variant: present[name], profiles={"p": {"shapes": ["pig"]}})[0]
    assert first.fits == [Fit("n2n", "generated", "ball", ("datamodule.noise=0.01",))]
    assert not first.whole and first.notes == []


def test_what_is_missing_is_said_in_the_datamodules_words(cells):
    missing = "PU meshes not present: duck; get it with `n2n data fetch pu`"
    assert cells(present=lambda name, variant: ([], missing))[0].reason == missing
    partly = cells(present=lambda name, variant: (["cow"], missing))[0]
    assert partly.notes == [missing] and partly.reason == "" and not partly.whole and len(partly.fits) == 1
    assert cells({"shapes": "pig*"})[0].reason == "pu: no shape pig* is here"
    own = {"p": {"shapes": ["pig", "elk"]}}
    assert cells(profiles=own)[0].reason == "pu: none of the shapes pig, elk is here"


FILES = {
    "datamodule": "files",
    "shapes": ["{noise}", "a vase"],
    "axes": {"noise": {"fine": "cup", "coarse": "bowl"}, "method": {"ours": "n2n", "theirs": "jet"}},
    "method": "{method}",
    "settings": ["datamodule.paths=[my scans/{shape}.ply,b.ply] seed=1", "datamodule.reference=[{shape}.off]"],
    "cells": [{"row": "{method}", "column": "{noise}", "value": "p2m"}],
}


def test_files_are_the_shapes_a_table_lists_each_by_every_method(cells):
    found = cells(FILES, present=None)
    assert [(c.row, c.column, c.method) for c in found] == [
        ("ours", "fine", "n2n"), ("theirs", "fine", "jet"), ("ours", "coarse", "n2n"), ("theirs", "coarse", "jet"),
    ]  # fmt: skip
    assert [fit.shape for fit in found[2].fits] == ["bowl", "a vase"] and found[2].whole
    assert found[3].fits[1] == Fit(
        "jet",
        "files",
        "a vase",
        ("datamodule.paths=[my scans/a vase.ply,b.ply]", "datamodule.reference=[a vase.off]", "seed=1"),
    )


def test_generated_shapes_stand_in_for_files(cells):
    first, *_ = cells(FILES, Profile("p", "", datamodule="generated"), lambda name, variant: (["ball"], None))
    assert first.fits == [Fit("n2n", "generated", "ball", ("seed=1",))]


def test_an_experiment_may_belong_to_some_profiles_only(cells):
    assert cells({"only": ["laptop"]}) == []
    assert len(cells({"only": ["p"]})) == 2


@pytest.mark.parametrize(
    ("experiment", "expected"),
    [
        ({"settings": ["a={nois}"]}, "Unknown axis {nois} in 'a={nois}'. Did you mean 'noise'?"),
        ({"settings": ["recipe"]}, "cannot read the setting 'recipe'; write key=value"),
        ({"evaluate": "denoize/sbp"}, "Unknown task 'denoize'. Did you mean 'denoise'?"),
        ({"evaluate": "sbp"}, "p2m is measured by a protocol; give it as evaluate: task/protocol"),
        ({"method": "{nose}"}, "Unknown axis {nose} in '{nose}'. Did you mean 'noise'?"),
        ({"method": "poison"}, "Unknown method 'poison'. Did you mean 'poisson'?"),
        (
            {"cells": [{"row": "a", "column": "b", "value": "cost.minuts"}]},
            "Unknown cost 'minuts'. Did you mean 'minutes'?",
        ),
    ],
)
def test_what_does_not_exist_is_found_before_anything_is_measured(cells, experiment, expected):
    assert message(cells, experiment).startswith(f"table mine: {expected}")


def test_a_fit_is_named_by_what_it_is_made_of():
    fit = Fit("n2n", "pu", "duck", ("a=1", "b=2"))
    assert fit.id == Fit("n2n", "pu", "duck", ("a=1", "b=2")).id and len(fit.id) == 12 and int(fit.id, 16)
    others = [
        Fit("jet", "pu", "duck", ("a=1", "b=2")),
        Fit("n2n", "pc", "duck", ("a=1", "b=2")),
        Fit("n2n", "pu", "cow", ("a=1", "b=2")),
    ]
    assert len({fit.id, Fit("n2n", "pu", "duck", ("a=1",)).id, *(other.id for other in others)}) == 5
    # Results on disk are found by it, so it must never change.
    assert fit.id == "5c50a8236b23"


def test_each_variant_of_a_dataset_has_its_own_shapes(cells):
    """ABC, its noisier copy and its training shapes are three lists."""
    present = {"abc": ["cube"], "abc_minimal": ["ring", "rod"]}
    spec = {
        "settings": ["datamodule.variant={variant}"],
        "axes": {"variant": {"A": "abc", "B": "abc_minimal"}, "noise": {"1%": 0.01}},
    }
    found = cells(spec, present=lambda name, variant: (present[variant], None))
    assert [[fit.shape for fit in cell.fits] for cell in found] == [["cube"], ["ring", "rod"]]
