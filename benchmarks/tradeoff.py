"""Error against time: `python -m benchmarks.tradeoff [COUNT ...] [--shapes ...] [--noise ...]`.

Fits the clouds of ../shared/data/peers with fixed numbers of iterations, the three qualities among them, and draws
docs/images/quality_tradeoff.png. Every fit is kept in OUT/tradeoff.json and not repeated, so that a long series may be
interrupted; delete that file after a change to the recipe. Seconds are processor time of one thread, which other work
on the machine hardly changes.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch

import n2n
from benchmarks import ROOT
from benchmarks.__main__ import OUT
from benchmarks.quality import SHAPES, SHARED, _case
from n2n.cli.arguments import QUALITIES
from n2n.formats.atomic import atomic_path

PICTURE = ROOT / "docs" / "images" / "quality_tradeoff.png"
_NORMAL = 160
_NAMED = {round(_NORMAL * effort): name for name, effort in QUALITIES.items()}
_COUNTS = sorted({40, 100, 240, *_NAMED})


def main() -> None:
    """Measure what is missing, print the means and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("counts", nargs="*", type=int, default=_COUNTS, metavar="COUNT")
    parser.add_argument("--shapes", default=",".join(SHAPES))
    parser.add_argument("--noise", default="1,3", help="percent of the unit sphere's radius; any number (1,3)")
    parser.add_argument("--points", type=int, default=10_000)
    parser.add_argument("--results", type=Path, default=OUT / "tradeoff.json")
    parser.add_argument("-o", "--output", type=Path, default=PICTURE)
    options = parser.parse_args()
    torch.set_num_threads(1)
    options.results.parent.mkdir(parents=True, exist_ok=True)
    rows = json.loads(options.results.read_text()) if options.results.exists() else []
    done = {(row["case"], row["iterations"]) for row in rows}
    for noise in options.noise.split(","):
        for shape in options.shapes.split(","):
            for count in options.counts:
                case = f"{shape}, {options.points:,} points, {float(noise):g} %"
                if (case, count) not in done:
                    rows.append({"case": case, **_measure(shape, float(noise), options.points, count)})
                    print(*(f"{key}={value:.4g}" if key != "case" else value for key, value in rows[-1].items()))
                    with atomic_path(options.results) as temporary:
                        temporary.write_text(json.dumps(rows, indent=1))
    for count, mean in means(rows).items():
        print(f"{count} iterations: error {mean['error']:.3f}, seconds {mean['seconds']:.2f} of those of {_NORMAL}")
    draw(rows, options.output)


def _measure(shape: str, noise: float, points: int, count: int) -> dict[str, float]:
    """Fit one cloud and score it: P2M x 10^4 of the denoised points."""
    sys.path.insert(0, str(SHARED / "accept"))
    import accept

    _, noisy, vertices, faces = _case(shape, noise, points, np.random.default_rng(7))
    start = time.process_time()
    field = n2n.fit(noisy, overrides=[f"iterations={count}"])
    seconds = time.process_time() - start
    error = 1e4 * (accept.project(field.denoise(noisy), vertices, faces)[0] ** 2).mean()
    return {"iterations": count, "error": float(error), "seconds": seconds}


def relative(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Divide errors and seconds by those of the same case at normal quality; cases without are left out."""
    normal = {row["case"]: row for row in rows if row["iterations"] == _NORMAL}
    return [
        {**row, **{key: row[key] / normal[row["case"]][key] for key in ("error", "seconds")}}
        for row in rows
        if row["case"] in normal
    ]


def means(rows: list[dict[str, Any]]) -> dict[int, dict[str, float]]:
    """Return the geometric means over the cases by the number of iterations, where every case has that number."""
    related, found = relative(rows), {}
    for count in sorted({row["iterations"] for row in related}):
        own = [row for row in related if row["iterations"] == count]
        if len(own) == len({row["case"] for row in related}):
            found[count] = {
                key: float(np.exp(np.mean([np.log(row[key]) for row in own]))) for key in ("error", "seconds")
            }
    return found


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Write the picture: every case and the mean, over iterations and over seconds."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.2), dpi=80, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 2, sharey=True)
    errors, average = relative(rows), means(rows)
    seconds = {row["case"]: row["seconds"] for row in rows if row["iterations"] == _NORMAL}
    usual = float(np.exp(np.mean(np.log(list(seconds.values())))))
    for case in dict.fromkeys(row["case"] for row in errors):
        own = sorted((row for row in errors if row["case"] == case), key=lambda row: row["iterations"])
        error = [row["error"] for row in own]
        panels[0].plot([row["iterations"] for row in own], error, lw=1, marker=".", label=case)
        panels[1].plot([row["seconds"] * seconds[case] for row in own], error, lw=1, marker=".")
    mean = [one["error"] for one in average.values()]
    panels[0].plot(list(average), mean, "k", lw=2.5, label="geometric mean")
    panels[1].plot([one["seconds"] * usual for one in average.values()], mean, "k", lw=2.5)
    for count, name in _NAMED.items():
        if count in average:
            for axes, x in zip(panels, (count, average[count]["seconds"] * usual), strict=True):
                axes.plot(x, average[count]["error"], "ko", ms=8)
                axes.annotate(name, (x, average[count]["error"]), (0, 9), textcoords="offset points", ha="center")
    for axes, label in zip(panels, ("iterations", "seconds of one core, fit alone"), strict=True):
        axes.set(xlabel=label, xscale="log", yscale="log")
        axes.grid(alpha=0.3, which="both")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter("{x:g}")
    ticks = sorted({row["iterations"] for row in errors})
    panels[0].set_xticks(ticks, [str(tick) for tick in ticks])
    panels[0].set_xticks([], minor=True)
    panels[0].set_ylabel("P2M / P2M at normal quality")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper", fontsize=7, frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png")


if __name__ == "__main__":
    main()
