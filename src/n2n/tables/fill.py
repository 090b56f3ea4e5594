"""From stored results to a table: ours beside the published numbers."""

import statistics
from typing import Any

from n2n.tables.grid import FLOOR, OURS, PAPER, Cell, Grid, Published, published
from n2n.tables.plan import Plan
from n2n.tables.spec import Fit, Table, Wanted
from n2n.tables.store import Store, lacking

_FLOORS = ("oracle", "do_nothing", "resample")


def fill(table: Table, plan: Plan, store: Store) -> tuple[Grid, Published]:
    """Return a table with every cell filled, or blank for a reason, and the paper's table it belongs to."""
    paper = published(table.spec["published"])
    grid = paper.grid
    _derive(grid, table.spec.get("derived", []))
    for wanted in plan.wanted[table.name]:
        grid.put(wanted.row, wanted.column, _cell(wanted, store, plan.protocols))
    _footnotes(grid, table.spec.get("footnotes", []))
    _mark_best(grid, table.spec)
    return _ordered(grid, table.spec), paper


def _cell(wanted: Wanted, store: Store, protocols: dict[str, str]) -> Cell:
    origin = FLOOR if wanted.value.split(".")[0] in _FLOORS else OURS
    if wanted.reason:
        return Cell(None, origin, wanted.reason)
    values, lost = [], []
    groups: dict[str, list[float]] = {}
    for fit in wanted.fits:
        value, why = _value(wanted, fit, store, protocols)
        values += [] if value is None else [value]
        if value is not None:
            groups.setdefault(fit.shape.split("/")[0] if wanted.by_class else "", []).append(value)
        lost += [f"{fit.shape}: {why}"] if why else []
    notes = list(wanted.notes)
    if not values:
        first = lost[0].partition(": ")[2]
        return Cell(None, origin, first if len(lost) == len(wanted.fits) and _same(lost) else "; ".join(lost))
    if lost:
        notes.append(f"mean of {len(values)} of {len(wanted.fits)} shapes; " + "; ".join(lost))
    if wanted.by_class:
        notes.append(f"mean over {len(groups)} classes: {', '.join(groups)}")
    mean = statistics.fmean(statistics.fmean(group) for group in groups.values())
    return Cell(wanted.scale * mean, origin, shapes=len(values), notes=notes)


def _same(lost: list[str]) -> bool:
    return len({text.partition(": ")[2] for text in lost}) == 1


def _value(wanted: Wanted, fit: Fit, store: Store, protocols: dict[str, str]) -> tuple[float | None, str]:
    """Return a number, or why there is none."""
    record = store.read(fit)
    if record is None:
        return None, "not measured yet"
    if record["status"] != "done":
        return None, f"failed: {record['error']}"
    if lacking(record, {wanted.evaluation: {wanted.floor} - {""}}, protocols):
        return None, "not measured yet by the present definition of the protocol"
    group, _, key = wanted.value.rpartition(".")
    if group == "cost":
        return record["cost"][key], ""
    result: dict[str, Any] = record["results"][wanted.evaluation]
    values = result["floors"].get(group, {}) if group else result["values"]
    value = values.get(key)
    if value is not None:
        return value, ""
    blanks = result["blanks"]
    reason = result.get("blank") or blanks.get(group or key) or blanks.get(key)
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
    """Mark our numbers that are better than all others they compete with; the paper's own marks stay.

    A table that compares methods marks us against all of them; an ablation (`competitors: none`) marks nothing.
    """
    along = spec.get("competitors", "none")
    if along == "none":
        return
    excluded = set(spec.get("unfair", []))
    for (row, column), cell in grid.cells.items():
        if cell.origin != OURS or cell.value is None:
            continue
        higher = any(part in spec.get("higher", []) for part in (*row.split("/"), *column.split("/")))
        rivals = [
            other.value
            for (r, c), other in grid.cells.items()
            if (c == column and r.split("/")[:-1] == row.split("/")[:-1] if along == "rows" else r == row)
            and other.value is not None
            and other.origin != FLOOR
            and not {r, c, r.rpartition("/")[2]} & excluded
        ]
        cell.bold = cell.value == (max(rivals) if higher else min(rivals)) if rivals else False


def _ordered(grid: Grid, spec: dict[str, Any]) -> Grid:
    """Keep groups of rows together: a row of ours stands after the last one of its group."""
    groups: dict[str, list[str]] = {}
    for row in grid.rows:
        groups.setdefault(row.split("/")[0] if "/" in row else "", []).append(row)
    grid.rows = [row for rows in groups.values() for row in rows]
    return grid
