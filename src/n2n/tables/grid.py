"""A table as labelled cells, and the paper's own tables in that form."""

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from n2n.errors import ConfigError
from n2n.registry import suggest

PAPER, OURS, OTHER, FLOOR = "paper", "n2n", "measured here", "reference value"


@dataclass
class Cell:
    """One number, or why there is none.

    Attributes:
        value: In the table's unit; None is a blank.
        origin: Who says so: paper | n2n | measured here (another method) | reference value (a floor, or doing nothing).
        reason: Why it is blank.
        shapes: Over how many shapes a number of ours is the mean.
        whole: These are all shapes of the dataset.
        higher: Of two such numbers the higher one is better.
        bold: Marked as best, by the paper or by us.
        notes: Footnotes.
        sources: Which sources of n2n measured it; several where results of different ones are averaged.
    """

    value: int | float | None
    origin: str
    reason: str = ""
    shapes: int = 0
    whole: bool = True
    higher: bool = False
    bold: bool = False
    notes: list[str] = field(default_factory=list)
    sources: list[str] = field(default_factory=list)


@dataclass
class Grid:
    """Rows and columns in order, cells by (row, column); nested labels are joined by `/`. Remarks are of them all."""

    rows: list[str] = field(default_factory=list)
    columns: list[str] = field(default_factory=list)
    cells: dict[tuple[str, str], Cell] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    def put(self, row: str, column: str, cell: Cell) -> None:
        """Add a cell, and its row and column where they are new."""
        if row not in self.rows:
            self.rows.append(row)
        if column not in self.columns:
            self.columns.append(column)
        self.cells[row, column] = cell


@dataclass
class Published:
    """A table as printed.

    Attributes:
        grid: Its cells; a dash of the paper is a blank. Empty for a table that the paper does not have.
        caption, dataset, unit: The paper's words.
        notes: What is odd about it.
    """

    grid: Grid
    caption: str = ""
    dataset: str = ""
    unit: str = ""
    notes: list[str] = field(default_factory=list)


def published(name: str) -> Published:
    """Return a table of the paper.

    Raises:
        ConfigError: No such table.
    """
    tables = _tables()
    if name not in tables:
        raise ConfigError(f"Unknown published table {name!r}.{suggest(name, list(tables))}")
    table = tables[name]
    grid = Grid()
    for row, values in _leaves(table["rows"]):
        best = _follow(table["bold"], row)
        for column, value in values.items():
            # Time and memory of the complexity table are one entry there and two columns here.
            parts = value if isinstance(value, dict) else {"": value}
            for part, number in parts.items():
                label = f"{column}/{part.partition('_')[0]}" if part else column
                reason = "" if number is not None else "not in the paper"
                grid.put(row, label, Cell(number, PAPER, reason, bold=label in best))
    return Published(grid, table["caption"], table["dataset"], table["unit_scale"], table.get("notes", []))


@cache
def _tables() -> dict[str, Any]:
    text = (Path(__file__).parent / "published.yaml").read_text(encoding="utf-8")
    return {table["id"]: table for table in yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))["tables"]}


def _leaves(rows: dict[str, Any], path: str = "") -> list[tuple[str, dict[str, Any]]]:
    """Return (row label, values by column); a row whose values are rows again is a group of rows."""
    found = []
    for name, entry in rows.items():
        label = f"{path}/{name}" if path else str(name)
        group = all(isinstance(v, dict) and not set(v) <= {"time_min", "mem_GB"} for v in entry.values())
        found += _leaves(entry, label) if group else [(label, entry)]
    return found


def _follow(tree: Any, path: str) -> list[str]:
    for name in path.split("/"):
        tree = tree[name]
    return tree
