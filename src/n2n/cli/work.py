"""`n2n reconstruct | denoise | upsample`."""

import argparse
import time
import warnings
from pathlib import Path

import numpy as np

from n2n.cli.console import progress_bar, say
from n2n.cli.inputs import Input, plan_outputs, read_inputs, split_overrides
from n2n.formats import CLOUD_EXTENSIONS_WRITE, MESH_EXTENSIONS_WRITE, check_writable, write_cloud, write_mesh


def run_work(options: argparse.Namespace) -> int:
    """Read, fit (or load), do the task, write, tell."""
    start, quiet, task = time.perf_counter(), options.quiet, options.command
    paths, overrides = split_overrides(options.inputs)
    extensions = MESH_EXTENSIONS_WRITE if task == "reconstruct" else CLOUD_EXTENSIONS_WRITE
    outputs = plan_outputs(options.output, paths, extensions, per_input=task != "reconstruct")
    if options.preview:
        check_writable(options.preview, (".png",))
    if not (options.run and task == "reconstruct" and not paths):
        inputs = read_inputs(paths, quiet)
    else:
        inputs = []
    field = _load(options) if options.run else _fit(options, inputs, overrides)

    if task == "reconstruct":
        with progress_bar("extracting the surface", quiet):
            mesh = field.reconstruct(options.resolution, options.edge)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            write_mesh(outputs[0], mesh)
        for warning in caught:
            if issubclass(warning.category, UserWarning):
                say(str(warning.message), quiet)
        closed = "watertight" if mesh.is_watertight else "open"
        done = f"{len(mesh.vertices):,} vertices, {len(mesh.faces):,} faces, {closed}"
    else:
        mesh = None
        written = 0
        for output, item in zip(outputs, inputs, strict=False):
            result = _denoised(field, item) if task == "denoise" else _upsampled(field, item, options)
            write_cloud(output, result)
            written += len(result)
        done = f"{written:,} points" + (f" in {len(outputs)} files" if len(outputs) > 1 else "")
    if options.preview:
        _preview(options.preview, field, inputs, mesh)
    where = outputs[0] if len(outputs) == 1 else outputs[0].parent
    say(f"{task}: {done} -> {where}  ({time.perf_counter() - start:.0f} s)", quiet)
    return 0


def _load(options: argparse.Namespace):
    from n2n.tasks.field import Field

    return Field.load(options.run, options.device)


def _fit(options: argparse.Namespace, inputs: list[Input], overrides: list[str]):
    from n2n.compose import compose
    from n2n.tasks.api import fit_clouds

    given = [f"task={options.command}", f"device={options.device}", f"seed={options.seed}", *overrides]
    config = compose(given)
    with progress_bar("fitting", options.quiet) as report:
        field = fit_clouds([item.points for item in inputs], config, report=report)
    facts = field.report
    say(
        f"{facts['points'][0]:,} points in {facts['observations'][0]} observation(s): noise {facts['noise'][0]:.3g}, "
        f"spacing {facts['spacing'][0]:.3g} (estimated, in the scan's units); "
        f"{facts['iterations']} iterations on {facts['device']}",
        options.quiet,
    )
    return field


def _denoised(field, item: Input):
    """Denoise the finite rows; others stay as they are, so that number and order hold."""
    points = item.cloud.points.copy()
    points[item.finite] = field.denoise(item.points)
    return item.cloud.replace(points)


def _upsampled(field, item: Input, options: argparse.Namespace):
    points = field.upsample(item.points, options.rate, options.seed)
    rows = np.tile(np.flatnonzero(item.finite), options.rate)
    return item.cloud.replace(points, rows)


def _preview(path: str, field, inputs: list[Input], mesh) -> None:
    from n2n.report.preview import draw_preview

    before = inputs[0].points if inputs else None
    after = field.denoise(before) if before is not None else None
    draw_preview(Path(path), before, after, mesh if mesh is not None else field.reconstruct(192))
