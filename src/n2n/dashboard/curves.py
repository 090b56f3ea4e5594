"""What a fit logged over its iterations, thinned to what a picture can show."""

import csv
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Curve = tuple[NDArray[np.float64], NDArray[np.float64]]
_STEP = "step"
_PART = re.compile(r"metrics\.(\d+)\.csv")


def read_curves(folder: Path, problems: list[str]) -> dict[str, Curve]:
    """Return the curves of a run folder: steps (n,) and values (n,) by metric, of all parts of an interrupted fit.

    Args:
        folder: With metrics.csv, and metrics.0.csv, metrics.1.csv, ... of earlier parts.
        problems: What cannot be read is added here.
    """
    earlier = sorted((int(match[1]), path) for path in folder.glob("metrics.*.csv") if (match := _part(path)))
    curves: dict[str, Curve] = {}
    for path in [*(path for _, path in earlier), folder / "metrics.csv"]:
        for name, (steps, values) in _read(path, problems).items():
            before = curves.get(name, (np.empty(0), np.empty(0)))
            # A resumed fit repeats the steps since its last checkpoint.
            kept = before[0] < steps[0]
            curves[name] = np.concatenate([before[0][kept], steps]), np.concatenate([before[1][kept], values])
    return curves


def thin(steps: NDArray[np.float64], values: NDArray[np.float64], count: int) -> Curve:
    """Return at most `count` of the points of a curve: the ends, and of every stretch the lowest and the highest.

    >>> steps, values = thin(np.arange(100.0), np.eye(100)[70], 8)
    >>> len(steps) <= 8, values.max(), steps[[0, -1]].tolist()
    (True, 1.0, [0.0, 99.0])
    """
    if len(steps) <= count:
        return steps, values
    bounds = np.linspace(1, len(steps) - 1, max(count // 2 - 1, 1) + 1).astype(int)
    kept = {0, len(steps) - 1}
    for low, high in pairwise(bounds.tolist()):
        if high > low:
            kept |= {low + int(values[low:high].argmin()), low + int(values[low:high].argmax())}
    index = sorted(kept)
    return steps[index], values[index]


def _part(path: Path) -> re.Match[str] | None:
    return _PART.fullmatch(path.name)


def _read(path: Path, problems: list[str]) -> dict[str, Curve]:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            header, *rows = list(csv.reader(file)) or [[]]
        # The last line of a fit that was killed may be half a line.
        whole = [row for row in rows if len(row) == len(header)]
        table = np.array([[cell or "nan" for cell in row] for row in whole], dtype=np.float64)
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, csv.Error) as error:
        problems.append(f"{path.name}: cannot be read ({error})")
        return {}
    if not whole:
        return {}
    if _STEP not in header:
        problems.append(f"{path.name}: has no column {_STEP!r}")
        return {}
    steps = table[:, header.index(_STEP)]
    curves = {}
    for column, name in enumerate(header):
        known = np.isfinite(steps) & np.isfinite(table[:, column])
        if name not in (_STEP, "epoch") and known.any():
            order = np.argsort(steps[known], kind="stable")
            curves[name] = steps[known][order], table[known, column][order]
    return curves
