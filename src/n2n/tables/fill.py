"""From stored results to a table: ours beside the published numbers."""

import statistics
from collections import Counter
from typing import Any

from n2n.evaluation.measures import MEASURES
from n2n.evaluation.protocol import CROPPED
from n2n.tables.grid import FLOOR, OTHER, OURS, PAPER, Cell, Grid, Published, published
from n2n.tables.methods import not_installed
from n2n.tables.plan import Plan
from n2n.tables.spec import Table, Wanted
from n2n.tables.store import Store, lacking


def fill(table: Table, plan: Plan, store: Store) -> tuple[Grid, Published]:
    """Return a table with every cell filled, or blank for a reason, and the paper's table it belongs to."""
    paper = published(table.spec["published"]) if "published" in table.spec else Published(Grid())
    grid = paper.grid
    _derive(grid, table.spec.get("derived", []))
    for wanted in plan.wanted[table.name]:
        grid.put(wanted.row, wanted.column, _cell(wanted, store, plan.protocols))
    _footnotes(grid, table.spec.get("footnotes", []))
    _mark_best(grid, table.spec)
    _order(grid)
    _tell_sources(grid)
    return grid, paper


def _cell(wanted: Wanted, store: Store, protocols: dict[str, str]) -> Cell:
    origin = FLOOR if wanted.floor else OURS if wanted.method == "n2n" else OTHER
    if wanted.reason:
        return Cell(None, origin, wanted.reason)
    groups: dict[str, list[float]] = {}
    lost: dict[str, str] = {}
    sources: Counter[str] = Counter()
    for fit in wanted.fits:
        record = store.read(fit)
        value, why = _value(wanted, record, protocols)
        if record is None or value is None:
            lost[fit.shape] = why
        else:
            sources[record["made"]["sources"]] += 1
            groups.setdefault(fit.shape.split("/")[0] if wanted.by_class else "", []).append(value)
    reasons = [f"{shape}: {why}" for shape, why in lost.items()]
    if not groups:
        return Cell(None, origin, lost.popitem()[1] if len(set(lost.values())) == 1 else "; ".join(reasons))
    count = sum(map(len, groups.values()))
    notes = list(wanted.notes)
    if lost:
        notes.append(f"mean of {count} of {len(wanted.fits)} shapes; {'; '.join(reasons)}")
    if wanted.by_class:
        notes.append(f"mean over {len(groups)} classes: {', '.join(groups)}")
    if len(sources) > 1:
        parts = ", ".join(f"{number} by {name}" for name, number in sorted(sources.items()))
        notes.append(f"mean over results of different sources of n2n: {parts}")
    mean = statistics.fmean(statistics.fmean(group) for group in groups.values())
    return Cell(
        value=wanted.scale * mean,
        origin=origin,
        shapes=count,
        whole=wanted.whole and not lost,
        higher=_is_higher_better(wanted.value.rpartition(".")[2]),
        notes=notes,
        sources=sorted(sources),
    )


def _is_higher_better(metric: str) -> bool:
    measure = MEASURES.get(metric.removesuffix(CROPPED))
    return measure is not None and measure.better == "high"


def _value(wanted: Wanted, record: dict[str, Any] | None, protocols: dict[str, str]) -> tuple[float | None, str]:
    """Return a number of a record, or why there is none."""
    if record is None:
        return None, not_installed(wanted.method) or "not measured yet"
    if record["status"] == "damaged":
        return None, "not measured: its result file is damaged"
    if record["status"] != "done":
        return None, f"failed: {record['error']}"
    if blank := record["results"].get(wanted.evaluation, {}).get("blank"):
        return None, blank
    if lacking(record, {wanted.evaluation: {wanted.floor} - {""}}, protocols):
        return None, "not measured yet by the present definition of the protocol"
    group, _, key = wanted.value.rpartition(".")
    if group == "cost":
        return record["cost"].get(key), "" if key in record["cost"] else f"the {key} of this fit were not measured"
    result: dict[str, Any] = record["results"][wanted.evaluation]
    values = result["floors"].get(group, {}) if group else result["values"]
    value = values.get(key)
    if value is not None:
        return value, ""
    blanks = result["blanks"]
    reason = blanks.get(group or key) or blanks.get(key)
    return None, reason or f"{wanted.evaluation} does not measure {wanted.value}"


def _derive(grid: Grid, rules: list[dict[str, Any]]) -> None:
    """Add rows that restate a published row on another scale."""
    for rule in rules:
        for column in list(grid.columns):
            cell = grid.cells.get((rule["from"], column))
            if cell is not None and cell.value is not None:
                factor = rule["factor"].get(column, 1)
                grid.put(rule["row"], column, Cell(factor * cell.value, PAPER, notes=[rule["note"]]))


def _footnotes(grid: Grid, rules: list[dict[str, Any]]) -> None:
    for rule in rules:
        for (row, column), cell in grid.cells.items():
            if row in rule.get("rows", [row]) and column in rule.get("columns", [column]) and cell.origin == PAPER:
                cell.notes.append(rule["text"])


def _mark_best(grid: Grid, spec: dict[str, Any]) -> None:
    """Mark our numbers that no other they compete with betters; the paper's own marks stay.

    A table that compares methods says along what: `rows` of one group, or `columns` of one group. A number on a part of
    the data competes with nothing, and neither do what a table calls unfair, floors, and all of an ablation.
    """
    along, unfair = spec.get("competitors", "none"), set(spec.get("unfair", []))
    if along == "none":
        return

    def place(row: str, column: str) -> tuple[str, str]:
        """Return what competitors have in common."""
        return (_group(row), column) if along == "rows" else (row, _group(column))

    rivals: dict[tuple[str, str], list[Cell]] = {}
    for (row, column), cell in grid.cells.items():
        fair = not {row, column, row.rpartition("/")[2], column.rpartition("/")[2]} & unfair
        if fair and cell.whole and cell.value is not None and cell.origin != FLOOR:
            rivals.setdefault(place(row, column), []).append(cell)
    for (row, column), cell in grid.cells.items():
        others = rivals.get(place(row, column), [])
        if cell.origin == OURS and len(others) > 1 and any(cell is other for other in others):
            cell.bold = cell.value == (max if cell.higher else min)(other.value for other in others)


def _group(label: str) -> str:
    return label.rpartition("/")[0]


def _order(grid: Grid) -> None:
    """Keep groups of rows together: a row of ours stands after the last one of its group."""
    groups: dict[str, list[str]] = {}
    for row in grid.rows:
        groups.setdefault(row.split("/")[0] if "/" in row else "", []).append(row)
    grid.rows = [row for rows in groups.values() for row in rows]


def _tell_sources(grid: Grid) -> None:
    """Remark that numbers which stand side by side were measured by different sources."""
    sources = sorted({name for cell in grid.cells.values() for name in cell.sources})
    if len(sources) > 1:
        grid.remarks.append(
            f"our numbers in this table were measured by different sources of n2n ({', '.join(sources)}), so they may "
            "differ by more than what stands at their rows and columns; `n2n tables run --again` measures them anew"
        )
