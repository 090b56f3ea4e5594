"""The paper's numbers beside those of runs."""

from collections.abc import Sequence
from typing import Any

from n2n.dashboard.counterparts import COUNTERPARTS, Counterpart
from n2n.dashboard.definition import PaperCurve
from n2n.dashboard.run import Run
from n2n.tables.grid import published
from n2n.tables.spec import load_tables


def curve_of(reference: PaperCurve) -> dict[str, Any]:
    """Return a curve of the paper: label, metric, where it is printed, and (x, value) in the paper's unit."""
    table = published(reference.table)
    points = []
    for column in table.grid.columns:
        cell = table.grid.cells.get((reference.row, column))
        if cell is not None and cell.value is not None and column.startswith(reference.prefix):
            points.append((round(reference.factor * float(column.removeprefix(reference.prefix)), 9), cell.value))
    return {
        "label": reference.label,
        "metric": reference.metric,
        "table": number_of(reference.table),
        "data": table.dataset.split(", inferred")[0].rstrip(")") + ")" * ("(" in table.dataset),
        "points": sorted(points),
    }


def number_of(table: str) -> str:
    """Return the number that a published table goes by here.

    >>> number_of("T08_ablation_B")
    'T08'
    """
    return table.partition("_")[0]


def versus(runs: Sequence[Run]) -> list[dict[str, Any]]:
    """Return every number of the paper that runs have a counterpart of, with the indices of those runs.

    The page takes the mean over the shapes of runs that agree in all other settings.
    """
    rows = []
    specs = [table.spec for table in load_tables()]
    footnotes = {spec["published"]: spec.get("footnotes", []) for spec in specs if "published" in spec}
    for counterpart in COUNTERPARTS:
        found = [index for index, run in enumerate(runs) if _is_counterpart(run, counterpart)]
        if not found:
            continue
        table = published(counterpart.table)
        cell = table.grid.cells[counterpart.row, counterpart.column]
        rows.append(
            {
                "table": number_of(counterpart.table),
                "what": table.caption.split(" comparison")[0] if table.caption else "",
                "place": f"{counterpart.row}, {counterpart.column}",
                "metric": counterpart.metric,
                "scale": counterpart.scale,
                "paper": cell.value,
                "whole": counterpart.shapes,
                "runs": found,
                "notes": [
                    rule["text"] for rule in footnotes.get(counterpart.table, []) if _concerns(rule, counterpart)
                ],
            }
        )
    return rows


def _concerns(rule: dict[str, Any], counterpart: Counterpart) -> bool:
    """Tell whether a footnote of conf/table is about the paper's cell."""
    rows, columns = (rule.get(key, [own]) for key, own in (("rows", counterpart.row), ("columns", counterpart.column)))
    return counterpart.row in rows and counterpart.column in columns


def _is_counterpart(run: Run, counterpart: Counterpart) -> bool:
    return counterpart.metric in run.values and all(run.effective.get(key) == value for key, value in counterpart.where)
