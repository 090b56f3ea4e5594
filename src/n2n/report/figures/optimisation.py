"""The fit at work in a plane cut: zero level set, three queries, the targets they were matched to."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from n2n.report.figures.request import Request
from n2n.report.figures.slices import Slice, draw_truth, draw_zero
from n2n.report.figures.style import INK, QUERIES, place, sheet
from n2n.report.figures.watch import Moment, watch

# From the paper's start, a sphere that knows nothing of the cloud, with a network small enough to be watched.
_SETTINGS = (
    "architecture=mlp",
    "architecture.layers=4",
    "architecture.width=64",
    "optimizer.lr=0.002",
    "scaffold=false",
    "terms.scaffold=null",
    "terms.far_field=null",
    "terms.smoothness=null",
    "batch_size=4096",
    "plan_reuse=5",
    "iterations=300",
)
_SHARES = (0.0, 0.1, 0.35, 1.0)
_SAMPLES = 220
_AXIS = 1
_WINDOW = 0.2  # half the width of the close-up; of the cloud's bounding radius
_THICK = 0.02  # half the thickness of the slab whose points are shown; of the bounding radius
_TITLE, _GAP, _KEY = 34, 12, 40


def draw(request: Request) -> Figure:
    """Draw the whole cut above, a close-up of the queries below, at four moments of the fit."""
    subject = request.subject()
    cut = Slice.through(subject.noisy, _AXIS)
    slab = subject.noisy[cut.near(subject.noisy, _THICK * subject.radius)]
    close = cut.around(_busiest(cut.flat(slab), _WINDOW * subject.radius), _WINDOW * subject.radius)
    queries = _spread(slab[_inside(close, slab)], len(QUERIES))
    config = request.config(*_SETTINGS)
    with request.progress("fitting") as report:
        moments = watch(subject.noisy, queries, config, _SHARES, report)
    truth = None if subject.vertices is None else cut.cut(subject.vertices, subject.faces)

    width = round(0.75 * request.size)
    height = round(width / cut.aspect)
    figure = sheet(len(moments) * (width + _GAP), _TITLE + height + width + 2 * _GAP + _KEY)
    for column, moment in enumerate(moments):
        for window, top, tall in ((cut, _TITLE, height), (close, _TITLE + height + _GAP, width)):
            axes = place(figure, column * (width + _GAP) + _GAP / 2, top, width, tall)
            shown = slab[_inside(window, slab)]
            dot = 3 if window is cut else 12
            axes.scatter(*window.flat(shown).T, s=dot, color="#c3c8d0", linewidth=0, zorder=1)
            draw_zero(axes, *window.values(moment.field, _SAMPLES), 1.6 if window is cut else 2.2)
            if truth is not None:
                draw_truth(axes, truth)
            _draw_queries(axes, window, queries, moment, window is close)
            window.prepare(axes)
            if window is cut:
                axes.set_title(f"after {moment.iteration:,} iterations", fontsize=12, color=INK)
    _key(figure, truth is not None)
    return figure


def _draw_queries(axes, window: Slice, queries: NDArray[np.float64], moment: Moment, close: bool) -> None:
    """Draw queries as squares, their pulled positions as rings with a line in between, their targets as dots."""
    for k, colour in enumerate(QUERIES):
        query, pulled = window.flat(queries[k : k + 1])[0], window.flat(moment.pulled[k : k + 1])[0]
        if close:
            axes.scatter(*window.flat(moment.targets[:, k]).T, s=26, color=colour, alpha=0.55, linewidth=0, zorder=4)
            axes.plot(*np.stack([query, pulled]).T, color=colour, linewidth=1.4, zorder=5)
            axes.scatter(*pulled, s=70, facecolor="white", edgecolor=colour, linewidth=1.8, zorder=6)
        axes.scatter(*query, s=52 if close else 18, color=colour, edgecolor=INK, linewidth=0.8, marker="s", zorder=7)


def _busiest(points: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """Return the point (2,) with most others around: where a section bends."""
    return points[cKDTree(points).query_ball_point(points, reach, return_length=True).argmax()]


def _inside(window: Slice, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    flat = window.flat(points)
    return ((flat > window.low) & (flat < window.high)).all(axis=1)


def _spread(points: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return `count` of the points far from each other, away from the rim; the first is the most central."""
    middle = points.mean(axis=0)
    inner = points[np.argsort(np.linalg.norm(points - middle, axis=1))[: max(count, 2 * len(points) // 3)]]
    chosen = [0]
    while len(chosen) < count:
        gaps = np.linalg.norm(inner[:, None] - inner[chosen], axis=2).min(axis=1)
        chosen.append(int(gaps.argmax()))
    return inner[chosen]


def _key(figure: Figure, truth: bool) -> None:
    from matplotlib.lines import Line2D

    grey = "#5d6470"
    entries = [
        Line2D([], [], color=INK, linewidth=2, label="zero level set"),
        Line2D([], [], marker="o", color="#c3c8d0", linestyle="", markersize=4, label="noisy points near the plane"),
        Line2D([], [], marker="s", color=grey, markeredgecolor=INK, linestyle="", label="query"),
        Line2D([], [], marker="o", markerfacecolor="white", color=grey, linestyle="", markersize=8, label="pulled"),
        Line2D([], [], marker="o", color=grey, alpha=0.55, linestyle="", label="targets matched so far"),
    ]
    if truth:
        entries.insert(1, Line2D([], [], color="#8a919c", linewidth=1, label="true section"))
    figure.legend(handles=entries, loc="lower center", ncols=len(entries), fontsize=10, frameon=False, labelcolor=INK)
