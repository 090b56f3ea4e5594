"""From results to cells: means, reasons, footnotes, and who is marked best."""

import pytest

from n2n.tables.fill import fill
from n2n.tables.grid import OURS, PAPER, Cell, Grid, Published
from n2n.tables.plan import Job, Plan
from n2n.tables.spec import Fit, Profile, Table, Wanted
from n2n.tables.store import Store

EVALUATION = "denoise/sbp"


def fit(shape, method="n2n"):
    return Fit(method, "pu", shape, ())


class Bench:
    """A store and a table of one cell after another."""

    def __init__(self, folder):
        self.store, self.wanted = Store(folder), []

    def measured(
        self,
        shape,
        definition="now",
        cost=None,
        blank=None,
        blanks=None,
        floors=None,
        sources="s",
        method="n2n",
        **values,
    ):
        result = {"definition": definition, "asked": sorted(floors or {}), "values": values, "floors": floors or {}}
        result |= {"blanks": blanks or {}, **({"blank": blank} if blank else {})}
        record = {"status": "done", "made": {"sources": sources}, "cost": cost or {}, "results": {EVALUATION: result}}
        self.store.write(fit(shape, method), record)

    def wants(
        self, *shapes, row="ours", column="c", evaluation=EVALUATION, value="p2m", scale=1.0, method="n2n", **more
    ):
        fits = [fit(s, method) for s in shapes]
        self.wanted.append(Wanted(row, column, evaluation, value, scale, method, fits=fits, **more))

    def grid(self, **spec):
        jobs = {f: Job(f, {EVALUATION: set()}) for wanted in self.wanted for f in wanted.fits}
        plan = Plan(Profile("p", ""), [], {"t": self.wanted}, jobs)
        plan.protocols = {EVALUATION: "now"}
        return fill(Table("t", {"title": "t", **spec}), plan, self.store)[0]

    def cell(self, **spec):
        return self.grid(**spec).cells["ours", "c"]


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


def test_a_cell_is_the_mean_over_shapes_in_the_unit_of_the_table(bench):
    bench.measured("cow", p2m=1e-4)
    bench.measured("duck", p2m=5e-4)
    bench.wants("cow", "duck", scale=1e4, notes=["read me"])
    cell = bench.cell()
    assert cell.value == pytest.approx(3.0) and (cell.shapes, cell.whole, cell.notes) == (2, True, ["read me"])
    assert (cell.origin, cell.reason, cell.bold) == (OURS, "", False)


def test_a_mean_over_classes_weighs_classes_alike(bench):
    for shape, value in {"chair/a": 1.0, "chair/b": 2.0, "chair/c": 3.0, "lamp/a": 10.0}.items():
        bench.measured(shape, p2m=value)
    bench.wants("chair/a", "chair/b", "chair/c", "lamp/a", by_class=True)
    cell = bench.cell()
    assert cell.value == 6.0 and cell.shapes == 4 and cell.notes == ["mean over 2 classes: chair, lamp"]
    bench.wants("chair/a", "chair/b", "chair/c", "lamp/a")
    assert bench.cell().value == 4.0


def test_floors_and_costs_are_values_too(bench):
    bench.measured("cow", p2m=1.0, floors={"oracle": {"p2m": 0.25}}, cost={"minutes": 2.5})
    bench.wants("cow", value="oracle.p2m", column="a")
    bench.wants("cow", value="cost.minutes", evaluation="", column="b")
    bench.wants("cow", value="cost.memory", evaluation="", column="c")
    cells = bench.grid().cells
    assert (cells["ours", "a"].value, cells["ours", "a"].origin) == (0.25, "reference value")
    assert cells["ours", "b"].value == 2.5
    assert cells["ours", "c"].value is None and "memory" in cells["ours", "c"].reason


def test_a_part_is_a_mean_with_a_footnote(bench):
    bench.measured("cow", p2m=1.0)
    bench.store.write(fit("duck"), fit("duck").failed("too many holes"))
    bench.wants("cow", "duck", "pig")
    cell = bench.cell()
    assert cell.value == 1.0 and cell.shapes == 1 and not cell.whole
    assert cell.notes == ["mean of 1 of 3 shapes; duck: failed: too many holes; pig: not measured yet"]


@pytest.mark.parametrize(
    ("made", "reason"),
    [
        ({}, "not measured yet"),
        ({"p2m": 1.0, "definition": "before"}, "not measured yet by the present definition of the protocol"),
        ({"blank": "no ground truth of cow is present"}, "no ground truth of cow is present"),
        ({"blanks": {"p2m": "the reference has no mesh"}}, "the reference has no mesh"),
        ({"hausdorff": 1.0}, "denoise/sbp does not measure p2m"),
    ],
)
def test_a_blank_says_why(bench, made, reason):
    if made:
        bench.measured("cow", **made)
    bench.wants("cow")
    cell = bench.cell()
    assert (cell.value, cell.reason) == (None, reason)


def test_a_blank_floor_says_why(bench):
    bench.measured("cow", p2m=1.0, floors={"resample": {}}, blanks={"resample": "no mesh to draw from"})
    bench.wants("cow", value="resample.p2m")
    assert bench.cell().reason == "no mesh to draw from"


def test_a_damaged_result_is_a_blank_and_leaves_the_others(bench):
    bench.measured("cow", p2m=1.0)
    bench.measured("duck", p2m=3.0)
    bench.store.path(fit("duck")).write_text('{"status": "do')
    bench.wants("cow", "duck")
    cell = bench.cell()
    assert (cell.value, cell.shapes, cell.whole) == (1.0, 1, False)
    assert cell.notes == ["mean of 1 of 2 shapes; duck: not measured: its result file is damaged"]
    bench.wants("duck", column="d")
    assert bench.grid().cells["ours", "d"].reason == "not measured: its result file is damaged"


def test_results_of_different_sources_are_told_by_cell_and_by_table(bench):
    for shape, sources in {"cow": "new", "duck": "old", "pig": "new"}.items():
        bench.measured(shape, p2m=1.0, sources=sources)
    bench.wants("cow", "pig", column="same")
    assert bench.grid().remarks == [] and bench.grid().cells["ours", "same"].sources == ["new"]
    # Each cell is of one kind, but they are read side by side.
    bench.wants("duck", column="before")
    grid = bench.grid()
    assert len(grid.remarks) == 1 and "different sources of n2n (new, old)" in grid.remarks[0]
    assert grid.cells["ours", "before"].notes == []
    bench.wants("cow", "duck", "pig", column="mixed")
    assert bench.grid().cells["ours", "mixed"].notes == [
        "mean over results of different sources of n2n: 2 by new, 1 by old"
    ]


def test_reasons_that_are_the_same_are_said_once_and_others_by_shape(bench):
    bench.store.write(fit("duck"), fit("duck").failed("broken"))
    bench.wants("cow", "pig")
    assert bench.cell().reason == "not measured yet"
    bench.wanted.clear()
    bench.wants("cow", "duck")
    assert bench.cell().reason == "cow: not measured yet; duck: failed: broken"
    bench.wanted.clear()
    bench.wants(reason="PU is missing")
    assert bench.cell().reason == "PU is missing"


@pytest.fixture
def paper(monkeypatch):
    """Return a function that puts a small published table in the place of the paper's."""

    def published(cells):
        grid = Grid()
        for (row, column), value in cells.items():
            grid.put(row, column, Cell(value, PAPER, "" if value is not None else "not in the paper"))
        monkeypatch.setattr("n2n.tables.fill.published", lambda name: Published(grid, "", "", ""))

    return published


def marked(grid):
    return {place for place, cell in grid.cells.items() if cell.bold}


def test_best_among_the_rows_of_its_group(bench, paper):
    paper({("PU/A", "c"): 3.0, ("PU/B", "c"): None, ("PC/A", "c"): 0.5, ("PU/A", "d"): 0.1})
    bench.measured("cow", p2m=2.0)
    bench.wants("cow", row="PU/ours")
    assert marked(bench.grid(published="x", competitors="rows")) == {("PU/ours", "c")}
    assert marked(bench.grid(published="x")) == set()
    assert marked(bench.grid(published="x", competitors="rows", unfair=["ours"])) == set()
    assert marked(bench.grid(published="x", competitors="rows", unfair=["PU/A"])) == set()


def test_best_among_the_columns_of_its_group(bench, paper):
    paper({("CD", "5K/A"): 3.0, ("CD", "10K/A"): 1.0, ("CD", "5K/B"): 0.1, ("P2M", "5K/A"): 0.1})
    bench.measured("cow", p2m=2.0)
    bench.wants("cow", row="CD", column="5K/ours")
    # The 10K column is another competition.
    assert marked(bench.grid(published="x", competitors="columns", unfair=["B"])) == {("CD", "5K/ours")}
    assert marked(bench.grid(published="x", competitors="columns")) == set()


def test_a_floor_and_a_part_of_the_data_compete_with_nothing(bench, paper):
    paper({("A", "c"): 3.0})
    bench.measured("cow", p2m=2.0, floors={"oracle": {"p2m": 0.0}})
    bench.wants("cow", row="ours")
    bench.wants("cow", row="exact projection", value="oracle.p2m")
    bench.wants("cow", row="one shape", whole=False)
    bench.wants("cow", "duck", row="half of them")
    assert marked(bench.grid(published="x", competitors="rows")) == {("ours", "c")}


@pytest.mark.parametrize(("value", "best"), [("nc", True), ("fscore", True), ("cd_mean1", False), ("split.nc", False)])
def test_the_metric_says_what_better_is(bench, paper, value, best):
    paper({("chair", "A"): 0.9})
    bench.measured("cow", nc=0.95, fscore=0.95, cd_mean1=0.95, floors={"split": {"nc": 0.99}})
    bench.wants("cow", row="chair", column="ours", value=value)
    assert (("chair", "ours") in marked(bench.grid(published="x", competitors="columns"))) == best


def test_another_method_measured_here_competes_and_gets_no_mark(bench, paper):
    paper({("A", "c"): 3.0})
    bench.measured("cow", p2m=2.0)
    bench.measured("cow", p2m=1.0, method="jet")
    bench.wants("cow", row="ours")
    assert marked(bench.grid(published="x", competitors="rows")) == {("ours", "c")}
    bench.wants("cow", row="jet", method="jet")
    grid = bench.grid(published="x", competitors="rows")
    assert marked(grid) == set() and grid.cells["jet", "c"].origin == "measured here"


def test_a_method_that_is_not_installed_is_a_blank_that_says_how_to_get_it(bench, monkeypatch):
    monkeypatch.setattr("n2n.tables.fill.not_installed", {"jet": "pip install CGAL", "n2n": ""}.get)
    bench.wants("cow", method="jet")
    assert bench.cell().reason == "pip install CGAL"
    # What another machine has measured is shown all the same.
    bench.measured("cow", p2m=1.0, method="jet")
    assert bench.cell().value == 1.0


def test_equal_bests_are_both_marked_and_only_ours(bench, paper):
    paper({("A", "c"): 2.0, ("B", "c"): 3.0})
    bench.measured("cow", p2m=2.0)
    bench.wants("cow", row="ours")
    bench.wants("cow", row="ours too")
    assert marked(bench.grid(published="x", competitors="rows")) == {("ours", "c"), ("ours too", "c")}


def test_a_number_alone_is_not_the_best(bench):
    bench.measured("cow", p2m=2.0)
    bench.wants("cow")
    assert marked(bench.grid(competitors="rows")) == set()


def test_footnotes_go_to_cells_of_the_paper(bench, paper):
    paper({("A", "c"): 3.0, ("A", "d"): 3.0, ("B", "c"): 4.0})
    bench.measured("cow", p2m=2.0)
    bench.wants("cow", row="A", column="e")
    rules = [{"rows": ["A"], "text": "odd"}, {"columns": ["c"], "text": "odd, too"}, {"text": "all"}]
    notes = {place: cell.notes for place, cell in bench.grid(published="x", footnotes=rules).cells.items()}
    assert notes == {
        ("A", "c"): ["odd", "odd, too", "all"],
        ("A", "d"): ["odd", "all"],
        ("B", "c"): ["odd, too", "all"],
        ("A", "e"): [],
    }


def test_a_row_restated_on_another_scale(bench, paper):
    paper({("PU/Ours", "c"): 1.5, ("PU/Ours", "d"): 2.0, ("PU/Ours", "e"): None, ("PC/A", "c"): 1.0})
    rule = {"from": "PU/Ours", "row": "PU/doubled", "factor": {"c": 2}, "note": "doubled"}
    bench.wants(row="PU/ours", reason="no")
    grid = bench.grid(published="x", derived=[rule])
    assert {c: grid.cells["PU/doubled", c].value for c in "cd"} == {"c": 3.0, "d": 2.0}
    assert ("PU/doubled", "e") not in grid.cells and grid.cells["PU/doubled", "c"].notes == ["doubled"]
    # Rows of a group stay together.
    assert grid.rows == ["PU/Ours", "PU/doubled", "PU/ours", "PC/A"]
