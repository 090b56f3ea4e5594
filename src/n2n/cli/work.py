"""`n2n reconstruct | denoise | upsample`: read, fit or load, do the task, write, tell."""

import argparse
import re
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from n2n.cli.arguments import QUALITIES
from n2n.cli.console import progress_bar, say
from n2n.cli.inputs import Input, read_inputs, remarks, split_overrides
from n2n.cli.outputs import check_preview, new_folder, plan_outputs
from n2n.errors import ConfigError
from n2n.formats import CLOUD_EXTENSIONS_WRITE, MESH_EXTENSIONS_WRITE, Cloud, write_cloud, write_mesh
from n2n.geometry.outliers import outliers

if TYPE_CHECKING:
    from n2n.tasks.field import Field

_RESOLUTIONS = (8, 2048)
_ONLY_FIT = ("datamodule", "logger", "checkpoint_every", "task", "validation", "evaluate", "media", "hydra")


def run_work(options: argparse.Namespace) -> int:
    """Run one task; everything that can be wrong with the request is found before the fit."""
    start = time.perf_counter()
    task, quiet = options.command, options.quiet
    paths, overrides = split_overrides(options.inputs)
    if options.run and overrides:
        raise ConfigError(
            f"{overrides[0]} has no effect on a finished run; leave it out, or leave out --run to fit anew"
        )
    if options.run and options.quality != "normal":
        raise ConfigError(f"--quality {options.quality} has no effect on a finished run; leave it or --run out")
    extensions = MESH_EXTENSIONS_WRITE if task == "reconstruct" else CLOUD_EXTENSIONS_WRITE
    outputs = plan_outputs(options.output, paths, extensions, per_input=task != "reconstruct")
    if options.preview:
        check_preview(Path(options.preview), outputs[0].parent)
    needs_points = not (options.run and task == "reconstruct")
    inputs = read_inputs(paths, task) if paths or needs_points else []
    _check_numbers(options, inputs)
    ready = _load(options) if options.run else _configure(options, overrides)
    # Remarks wait until nothing is wrong any more: an error stands alone.
    for remark in (line for item in inputs for line in remarks(item, task)):
        say(remark, quiet)
    field = _fit(options, inputs, ready) if isinstance(ready, dict) else ready
    done = (_reconstruct if task == "reconstruct" else _move)(field, options, inputs, outputs)
    where = outputs[0] if len(outputs) == 1 else outputs[0].parent
    say(f"{task}: {done} -> {where}  ({time.perf_counter() - start:.0f} s)", quiet)
    if task != "reconstruct" and len(outputs) < len(inputs):
        say(f"only the first of {len(inputs)} inputs was written; -o FOLDER/ writes one result for each", quiet)
    return 0


def _check_numbers(options: argparse.Namespace, inputs: list[Input]) -> None:
    if options.command == "upsample" and options.rate < 1:
        raise ConfigError(f"--rate {options.rate} is out of range; give 1 or more points per point")
    if options.command != "reconstruct":
        return
    low, high = _RESOLUTIONS
    if options.edge is None:
        if not low <= options.resolution <= high:
            raise ConfigError(f"--resolution {options.resolution} is out of range; give {low} to {high} voxels")
        return
    if not 0 < options.edge < float("inf"):
        raise ConfigError(f"--edge {options.edge} is out of range; give a positive length in the scan's units")
    if inputs:
        longest = float(np.ptp(inputs[0].points, axis=0).max())
        if not low <= longest / options.edge <= high:
            raise ConfigError(
                f"--edge {options.edge:g} makes {longest / options.edge:.3g} voxels along the longest side "
                f"({longest:.4g}); give {longest / high:.3g} to {longest / low:.3g}"
            )


def _load(options: argparse.Namespace) -> "Field":
    from n2n.tasks.field import Field

    field = Field.load(options.run, options.device)
    if not 0 <= options.shape < len(field.frames):
        raise ConfigError(
            f"--shape {options.shape} is out of range; this run holds shapes 0 to {len(field.frames) - 1}"
        )
    return field


def _configure(options: argparse.Namespace, overrides: list[str]) -> dict[str, Any]:
    """Compose the fit's configuration; a setting `seed=1` wins over --seed, for everything random."""
    from n2n.compose import compose
    from n2n.fitting.fit import pick_device

    if options.shape:
        raise ConfigError(f"--shape {options.shape} chooses a shape of a run; give the run with --run")
    for text in overrides:
        if (key := re.split(r"[.=]", text.lstrip("+~"))[0]) in _ONLY_FIT:
            raise ConfigError(f"{text} has no effect here: {key} belongs to runs that are kept; use it with `n2n fit`")
    chosen = [f"device={options.device}", f"seed={options.seed}", f"effort={QUALITIES[options.quality]}"]
    config = compose([f"task={options.command}", *chosen, *overrides])
    pick_device(config["device"])
    options.seed = config["seed"]
    return config


def _fit(options: argparse.Namespace, inputs: list[Input], config: dict[str, Any]) -> "Field":
    from n2n.tasks.api import fit_clouds

    with progress_bar("fitting", options.quiet) as report:
        field = fit_clouds([item.points for item in inputs], config, report=report)
    facts = field.report
    if count := facts["outliers"][0]:
        say(f"{count:,} points look like outliers and took no part in the fit", options.quiet)
    several = f" in {facts['observations'][0]} observations" if facts["observations"][0] > 1 else ""
    say(
        f"{facts['points'][0]:,} points{several}: noise {facts['noise'][0]:.3g}, spacing {facts['spacing'][0]:.3g} "
        f"(estimated, in the scan's units); {facts['iterations']:,} iterations on {facts['device']}",
        options.quiet,
    )
    return field


def _reconstruct(field: "Field", options: argparse.Namespace, inputs: list[Input], outputs: list[Path]) -> str:
    with progress_bar("extracting the surface", options.quiet):
        mesh = field.reconstruct(options.resolution, options.edge, options.shape)
    _write(write_mesh, outputs[0], mesh, options.quiet)
    if options.preview:
        before = inputs[0].points if inputs else None
        _preview(options.preview, before, None if before is None else field.denoise(before, options.shape), mesh)
    closed = "watertight" if mesh.is_watertight else "not watertight"
    return f"{len(mesh.vertices):,} vertices, {len(mesh.faces):,} faces, {closed}"


def _move(field: "Field", options: argparse.Namespace, inputs: list[Input], outputs: list[Path]) -> str:
    move = _denoised if options.command == "denoise" else _upsampled
    results = []
    # A file takes the first input's result only; zip stops there.
    for output, item in zip(outputs, inputs, strict=False):
        results.append(move(field, item, options))
        _write(write_cloud, output, results[-1], options.quiet)
    if options.preview:
        after = results[0].points
        _preview(options.preview, inputs[0].points, after[np.isfinite(after).all(axis=1)], None)
    files = f" in {len(results)} files" if len(results) > 1 else ""
    return f"{sum(map(len, results)):,} points{files}"


def _write(write: Callable[[Path, Any], None], path: Path, result: Any, quiet: bool) -> None:
    """Write a result into a folder that may not exist yet; tell what its format cannot hold."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with new_folder(path.parent):
            write(path, result)
    for warning in caught:
        if issubclass(warning.category, UserWarning):
            say(str(warning.message), quiet)


def _denoised(field: "Field", item: Input, options: argparse.Namespace) -> Cloud:
    """Denoise the finite rows; others stay as they are, so that number and order hold."""
    points, rows = item.cloud.points.copy(), _rows(item, options)
    points[rows] = field.denoise(points[rows], options.shape, options.even)
    if not options.remove_outliers:
        return item.cloud.replace(points)
    kept = ~item.finite
    kept[rows] = True
    return item.cloud.replace(points[kept], np.flatnonzero(kept))


def _upsampled(field: "Field", item: Input, options: argparse.Namespace) -> Cloud:
    """Add points; each takes the attributes of the point it was made from."""
    rows = _rows(item, options)
    points = field.upsample(item.cloud.points[rows], options.rate, options.seed, options.shape, options.even)
    return item.cloud.replace(points, np.tile(rows, options.rate))


def _rows(item: Input, options: argparse.Namespace) -> np.ndarray:
    """Return the rows to move: the finite ones, with --remove-outliers without outliers."""
    rows = np.flatnonzero(item.finite)
    if options.remove_outliers:
        stray = outliers(item.points)
        rows = rows[~stray]
        say(f"{item.path}: {np.count_nonzero(stray):,} outliers removed", options.quiet)
    return rows


def _preview(path: str, before: np.ndarray | None, after: np.ndarray | None, mesh: object) -> None:
    from n2n.report.preview import draw_preview

    draw_preview(Path(path), before, after, mesh)
