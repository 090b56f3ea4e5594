"""Tables as Markdown, LaTeX and CSV."""

import csv
import io
import re

import pytest

from n2n.tables.grid import FLOOR, OURS, PAPER, Cell, Grid
from n2n.tables.render import number, render


@pytest.fixture
def grid():
    grid = Grid()
    grid.put("A_1", "10%", Cell(1.23456, PAPER, bold=True, notes=["odd & 5% off"]))
    grid.put("A_1", "20%", Cell(None, PAPER, "not in the paper"))
    grid.put(
        "n2n, N = 1", "10%", Cell(0.00123456, OURS, shapes=4, notes=["second", "odd & 5% off"], sources=["new", "old"])
    )
    grid.put("n2n, N = 1", "20%", Cell(None, OURS, "no data"))
    grid.put("floor|x", "10%", Cell(1234.5, FLOOR, shapes=4))
    return grid


@pytest.mark.parametrize(
    ("value", "text"),
    [(4.2211, "4.221"), (0.00123456, "0.00123"), (1234.5, "1234"), (0.0, "0.000"), (-0.5, "-0.500"), (999.4, "999.400"),
     (0.01, "0.010"), (2.1e-28, "2.1e-28"), (1.0, "1.000")],
)  # fmt: skip
def test_a_number_has_three_decimals_or_digits(value, text):
    assert number(value) == text


def test_markdown(grid):
    table = render("T: a title", ["about it"], grid)
    lines = table.markdown.splitlines()
    assert lines[0] == "# T: a title" and lines[2] == "about it  "
    assert lines[4:9] == [
        "| | 10% | 20% |",
        "|---|---:|---:|",
        "| A_1 | **1.235**<sup>1</sup> | - |",
        "| n2n, N = 1 | 0.00123<sup>2,1</sup> | -<sup>3</sup> |",
        r"| floor\|x | 1234 |  |",
    ]
    assert lines[10:] == ["1. odd & 5% off", "2. second", "3. no data"]
    assert (table.ours, table.blank) == (1, 1)


def test_every_mark_has_its_footnote_and_every_footnote_a_mark(grid):
    table = render("T", [], grid)
    for text, mark, note in (
        (table.markdown, r"<sup>([\d,]+)</sup>", r"^(\d+)\. "),
        (
            table.latex,
            r"\d\$\^\{([\d,]+)\}\$|--\$\^\{([\d,]+)\}\$|\}\$\^\{([\d,]+)\}\$",
            r"footnotesize \$\^\{(\d+)\}\$",
        ),
    ):
        marks = {n for found in re.findall(mark, text) for part in [*found] for n in re.findall(r"\d+", part)}
        assert marks == set(re.findall(note, text, re.MULTILINE)) == {"1", "2", "3"}


def test_latex(grid):
    text = render("T_1: 5% of {x} & $y$ ~ 10^4 # \\", [], grid).latex
    assert r"\caption{T\_1: 5\% of \{x\} \& \$y\$ \textasciitilde{} 10\textasciicircum{}4 \# \textbackslash{}}" in text
    assert r"\begin{tabular}{lrr}" in text and r" & 10\% & 20\% \\" in text
    assert r"A\_1 & \textbf{1.235}$^{1}$ & -- \\" in text
    assert r"n2n, N = 1 & 0.00123$^{2,1}$ & --$^{3}$ \\" in text
    assert r"\par\footnotesize $^{1}$ odd \& 5\% off" in text
    body = text.replace(r"\\", "")
    assert body.count("\\begin{") == body.count("\\end{") == 2 and body.count(r"\toprule") == 1
    # Braces balance, and no special sign stands unescaped outside of what we wrote ourselves.
    plain = re.sub(r"\\[{}&%$#_]", "", body)
    assert plain.count("{") == plain.count("}") and "#" not in plain and "_" not in plain


def test_csv_is_read_by_programs(grid):
    rows = list(csv.DictReader(io.StringIO(render("T", [], grid).csv)))
    assert len(rows) == 5
    assert rows[0] == {
        "row": "A_1", "column": "10%", "value": "1.23456", "origin": "paper", "shapes": "", "best": "1",
        "sources": "", "remark": "odd & 5% off",
    }  # fmt: skip
    assert (rows[1]["value"], rows[1]["remark"]) == ("", "not in the paper")
    assert (rows[2]["row"], rows[2]["value"], rows[2]["shapes"], rows[2]["origin"]) == (
        "n2n, N = 1", "0.00123456", "4", "n2n",
    )  # fmt: skip
    assert rows[2]["sources"] == "new old"
    assert rows[3]["remark"] == "no data" and rows[4]["origin"] == "reference value"


def test_a_remark_on_the_whole_table_stands_under_its_footnotes(grid):
    grid.remarks.append("made in 50% of the cases")
    table = render("T", [], grid)
    assert table.markdown.splitlines()[-2:] == ["", "Of the whole table: made in 50% of the cases.  ".rstrip()]
    assert "\n\\par\\footnotesize made in 50\\% of the cases\n\\end{table}" in table.latex
