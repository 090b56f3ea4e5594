"""A filled table as Markdown, LaTeX and CSV."""

import csv
import io
from dataclasses import dataclass

from n2n.tables.grid import OURS, PAPER, Cell, Grid

_DIGITS = 3


@dataclass
class Rendered:
    """One table in three notations, with the number of its blanks."""

    markdown: str
    latex: str
    csv: str
    ours: int
    blank: int


def render(title: str, about: list[str], grid: Grid) -> Rendered:
    """Write a table.

    Args:
        title: Heading.
        about: Lines under it: profile, data, unit.
        grid: The cells; ours may stand in rows or columns of their own.
    """
    notes = _Notes()
    rows = [
        [row, *(_IN_MARKDOWN.write(grid.cells.get((row, column)), notes) for column in grid.columns)]
        for row in grid.rows
    ]
    mine = [cell for cell in grid.cells.values() if cell.origin == OURS]
    return Rendered(
        markdown=_markdown(title, about, grid, rows, notes.lines),
        latex=_latex(title, grid, notes),
        csv=_csv(grid),
        ours=sum(cell.value is not None for cell in mine),
        blank=sum(cell.value is None for cell in mine),
    )


class _Notes:
    """Footnotes, each text once, numbered as they come."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def mark(self, texts: list[str]) -> str:
        for text in texts:
            if text not in self.lines:
                self.lines.append(text)
        return ",".join(str(self.lines.index(text) + 1) for text in texts)


def number(value: float) -> str:
    """Write a number with three decimals, or with three significant digits where it is small, none where it is large.

    >>> number(4.2211), number(0.00123), number(1234.5)
    ('4.221', '0.00123', '1234')
    """
    if value and not 0.01 <= abs(value) < 1000:
        return f"{value:.{_DIGITS}g}" if abs(value) < 1 else f"{value:.0f}"
    return f"{value:.{_DIGITS}f}"


def _remarks(cell: Cell) -> list[str]:
    """Return the footnotes of a cell; that the paper has a dash needs none."""
    return [*cell.notes, *([cell.reason] if cell.value is None and cell.origin != PAPER else [])]


@dataclass(frozen=True)
class _Notation:
    """How a cell is written: templates of footnote marks and of bold numbers, and a dash."""

    raised: str
    bold: str
    dash: str

    def write(self, cell: Cell | None, notes: _Notes) -> str:
        if cell is None:
            return ""
        marks = notes.mark(_remarks(cell))
        raised = self.raised.format(marks) if marks else ""
        if cell.value is None:
            return self.dash + raised
        text = number(cell.value)
        return (self.bold.format(text) if cell.bold else text) + raised


_IN_MARKDOWN = _Notation("<sup>{}</sup>", "**{}**", "-")
_IN_LATEX = _Notation("$^{{{}}}$", r"\textbf{{{}}}", "--")


def _markdown(title: str, about: list[str], grid: Grid, rows: list[list[str]], notes: list[str]) -> str:
    lines = [f"# {title}", "", *(f"{line}  " for line in about), ""]
    lines += ["| |" + "".join(f" {_plain(column)} |" for column in grid.columns), "|---|" + "---:|" * len(grid.columns)]
    lines += [f"| {' | '.join([_plain(label), *texts])} |" for label, *texts in rows]
    lines += ["", *(f"{index}. {text}" for index, text in enumerate(notes, 1))]
    lines += ["", *(f"Of the whole table: {text}.  " for text in grid.remarks)]
    return "\n".join(lines).rstrip() + "\n"


def _plain(label: str) -> str:
    return label.replace("|", r"\|")


def _latex(title: str, grid: Grid, notes: _Notes) -> str:
    lines = [
        "% needs booktabs",
        r"\begin{table}",
        rf"\caption{{{_escape(title)}}}",
        rf"\begin{{tabular}}{{l{'r' * len(grid.columns)}}}",
        r"\toprule",
        " & ".join(["", *map(_escape, grid.columns)]) + r" \\",
        r"\midrule",
    ]
    for row in grid.rows:
        cells = [_IN_LATEX.write(grid.cells.get((row, column)), notes) for column in grid.columns]
        lines.append(" & ".join([_escape(row), *cells]) + r" \\")
    lines += [r"\bottomrule", r"\end{tabular}"]
    lines += [rf"\par\footnotesize $^{{{i}}}$ {_escape(text)}" for i, text in enumerate(notes.lines, 1)]
    lines += [rf"\par\footnotesize {_escape(text)}" for text in grid.remarks]
    return "\n".join([*lines, r"\end{table}", ""])


_TEX = str.maketrans(
    {
        **{sign: rf"\{sign}" for sign in "&%$#_{}"},
        "\\": r"\textbackslash{}",
        "^": r"\textasciicircum{}",
        "~": r"\textasciitilde{}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
    }
)


def _escape(text: str) -> str:
    return text.translate(_TEX)


def _csv(grid: Grid) -> str:
    """One line per cell: what a program reads."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["row", "column", "value", "origin", "shapes", "best", "sources", "remark"])
    for row in grid.rows:
        for column in grid.columns:
            cell = grid.cells.get((row, column))
            if cell is not None:
                value = "" if cell.value is None else f"{cell.value:.6g}"
                remark = "; ".join([*([cell.reason] if cell.value is None else []), *cell.notes])
                sources = " ".join(cell.sources)
                facts = [value, cell.origin, cell.shapes or "", int(cell.bold), sources, remark]
                writer.writerow([row, column, *facts])
    return out.getvalue()
