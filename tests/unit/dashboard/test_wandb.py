"""The dashboard on W&B: every panel of the definition is there, and what would be sent is what was defined."""

import json
from types import SimpleNamespace

import pytest

from n2n.dashboard import wandb as board
from n2n.dashboard.definition import SECTIONS
from n2n.errors import ConfigError

pytest.importorskip("wandb_workspaces", reason="needs the extra wandb-workspaces")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of wandb-workspaces itself


class Server:
    """Stands in for W&B: knows one project, keeps what is saved."""

    def __init__(self):
        self.saved = []
        self._service_api = SimpleNamespace(execute_graphql=self.execute, app_url="https://wandb.example")

    def execute(self, query, variables):
        if "upsertView" in query:
            self.saved.append(variables)
            view = {"id": f"id{len(self.saved)}", "name": variables["name"], "displayName": "n2n", "type": "runs"}
            project = {"id": "1", "name": "project", "entityName": "team"}
            more = {
                "description": "",
                "spec": variables["spec"],
                "updatedAt": "2026-01-01T00:00:00",
                "project": project,
            }
            return {"upsertView": {"view": {**view, **more}, "inserted": True}}
        known = variables["projectName"] == "project"
        return {"project": {"internalId": "1"} if known else None}

    def projects(self, entity):
        return [SimpleNamespace(name="project")]


@pytest.fixture
def server(monkeypatch):
    import wandb

    server = Server()
    monkeypatch.setattr(wandb, "Api", lambda *arguments, **settings: server)
    monkeypatch.setattr(wandb, "login", lambda **settings: True)
    return server


def test_both_are_saved_and_hold_every_section_and_metric(server):
    addresses = board.publish("team", "project")
    assert all(address.startswith("https://wandb.example/team/project") for address in addresses)
    kinds = {kept["type"]: json.loads(kept["spec"]) for kept in server.saved}
    assert set(kinds) == {"project-view", "runs"} and len(server.saved) == 2
    sections = kinds["project-view"]["section"]["panelBankConfig"]["sections"]
    assert [section["name"] for section in sections] == [section.title for section in SECTIONS]
    blocks = kinds["runs"]["blocks"]
    titles = [block["children"][0]["text"] for block in blocks if block["type"] == "heading"]
    assert titles == [section.title for section in SECTIONS]
    grids = [block["metadata"]["panelBankSectionConfig"]["panels"] for block in blocks if block["type"] == "panel-grid"]
    for section, sent, grid in zip(SECTIONS, sections, grids, strict=True):
        for panels in (sent["panels"], grid):
            text = json.dumps(panels)
            assert len(panels) >= len(section.panels)
            for panel in section.panels:
                if panel.kind != "runs":
                    assert all(f"{metric}" in text for metric in panel.metrics), (section.key, panel.title)
        places = {(p["layout"]["x"], p["layout"]["y"]) for p in grid}
        assert len(places) == len(grid), "panels of the report lie on top of each other"


def test_ablations_show_runs_against_the_setting_and_the_papers_numbers():
    panel = next(p for section in SECTIONS for p in section.panels if p.x == "batch_size")
    *ours, paper = [part._to_model().config.model_dump(by_alias=True, exclude_none=True) for part in board.drawn(panel)]
    assert {plot["xAxis"] for plot in ours} == {"config:batch_size.value"}
    assert [plot["yAxis"] for plot in ours] == [f"summary:{metric}" for metric in panel.metrics]
    # Table 8 of the paper: CD at B = 250 is 4.221, times 10^4.
    row = next(line for line in paper["value"].splitlines() if line.startswith("| CD | 250 |"))
    assert [float(cell) for cell in row.strip("|").split("|")[2:]] == pytest.approx([4.221, 4.221e-4])


def test_curves_run_over_the_iteration_that_lightning_logs():
    curves = [p for section in SECTIONS for p in section.panels if p.kind == "curve"]
    for panel in curves:
        (plot,) = board.drawn(panel)
        model = plot._to_model().config.model_dump(by_alias=True, exclude_none=True)
        assert model["xAxis"] == "trainer/global_step" and model["metrics"] == list(panel.metrics)


def test_an_unknown_project_is_one_line(server):
    with pytest.raises(ConfigError, match="team/other") as caught:
        board.publish("team", "other")
    assert "\n" not in str(caught.value)


def test_without_a_login_nothing_is_asked_of_anybody(monkeypatch, tmp_path):
    import wandb

    for key in ("WANDB_API_KEY", "WANDB_IDENTITY_TOKEN_FILE"):
        monkeypatch.delenv(key, raising=False)
    monkeypatch.setenv("NETRC", str(tmp_path / "netrc"))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(wandb, "Api", lambda *arguments, **settings: pytest.fail("asked W&B"))
    with pytest.raises(ConfigError, match="wandb login") as caught:
        board.publish("team", "project")
    assert "\n" not in str(caught.value)
