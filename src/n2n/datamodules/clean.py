"""Clean clouds, and the noisy files that benchmarks ship with them: every row counts."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from n2n.datamodules.clean_layouts import is_clean
from n2n.datamodules.layouts import Scan
from n2n.datamodules.origin import shown
from n2n.datamodules.reading import read_scan
from n2n.errors import InputError
from n2n.geometry.frame import Frame
from n2n.geometry.poisson import poisson_disk, thin
from n2n.geometry.reference import Reference


def read_rows(scan: Scan) -> NDArray[np.float64]:
    """Read a cloud of which no row may be missing, (n, 3).

    Raises:
        InputError: It is not readable, not in the frame of its truth, has another number of points than its layout
            says, or rows that are NaN.
    """
    points = read_scan(scan)[0]
    if scan.count is not None and len(points) != scan.count:
        lost = scan.count - len(points)
        raise InputError(f"{scan.path}: {lost} of {scan.count} points are NaN or infinite; expected {scan.layout}")
    return points


def clean_cloud(
    files: Mapping[str, Scan],
    count: int,
    seed: int,
    root: str | None,
    mesh: Reference | None = None,
    beside: Path | None = None,
) -> tuple[NDArray[np.float64], str]:
    """Return a clean cloud of exactly so many points: stored, else drawn from the mesh, else thinned from the densest.

    Args:
        files: Label of the part -> file of the shape.
        count: How many points.
        seed: Of what is drawn.
        root: Data folder, for the text.
        mesh: To draw from; None where there is none.
        beside: A cloud that must lie in the same frame, where one is thinned.

    Returns:
        The points, (count, 3) world coordinates, and in a few words where they come from.

    Raises:
        InputError: No cloud is dense enough; or as for `read_rows`.
    """
    if stored := files.get(f"{count}_poisson"):
        return read_rows(stored), shown(stored.path, root)
    if mesh is not None:
        told = f"{shown(files['meshes'].path, root)}, {count} Poisson-disk points, seed {seed}"
        return poisson_disk(mesh.vertices, mesh.faces, count, seed), told
    densest = max((scan for label, scan in files.items() if is_clean(label)), key=lambda scan: scan.count)
    if count > densest.count:
        raise InputError(
            f"{densest.path}: holds {densest.count} points, {count} were asked for; lower datamodule.points"
        )
    world = read_rows(densest if beside is None else replace(densest, truth=beside))
    told = f"{shown(densest.path, root)}, {count} of {len(world)} points by Poisson disks, seed {seed}"
    return world[thin(world, count, seed)], told


def in_unit(frame: Frame, clean: NDArray[np.float64], mesh: Reference | None) -> Reference:
    """Return a clean cloud, (n, 3) unit coordinates, and a mesh in world coordinates as one reference."""
    if mesh is None:
        return Reference(points=clean)
    return Reference(points=clean, vertices=frame.to_unit(mesh.vertices), faces=mesh.faces)


def read_official(scan: Scan | None, wanted: str) -> NDArray[np.float64]:
    """Read a noisy file of the benchmark, (n, 3).

    Args:
        scan: Where it is; None if it is nowhere.
        wanted: What it is, for messages.
    """
    if scan is None:
        raise InputError(f"no official noisy file for {wanted}; leave out datamodule.official to draw the noise")
    return read_rows(scan)
