"""Tables as files, and the index."""

import csv

import pytest

from n2n.errors import OutputError
from n2n.tables import plan as planning
from n2n.tables.plan import make_plan
from n2n.tables.spec import Profile
from n2n.tables.store import Store
from n2n.tables.write import write_tables


@pytest.fixture
def plan(monkeypatch, write_table):
    monkeypatch.setattr(planning, "shapes_present", lambda name, variant, root=None: (["duck"], None))
    return make_plan(["T10", "mine"], Profile("p", "a profile"), folder=write_table())


def record(job, sources):
    results = {
        e: {"definition": "now", "asked": sorted(floors), "values": {"p2m": 2e-4, "cd_sum2": 4e-4}, "blanks": {}}
        | {"floors": {floor: {"p2m": 1e-4, "cd_sum2": 1e-4} for floor in floors}}
        for e, floors in job.evaluations.items()
    }
    made = {"n2n": "0.1.0", "commit": "abc", "sources": sources, "machine": "x86_64, 2 cores"}
    return {"status": "done", "results": results, "cost": {}, "made": made}


def test_tables_and_their_index(plan, tmp_path):
    plan.protocols = dict.fromkeys(plan.protocols, "now")
    store, out = Store(tmp_path / "results"), tmp_path / "deep" / "out"
    first, second, *_ = plan.jobs.values()
    store.write(first.fit, record(first, "new"))
    store.write(second.fit, record(second, "old"))
    made = write_tables(plan, store, out)
    files = {f"{name}.{suffix}" for name in ("T10_observations", "mine") for suffix in ("md", "tex", "csv")}
    assert {path.name for path in out.iterdir()} == {*files, "index.md"}
    index = (out / "index.md").read_text()
    for name, table in made.items():
        assert f"| [{name}]({name}.md) | " in index and f" | {table.ours} | {table.blank} |" in index
        assert (out / f"{name}.md").read_text() == table.markdown
        assert len(list(csv.DictReader((out / f"{name}.csv").open()))) > 0
    assert "- 1 fits by n2n 0.1.0, commit abc, sources new on x86_64, 2 cores" in index
    assert "- 1 fits by n2n 0.1.0, commit abc, sources old on x86_64, 2 cores" in index
    assert made["T10_observations"].ours == 4 and made["T10_observations"].blank == 10
    assert "**4.221**" in made["T10_observations"].markdown and "Paper: PU" in made["T10_observations"].markdown
    # A table of one's own stands without the paper's.
    assert "Paper:" not in made["mine"].markdown and "| ours | -<sup>1</sup> | -<sup>1</sup> |" in made["mine"].markdown


def test_a_folder_that_cannot_be_made(plan, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="give another one with --out"):
        write_tables(plan, Store(tmp_path), tmp_path / "file")
