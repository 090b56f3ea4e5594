"""What has to be measured: every fit once, whoever wants it, and only what is not there."""

import dataclasses
import sys
import types

import pytest

from n2n.errors import ConfigError
from n2n.tables import plan as module
from n2n.tables.methods import not_installed
from n2n.tables.plan import Job, estimate, make_plan
from n2n.tables.spec import Fit, Profile
from n2n.tables.store import Store

PROFILE = Profile("p", "a profile", ["recipe=fast"])


@pytest.fixture(autouse=True)
def shapes(monkeypatch):
    """Two shapes of every dataset, whatever lies on this machine."""
    monkeypatch.setattr(module, "shapes_present", lambda name, variant, root=None: (["cow", "duck"], None))


def done(plan, fit, sources="now"):
    """A record that holds all that a plan wants of a fit."""
    results = {
        e: {"definition": plan.protocols[e], "asked": sorted(floors), "values": {}, "floors": {}, "blanks": {}}
        for e, floors in plan.jobs[fit].evaluations.items()
        if e
    }
    return {"status": "done", "results": results, "cost": {}, "made": {"sources": sources}}


def test_a_fit_that_tables_share_is_planned_once():
    plan = make_plan([], PROFILE)
    assert len({fit.id for fit in plan.jobs}) == len(plan.jobs)
    shared = Fit(
        "n2n", "pu", "duck", ("datamodule.noise=0.03", "datamodule.points=10000", "num_observations=1", "recipe=fast")
    )
    job = plan.jobs[shared]
    assert {"T01_denoising", "T10_observations", "T15_density", "T17_observations_all_tasks"} <= job.tables
    assert {"denoise/sbp", "upsample/sbp", "reconstruct/sbp"} == set(job.evaluations)
    # Table 1 wants the floors of the denoised cloud, and nobody those of the mesh.
    assert job.evaluations["denoise/sbp"] == {"oracle", "do_nothing"} and job.evaluations["reconstruct/sbp"] == set()


@pytest.mark.parametrize("name", ["T01_denoising", "T10_observations", "T17_observations_all_tasks"])
def test_one_table_alone_plans_the_same_fits(name):
    everything, alone = make_plan([], PROFILE), make_plan([name], PROFILE)
    assert list(alone.wanted) == [name]
    assert {j.fit.id for j in alone.jobs.values()} == {j.fit.id for j in everything.jobs.values() if name in j.tables}
    assert all(job == everything.jobs[fit] for fit, job in alone.jobs.items())


def test_a_folder_of_tables_stands_for_itself_unless_others_are_named(write_table):
    folder = write_table()
    assert list(make_plan([], PROFILE, folder=folder).wanted) == ["mine"]
    assert list(make_plan(["T10", "mine"], PROFILE, folder=folder).wanted) == ["T10_observations", "mine"]
    with pytest.raises(ConfigError, match=r"Unknown protocol 'spb'. Did you mean 'sbp'\?"):
        make_plan([], PROFILE, folder=write_table(experiment={"evaluate": "denoise/spb"}))


def test_only_what_is_not_there_is_open(tmp_path):
    plan, store = make_plan(["T10"], PROFILE), Store(tmp_path)
    fits = list(plan.jobs)
    assert [job.fit for job in plan.open(store)] == fits
    store.write(fits[0], done(plan, fits[0]))
    store.write(fits[1], fits[1].failed("broken"))
    assert [job.fit for job in plan.open(store)] == fits[1:]


def test_what_needs_a_package_that_is_not_here_is_not_open(tmp_path, monkeypatch, write_table):
    folder = write_table(experiment={"axes": {"noise": {"1%": 0.01}, "m": {"a": "jet", "b": "n2n"}}, "method": "{m}"})
    plan, store = make_plan([], PROFILE, folder=folder), Store(tmp_path / "results")
    for lacking, methods in {"": ["jet", "jet", "n2n", "n2n"], "pip install": ["n2n", "n2n"]}.items():
        monkeypatch.setattr(module, "not_installed", {"jet": lacking, "n2n": ""}.get)
        assert [job.fit.method for job in plan.open(store)] == methods


def test_a_missing_package_is_said_in_the_words_of_the_baseline(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymeshlab", None)
    not_installed.cache_clear()
    assert not_installed("poisson").endswith("pip install 'n2n[poisson]'") and not_installed("n2n") == ""
    not_installed.cache_clear()
    monkeypatch.setitem(sys.modules, "pymeshlab", types.ModuleType("pymeshlab"))
    assert not_installed("poisson") == ""
    not_installed.cache_clear()


def test_another_definition_of_a_protocol_opens_only_its_evaluations(tmp_path):
    plan, store = make_plan(["T04", "T10"], PROFILE), Store(tmp_path)
    for fit in plan.jobs:
        store.write(fit, done(plan, fit))
    assert plan.open(store) == []
    plan.protocols = {e: "other" if e.endswith("/p2s") else known for e, known in plan.protocols.items()}
    assert {job.fit.datamodule for job in plan.open(store)} == {"abc", "famous"}


def test_what_other_sources_have_measured_is_told_apart(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "sources", lambda: "now")
    plan, store = make_plan(["T10"], PROFILE), Store(tmp_path)
    first, second, *_ = plan.jobs
    store.write(first, done(plan, first))
    store.write(second, done(plan, second, "before"))
    assert [job.fit for job in plan.stale(store)] == [second]


def test_a_datamodule_without_a_truth_is_refused(monkeypatch):
    monkeypatch.undo()
    with pytest.raises(ConfigError, match="datamodule 'files' knows no true surface"):
        module.shapes_present("files", None)
    with pytest.raises(ConfigError, match=r"Unknown datamodule 'puu'. Did you mean 'pu'\?"):
        module.shapes_present("puu", None)


def test_without_data_every_cell_says_what_is_missing(monkeypatch, tmp_path):
    monkeypatch.undo()
    plan = make_plan([], PROFILE, root=str(tmp_path))
    assert plan.jobs == {}
    reasons = {cell.reason for cells in plan.wanted.values() for cell in cells}
    assert all("n2n data fetch" in reason or "not in this profile" in reason for reason in reasons)
    assert plan.wanted["T10_observations"][0].reason == module.shapes_present("pu", None, str(tmp_path))[1]


def test_more_work_is_estimated_longer():
    def seconds(*settings, gpu=False, method="n2n"):
        return estimate(Job(Fit(method, "pu", "duck", settings), {"denoise/sbp": set()}), gpu)

    fast = seconds("datamodule.points=10000", "num_observations=1")
    assert (
        1
        < fast
        < seconds("datamodule.points=50000", "num_observations=1")
        < seconds("datamodule.points=50000", "num_observations=200")
    )
    paper = seconds("recipe=paper", "iterations=800000")
    assert paper > 100 * fast and paper == seconds("recipe=paper", "iterations=auto") > seconds(
        "recipe=paper", gpu=True
    )
    assert seconds("recipe=paper", "batch_size=5000") > 10 * paper
    assert seconds(method="jet") < 60


def test_a_job_is_plain_data():
    job = Job(Fit("n2n", "pu", "duck", ()), {"denoise/sbp": {"oracle"}})
    assert dataclasses.asdict(job)["fit"]["shape"] == "duck"
