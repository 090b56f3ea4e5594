"""`n2n data prepare`: clean clouds with exact counts and noisy examples, in the layout of score-denoise."""

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from n2n import __version__
from n2n.cli.console import progress_bar
from n2n.cli.datasets import output_folder
from n2n.datamodules.catalog import dataset
from n2n.datamodules.clean_layouts import pcnet, poisson_folder, punet
from n2n.datamodules.download import sha256
from n2n.datamodules.layouts import Part, Scan, data_folder
from n2n.datamodules.origin import is_made
from n2n.datamodules.reading import read_scan
from n2n.errors import ConfigError, InputError
from n2n.formats import Cloud, atomic_path, write_cloud
from n2n.formats.atomic import ELSEWHERE, make_folder
from n2n.geometry.frame import Frame
from n2n.geometry.noise import add_noise
from n2n.geometry.poisson import poisson_disk, thin

_FOLDERS = {"pu": "PUNet", "pc": "PCNet"}
_SAMPLERS = {
    "pu": "Poisson-disk sampling of the mesh, exactly this many points (n2n.geometry.poisson.poisson_disk)",
    "pc": "Poisson-disk thinning of the 100,000 clean points, exactly this many (n2n.geometry.poisson.thin)",
}
_NOISE = (
    "Gaussian; standard deviation relative to the largest distance of the clean cloud from the centre of its box; "
    "generator numpy default_rng([seed, 0])"
)


def prepare(name: str, output: str | None, points: Sequence[int], noise: Sequence[str], seed: int) -> int:
    """Write clouds and examples of all shapes that are here, and a record of how they were made.

    Args:
        name: pu | pc.
        output: Data folder to write to; None for the one that is read.
        points: Points per cloud.
        noise: Standard deviations, as folders are to be called.
        seed: Of clouds and noise.

    Returns:
        0, or 2 if a shape was bad; the others are written all the same.

    Raises:
        ConfigError: A count or deviation out of range.
        InputError: There is no shape.
        OutputError: The folder cannot be written to.
    """
    levels = {text: _deviation(text) for text in noise}
    if any(count < 100 for count in points):
        raise ConfigError(f"--points {' '.join(map(str, points))}: give whole numbers of at least 100")
    if not 0 <= seed < 2**31:
        raise ConfigError(f"--seed {seed} is out of range; give a whole number from 0 to {2**31 - 1}")
    root, target = data_folder(), output_folder(output)
    part, meshes = _shapes(name, root)
    if not part.scans:
        raise InputError(f"{part.folder}: no shapes to prepare; {dataset(name).how()}")
    made: dict[str, Any] = {}
    record = target / f"n2n-prepared-{name}.json"
    bad = 0
    with progress_bar(f"preparing {name}") as report:
        for done, scan in enumerate(part.scans):
            report(done, len(part.scans), {})
            try:
                clouds = _clouds(name, scan, target, points, levels, seed)
            except InputError as error:
                bad += 1
                print(f"BAD {error}")
                continue
            sizes = {path: len(cloud) for path, cloud in clouds.items()}
            made[scan.name] = {"source": scan.path.name, "sha256": sha256(scan.path), "files": sizes}
            # Recorded first: what an interrupted run leaves must not pass for the benchmark's own.
            _record(name, record, points, noise, seed, made)
            for path, cloud in clouds.items():
                make_folder((target / path).parent, ELSEWHERE)
                write_cloud(target / path, Cloud(cloud))
            if scan.name in meshes and target != root:
                # P2M is measured against the mesh in the same tree.
                mesh = meshes[scan.name].path
                _copy(mesh, poisson_folder(target, _FOLDERS[name]) / "meshes/test" / mesh.name)
    files = sum(len(entry["files"]) for entry in made.values())
    print(f"{len(made)} shapes, {files} files in {target}; record: {record}" + (f"; {bad} bad" if bad else ""))
    if target != root:
        print(f"set N2N_DATA={target} to use them")
    return 2 if bad else 0


def _shapes(name: str, root: Path) -> tuple[Part, dict[str, Scan]]:
    """Return what clouds are drawn from, the meshes of PU or the clean clouds of PC, and the mesh of each shape."""
    parts = punet(root) if name == "pu" else pcnet(root)
    return parts[0], {scan.name: scan for part in parts if part.label == "meshes" for scan in part.scans}


def _clouds(
    name: str, scan: Scan, target: Path, points: Sequence[int], levels: dict[str, float], seed: int
) -> dict[str, NDArray[np.float64]]:
    """Draw all clouds of one shape: path below the target -> (n, 3).

    Raises:
        InputError: The shape is bad, or a file of the benchmark's own would be overwritten.
    """
    known, truth = read_scan(scan)
    place, folder = poisson_folder(target, _FOLDERS[name]), _FOLDERS[name]
    base = place.parent.relative_to(target)
    clouds: dict[str, NDArray[np.float64]] = {}
    for count in points:
        if name == "pu":
            clean = poisson_disk(truth.vertices, truth.faces, count, seed)
        else:
            clean = known[thin(known, count, seed)]
        frame = Frame.fit([clean])
        clouds[(base / folder / f"pointclouds/test/{count}_poisson/{scan.name}.xyz").as_posix()] = clean
        for text, level in levels.items():
            noisy = add_noise(frame.to_unit(clean), "gaussian", level, np.random.default_rng([seed, 0]))
            path = base / f"examples/{folder}_{count}_poisson_{text}/{scan.name}.xyz"
            clouds[path.as_posix()] = frame.to_world(noisy)
    for path in clouds:
        if (target / path).exists() and not is_made(target / path, str(target)):
            raise InputError(f"{target / path}: is there, not made by this command; write to another folder with -o")
    return clouds


def _record(
    name: str, record: Path, points: Sequence[int], noise: Sequence[str], seed: int, made: dict[str, Any]
) -> None:
    """Write what is made from what, and what was made before and is still there."""
    now = {path for entry in made.values() for path in entry["files"]}
    earlier = {path for path in _recorded(record) if (record.parent / path).exists()} - now
    content = {
        "n2n": __version__,
        "dataset": name,
        "split": "test",
        "points": list(points),
        "noise": list(noise),
        "seed": seed,
        "sampler": _SAMPLERS[name],
        "noise_model": _NOISE,
        "shapes": made,
        "earlier": sorted(earlier),
    }
    make_folder(record.parent, ELSEWHERE)
    with atomic_path(record) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n")


def _recorded(record: Path) -> set[str]:
    """Return the files that were made before; they stay told from the benchmark's own."""
    try:
        content = json.loads(record.read_text())
        return {*content.get("earlier", []), *(path for entry in content["shapes"].values() for path in entry["files"])}
    except FileNotFoundError:
        return set()
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise InputError(f"{record}: is not the record that this command writes; move it away") from error


def _deviation(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value < 1:
        raise ConfigError(
            f"--noise {text}: give a standard deviation from 0 to 1, relative to the radius, such as 0.01"
        )
    return value


def _copy(source: Path, target: Path) -> None:
    if not target.exists():
        make_folder(target.parent, ELSEWHERE)
        with atomic_path(target) as temporary:
            shutil.copyfile(source, temporary)
