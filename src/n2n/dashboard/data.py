"""What the page needs to know, as plain data."""

import math
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import n2n
from n2n.dashboard.curves import thin
from n2n.dashboard.definition import SECTIONS, Panel
from n2n.dashboard.media import MESH, PICTURE, POINTS, read_picture, read_scene
from n2n.dashboard.paper import curve_of, versus
from n2n.dashboard.run import Run, is_there

_POINTS_OF_ALL = 350_000  # of all curves together: about 4 MB
_POINTS, _FEWEST = 300, 40
_DIGITS = 4
_MAX_AXES = 10
# A run's own name or place, and what follows from other settings, is no axis of a comparison.
_NO_AXIS = ("checkpoint_every", "experiment", "debug", "evaluate", "media", "datamodule.root", "datamodule.paths")
# What a page may hold of a run's media: its key, what to call it, its files, how they are read.
_MEDIA = (
    ("picture", "pictures", (PICTURE,), read_picture),
    ("scene", "scenes", (MESH, POINTS), read_scene),
)
_AT_ONCE = 16
_SHAPE = "datamodule.shape"


def page_data(runs: Sequence[Run], media_bytes: int) -> dict[str, Any]:
    """Return everything the page shows.

    Args:
        runs: To be shown.
        media_bytes: Most that pictures and 3D views may take; newest runs come first, the page says what is left out.
    """
    count = curve_points(sum(len(run.curves) for run in runs))
    differing = find_differing(runs)
    shown = [_run_data(run, count) for run in runs]
    left_out = add_media(runs, shown, media_bytes)
    return {
        "made": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "version": n2n.__version__,
        "sections": [
            {"key": s.key, "title": s.title, "panels": [_panel_data(panel) for panel in s.panels]} for s in SECTIONS
        ],
        "differing": differing,
        "axes": [key for key in differing if _is_axis(key, runs)][:_MAX_AXES],
        "runs": shown,
        "versus": versus(runs),
        "curvePoints": count,
        "leftOut": left_out,
        "mediaBytes": media_bytes,
    }


def curve_points(curves: int) -> int:
    """Return how many points of each curve are shown."""
    return max(_FEWEST, min(_POINTS, _POINTS_OF_ALL // max(curves, 1)))


def find_differing(runs: Sequence[Run]) -> list[str]:
    """Return the settings that tell runs apart: what sweeps vary first, then whatever differs, fewest values first."""
    swept = list(dict.fromkeys(key for run in runs for key in run.swept))
    told = [run.config for run in runs if run.config]
    keys = dict.fromkeys(key for config in told for key in config)
    varied = {}
    for key in keys:
        # Another component has other arguments: that they are missing tells no more than the component's name.
        values = {str(config.get(key)) for config in told if key in config or "." not in key}
        if key not in (*swept, _SHAPE) and len(values) > 1 and not key.startswith(_NO_AXIS):
            varied[key] = len(values)
    if len({run.shape for run in runs} - {""}) > 1 and _SHAPE not in swept:
        varied[_SHAPE] = 0
    return swept + sorted(varied, key=lambda key: (key != _SHAPE and key.count("."), varied[key]))


def _is_axis(key: str, runs: Sequence[Run]) -> bool:
    """Tell whether runs have different values of a setting; that some have none makes no axis."""
    if key == _SHAPE:
        return True
    given = [settings for run in runs if key in (settings := {**run.config, **run.swept})]
    return len({str(settings[key]) for settings in given}) > 1


def add_media(runs: Sequence[Run], shown: list[dict[str, Any]], media_bytes: int) -> dict[str, int]:
    """Add pictures, then 3D views, of the newest runs first, while there is room; return how many were left out."""
    left_out = {"pictures": 0, "scenes": 0}
    folders = [run.folder / "media" for run in runs]
    order = sorted(range(len(runs)), key=lambda index: _age(folders[index]))
    room = media_bytes
    for kind, name, files, read in _MEDIA:
        here = [index for index in order if any(is_there(folders[index] / file) for file in files)]
        while here and room > 0:
            # Decoding and packing leave Python, so threads help; a few at a time, as the room may end at any of them.
            some, here = here[:_AT_ONCE], here[_AT_ONCE:]
            with ThreadPoolExecutor() as pool:
                parts = list(pool.map(lambda index, read=read: read(folders[index], shown[index]["problems"]), some))
            for index, part in zip(some, parts, strict=True):
                if _size(part) > room:
                    left_out[name] += 1
                elif part is not None:
                    shown[index][kind] = part
                    room -= _size(part)
            if left_out[name]:
                break
        left_out[name] += len(here)
    return left_out


def _size(part: Any) -> int:
    values = part.values() if isinstance(part, dict) else [part]
    return sum(len(value) for value in values if isinstance(value, str))


def _age(folder: Path) -> float:
    try:
        return time.time() - folder.stat().st_mtime
    except OSError:
        return math.inf


def _panel_data(panel: Panel) -> dict[str, Any]:
    return {**asdict(panel), "paper": [curve_of(reference) for reference in panel.paper]}


def _run_data(run: Run, count: int) -> dict[str, Any]:
    curves = {}
    for name, curve in run.curves.items():
        steps, values = thin(*curve, count)
        curves[name] = [[round(step) for step in steps.tolist()], [_short(value) for value in values.tolist()]]
    return {
        "id": run.id,
        "folder": str(run.folder),
        "sweep": run.sweep,
        "shape": run.shape,
        "state": run.state,
        "error": run.error,
        "seconds": run.seconds,
        "attempt": run.attempt,
        "started": run.started,
        "heartbeat": run.heartbeat,
        "swept": run.swept,
        "config": {key: _plain(value) for key, value in run.config.items()},
        "effective": {key: _plain(value) for key, value in run.effective.items() if run.config.get(key) != value},
        "values": {key: _short(value) for key, value in run.values.items()},
        "floors": {key: _short(value) for key, value in run.floors.items()},
        "curves": curves,
        "problems": list(run.problems),
        "note": run.note,
    }


def _short(value: float) -> float | None:
    return float(f"{value:.{_DIGITS + 2}g}") if math.isfinite(value) else None


def _plain(value: Any) -> Any:
    """Return a setting as JSON knows it; what it does not know is shown as text."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return str(value)
