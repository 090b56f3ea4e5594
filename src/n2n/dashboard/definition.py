"""What a dashboard shows: sections of panels, drawn as a page here and as a workspace and a report by W&B."""

from dataclasses import dataclass

from n2n.tracking import names

CD, P2M = names.evaluation("denoise", "sbp", "cd_sum2"), names.evaluation("denoise", "sbp", "p2m")
SURFACE_CD = names.evaluation("reconstruct", "sbp", "cd_sum2")
_RESULTS = (names.VALIDATION, names.VALIDATION_RELATIVE, CD, P2M, SURFACE_CD, names.DISTANCE, names.SECONDS)


@dataclass(frozen=True)
class PaperCurve:
    """A row of a published table, drawn over the numbers in its columns.

    Attributes:
        label: In the legend.
        table: Of n2n/tables/published.yaml.
        row: Label of the row; groups are joined by `/`.
        metric: Which of the panel's metrics it is, so which curves of ours it is set against.
        prefix: What stands before the number in a column's label; other columns are left out.
        factor: From the number in the label to the setting's value.
    """

    label: str
    table: str
    row: str
    metric: str
    prefix: str = ""
    factor: float = 1.0


@dataclass(frozen=True)
class Panel:
    """One picture or table.

    Attributes:
        kind: cards, versus, curve (over iterations), ablation (over a setting), explore (over a setting that the reader
            chooses), parallel, runs, shapes, scene, states, failures or rates.
        title: Above it.
        metrics: Names of what is logged, or `task/protocol/metric` of evaluations; raw values.
        x: The setting on the horizontal axis of an ablation, as in `n2n fit`.
        scale: Factor from raw values to the unit of the title.
        log: A logarithmic vertical axis.
        paper: Curves of the paper beside ours.
        empty: What to do so that there is something to show.
    """

    kind: str
    title: str
    metrics: tuple[str, ...] = ()
    x: str = ""
    scale: float = 1.0
    log: bool = False
    paper: tuple[PaperCurve, ...] = ()
    empty: str = ""


@dataclass(frozen=True)
class Section:
    """Panels that answer one question.

    Attributes:
        key: Short name, part of addresses.
        title: Above the panels.
        panels: In order.
    """

    key: str
    title: str
    panels: tuple[Panel, ...]


_EVALUATE = "set 'evaluate=[denoise/sbp]' on data with a known true surface"


def _ablation(title: str, x: str, example: str, curves: tuple[PaperCurve, ...]) -> Panel:
    metrics = tuple(dict.fromkeys(curve.metric for curve in curves))
    empty = f"no evaluated run varies it; e.g. n2n fit -m {x}={example} 'evaluate=[denoise/sbp]'"
    return Panel("ablation", title, metrics, x, scale=1e4, paper=curves, empty=empty)


SECTIONS = (
    Section(
        "overview",
        "Overview and the paper",
        (
            Panel("cards", "Summary", (names.VALIDATION, names.VALIDATION_RELATIVE, CD, P2M, SURFACE_CD)),
            Panel(
                "versus",
                "Ours and the paper",
                empty="no evaluated run has the data and settings of one of the paper's tables; set "
                "'evaluate=[denoise/sbp]' on its data (datamodule=pu, pc, ...), or name a results folder of n2n tables",
            ),
        ),
    ),
    Section(
        "ablations",
        "Ablations",
        (
            Panel(
                "explore", "Any setting", _RESULTS, empty="nothing was varied; sweep a setting: n2n fit -m seed=0,1,2"
            ),
            _ablation(
                "Regulariser weight λ",
                "regulariser_weight",
                "0,0.05,0.1,0.2",
                (
                    PaperCurve("denoise", "T11_ablation_metric_lambda", "Denoise", CD, "EMD,lambda="),
                    PaperCurve(
                        "reconstruct", "T11_ablation_metric_lambda", "Reconstruction", SURFACE_CD, "EMD,lambda="
                    ),
                ),
            ),
            _ablation(
                "Batch size B",
                "batch_size",
                "100,250,1000",
                (
                    PaperCurve("CD", "T08_ablation_B", "L2CD_x1e4", CD),
                    PaperCurve("P2M", "T08_ablation_B", "P2M_x1e4", P2M),
                ),
            ),
            _ablation(
                "Observations N",
                "num_observations",
                "1,10,200",
                (
                    PaperCurve("CD", "T10_ablation_N", "L2CD_x1e4", CD),
                    PaperCurve("P2M", "T10_ablation_N", "P2M_x1e4", P2M),
                ),
            ),
            _ablation(
                "Iterations",
                "iterations",
                "80,120,160,200",
                (
                    PaperCurve("CD", "T09_ablation_iterations", "L2CD_x1e4", CD, factor=1e4),
                    PaperCurve("P2M", "T09_ablation_iterations", "P2M_x1e4", P2M, factor=1e4),
                ),
            ),
        ),
    ),
    Section(
        "runs",
        "Runs",
        (
            Panel(
                "parallel",
                "Settings and results",
                _RESULTS,
                empty="nothing was varied; sweep a setting: n2n fit -m seed=0,1,2",
            ),
            Panel("runs", "All runs", _RESULTS, empty="no runs"),
        ),
    ),
    Section(
        "training",
        "Training",
        (
            Panel("curve", "Loss", (names.LOSS,), log=True),
            Panel("curve", "Distance to the observations", (names.DISTANCE,), log=True),
            Panel("curve", "Regulariser", (names.REGULARISER,), log=True),
            Panel("curve", "Matched distance", (names.MATCHED_DISTANCE,), log=True),
            Panel("curve", "Length of the gradient", (names.GRADIENT_NORM,)),
            Panel("curve", "Deviation of the gradient's length from 1", (names.EIKONAL_DEVIATION,), log=True),
            Panel("curve", "Steps per second", (names.STEPS_PER_SECOND,)),
            Panel("curve", "Memory (GiB)", (names.MEMORY,)),
        ),
    ),
    Section(
        "shapes",
        "Shape by shape",
        (
            Panel(
                "shapes", "Results by shape", (CD, P2M, SURFACE_CD), scale=1e4, empty=f"no evaluated run; {_EVALUATE}"
            ),
        ),
    ),
    Section(
        "scenes",
        "Surfaces and clouds",
        (
            Panel(
                "scene",
                "Mesh and denoised cloud",
                names.MEDIA,
                empty="no run has pictures; set media=true",
            ),
        ),
    ),
    Section(
        "health",
        "Health of the sweep",
        (
            Panel("states", "States"),
            Panel("failures", "Failures", empty="no run failed"),
            Panel("rates", "Seconds a run", (names.SECONDS,), empty="no run has ended"),
        ),
    ),
)
