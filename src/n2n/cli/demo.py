"""`n2n demo`: the main job on a bundled scan whose truth is known."""

import time
from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from n2n.cli.console import progress_bar, say
from n2n.compose import compose
from n2n.errors import InputError
from n2n.formats import check_writable, read_cloud, write_cloud, write_mesh
from n2n.formats.atomic import ELSEWHERE, make_folder
from n2n.geometry.shapes import bracket
from n2n.report.preview import draw_preview
from n2n.tasks.api import fit_clouds

# The bundled scan stands in a world of its own, as real scans do: millimetres, away from the origin.
OFFSET = np.array([350.0, -120.0, 40.0])


def run_demo(output: str) -> int:
    """Fit the bundled scan of a bracket; write mesh, denoised cloud and picture; print the error against the truth."""
    start = time.perf_counter()
    folder = Path(output)
    make_folder(folder, ELSEWHERE)
    check_writable(folder / "mesh.ply", (".ply",))
    cloud = read_cloud(sample_path())
    say(f"scan: {len(cloud):,} points of a mounting bracket, in mm, no normals ({sample_path()})")
    with progress_bar("fitting") as report:
        field = fit_clouds([cloud.points], compose([]), report=report)
    with progress_bar("extracting the surface"):
        mesh = field.reconstruct(256)
    clean = field.denoise(cloud.points)
    write_mesh(folder / "mesh.ply", mesh)
    write_cloud(folder / "denoised.ply", cloud.replace(clean))
    draw_preview(folder / "before_after.png", cloud.points, clean, mesh)

    facts = field.report
    say(f"noise {facts['noise'][0]:.2f} mm, point spacing {facts['spacing'][0]:.2f} mm (both estimated from the scan)")
    say("distance to the true surface, mm:      rms    95 %     max")
    for name, points in (("noisy scan", cloud.points), ("denoised scan", clean), ("mesh vertices", mesh.vertices)):
        rms, high, worst = distance_summary(points)
        say(f"  {name:<30} {rms:8.3f} {high:7.3f} {worst:7.3f}")
    closed = "watertight" if mesh.is_watertight else "not watertight"
    say(f"mesh: {len(mesh.faces):,} faces, {closed}, {mesh.body_count} component(s)")
    say(f"demo: mesh.ply, denoised.ply and before_after.png -> {folder}/  ({time.perf_counter() - start:.0f} s)")
    say("next: n2n reconstruct YOUR_SCAN.ply -o mesh.ply")
    return 0


def distance_summary(points: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return rms, 95th percentile and maximum of the distance to the true bracket, mm."""
    distance = np.abs(bracket(np.asarray(points) - OFFSET))
    return float(np.sqrt((distance**2).mean())), float(np.quantile(distance, 0.95)), float(distance.max())


def sample_path() -> Path:
    """Return the bundled scan: inside the wheel, or in examples/ of a checkout."""
    packaged = Path(str(files("n2n"))) / "data" / "bracket.ply"
    checkout = Path(__file__).parents[3] / "examples" / "data" / "bracket.ply"
    for path in (packaged, checkout):
        if path.exists():
            return path
    raise InputError("the bundled scan bracket.ply is missing; reinstall n2n")
