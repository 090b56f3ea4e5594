"""The dashboard as a workspace and a report of W&B, from the same definition as the page."""

import tempfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from n2n.dashboard.counterparts import COUNTERPARTS
from n2n.dashboard.definition import SECTIONS, Panel
from n2n.dashboard.paper import curve_of, number_of
from n2n.errors import ConfigError
from n2n.tables.grid import published
from n2n.tracking.wandb import require_login, wandb_at

NAME = "n2n"
_STEP = "trainer/global_step"  # what Lightning calls the iteration
_SHAPE = "datamodule.shape"
_FAILED = (
    "Runs whose state is `failed` or `crashed` stopped before their field was saved. `n2n sweep status NAME` lists "
    "them with their last error, `n2n sweep retry NAME` runs them again. Group the table of runs by State to count "
    "them."
)


def publish(entity: str, project: str) -> tuple[str, str]:
    """Create the workspace and the report in a project of W&B.

    Returns:
        The addresses of both.

    Raises:
        ConfigError: The package wandb-workspaces is missing, nobody is logged in, or W&B does not answer.
    """
    if not find_spec("wandb_workspaces"):
        raise ConfigError(
            "--wandb needs the package wandb-workspaces; install it with `pip install 'n2n[wandb-workspaces]'`"
        )
    import wandb

    with tempfile.TemporaryDirectory() as folder, wandb_at(Path(folder)):
        wandb.setup(wandb.Settings(silent=True))
        require_login("--wandb", "write the same as a page: `n2n dashboard -o dashboard.html`")
        try:
            return workspace(entity, project).save().url, report(entity, project).save().url
        except (wandb.Error, OSError, ValueError) as error:
            reason = " ".join(str(error).split())
            raise ConfigError(f"--wandb {entity}/{project}: W&B refuses or cannot be reached ({reason})") from error


def workspace(entity: str, project: str) -> Any:
    """Return the definition as a workspace; nothing is sent."""
    import wandb_workspaces.workspaces as ws

    sections = [
        ws.Section(name=section.title, panels=[part for panel in section.panels for part in drawn(panel)], is_open=True)
        for section in SECTIONS
    ]
    return ws.Workspace(entity=entity, project=project, name=NAME, sections=sections)


def report(entity: str, project: str) -> Any:
    """Return the definition as a report; nothing is sent."""
    import wandb_workspaces.reports.v2 as wr

    blocks: list[Any] = [wr.TableOfContents()]
    for section in SECTIONS:
        runs = [wr.Runset(entity=entity, project=project, name="Runs")]
        if section.key == "health":
            runs = [wr.Runset(entity=entity, project=project, name="Runs by state", groupby=["State"])]
        panels = [part for panel in section.panels for part in drawn(panel)]
        blocks += [wr.H1(section.title), wr.PanelGrid(runsets=runs, panels=panels)]
    about = "Made by `n2n dashboard --wandb`; the same sections as the page of `n2n dashboard`. Values are raw."
    return wr.Report(entity=entity, project=project, title=NAME, description=about, blocks=blocks, width="fluid")


def drawn(panel: Panel) -> list[Any]:
    """Return the panels of W&B that show one of the definition's."""
    return _DRAWN[panel.kind](panel)


def _cards(panel: Panel) -> list[Any]:
    import wandb_workspaces.reports.v2 as wr

    return [wr.ScalarChart(title=f"Lowest {name}", metric=name, groupby_aggfunc="min") for name in panel.metrics]


def _versus(panel: Panel) -> list[Any]:
    rows = []
    for known in COUNTERPARTS:
        cell = published(known.table).grid.cells[known.row, known.column]
        if cell.value is not None:
            where = ", ".join(f"{key.removeprefix('datamodule.')}={value}" for key, value in known.where)
            place = f"{number_of(known.table)}: {known.row}, {known.column}"
            rows.append((where, known.metric, place, f"{cell.value:g}", f"{cell.value / known.scale:.4g}"))
    table = _table(("data", "metric", "place in the paper", "as printed", "raw"), rows)
    return [_text(f"### {panel.title}\n\n{table}"), *_bars(panel.title, dict.fromkeys(c.metric for c in COUNTERPARTS))]


def _curve(panel: Panel) -> list[Any]:
    import wandb_workspaces.reports.v2 as wr

    return [wr.LinePlot(title=panel.title, x=_STEP, y=list(panel.metrics), log_y=panel.log or None)]


def _ablation(panel: Panel) -> list[Any]:
    import wandb_workspaces.reports.v2 as wr

    ours = [
        wr.ScatterPlot(
            title=f"{panel.title}: {metric}", x=wr.Config(panel.x), y=wr.SummaryMetric(metric), log_y=panel.log or None
        )
        for metric in panel.metrics
    ]
    rows = []
    for curve in map(curve_of, panel.paper):
        rows += [(curve["label"], f"{x:g}", f"{y:g}", f"{y / panel.scale:.4g}") for x, y in curve["points"]]
    if not rows:
        return ours
    table = _table((f"paper, {panel.paper[0].table}", panel.x, "as printed", "raw"), rows)
    return [*ours, _text(f"### {panel.title}: the paper\n\n{table}")]


def _explore(panel: Panel) -> list[Any]:
    import wandb_workspaces.reports.v2 as wr

    return [wr.ParameterImportancePlot(with_respect_to=metric) for metric in panel.metrics]


def _parallel(panel: Panel) -> list[Any]:
    import wandb_workspaces.reports.v2 as wr

    axes = [panel.x for section in SECTIONS for panel in section.panels if panel.x]
    columns = [wr.Config(axis) for axis in (*axes, "seed")] + [wr.SummaryMetric(metric) for metric in panel.metrics]
    return [
        wr.ParallelCoordinatesPlot(
            title=panel.title, columns=[wr.ParallelCoordinatesPlotColumn(metric=column) for column in columns]
        )
    ]


def _runs(panel: Panel) -> list[Any]:
    import wandb_workspaces.reports.v2 as wr

    return [wr.RunComparer(diff_only="split")]


def _shapes(panel: Panel) -> list[Any]:
    return _bars(panel.title, panel.metrics, groupby=_SHAPE, groupby_aggfunc="mean")


def _scene(panel: Panel) -> list[Any]:
    import wandb_workspaces.reports.v2 as wr

    return [wr.MediaBrowser(title=f"{panel.title}: {metric}", media_keys=[metric]) for metric in panel.metrics]


def _states(panel: Panel) -> list[Any]:
    return _bars(panel.title, ["Runtime"], groupby="State", groupby_aggfunc="sum")


def _failures(panel: Panel) -> list[Any]:
    return [_text(f"### {panel.title}\n\n{_FAILED}")]


def _rates(panel: Panel) -> list[Any]:
    return _bars(panel.title, panel.metrics)


_DRAWN: dict[str, Callable[[Panel], list[Any]]] = {
    "cards": _cards,
    "versus": _versus,
    "curve": _curve,
    "ablation": _ablation,
    "explore": _explore,
    "parallel": _parallel,
    "runs": _runs,
    "shapes": _shapes,
    "scene": _scene,
    "states": _states,
    "failures": _failures,
    "rates": _rates,
}


def _bars(title: str, metrics: Any, **grouping: Any) -> list[Any]:
    import wandb_workspaces.reports.v2 as wr

    return [wr.BarPlot(title=f"{title}: {metric}", metrics=[metric], **grouping) for metric in metrics]


def _text(markdown: str) -> Any:
    import wandb_workspaces.reports.v2 as wr

    return wr.MarkdownPanel(markdown=markdown)


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
