"""Where the files of a benchmark's scans lie in its official layout; looks, reads only lists, imports no torch."""

import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from n2n.errors import InputError

# Archives of different authors unpack to the same folders below one of these.
_BASES = ("", "data", "datasets", "optim_data", "optim_data/data")
_LISTS = ("testset.txt", "valset.txt", "trainset.txt")  # the sets for testing have the first alone
_TRUTHS = (".ply", ".xyz", ".obj", ".off")
SRB_SHAPES = ("anchor", "daratech", "dc", "gargoyle", "lord_quas")
SCENES = ("lounge", "copyroom")  # of the paper; others may lie beside them
_RAW = "500[0-9][0-9]/*/*.ply"  # subjects of D-FAUST
STREETS = ("GT_Madame1_2", "GT_Madame1_3")
FAMOUS = tuple(f"famous_{variant}" for variant in ("original", "noisefree", "dense", "sparse", "extra_noisy"))
ABC = ("abc", "abc_noisefree", "abc_extra_noisy", "abc_minimal")
_COUNTS = {"famous": 22, "abc_minimal": 3, "abc": 100}
FAMOUS_SHAPES = (
    *("3DBenchy", "Armadillo", "Cup34", "Liberty", "LibertyBase", "Utah_teapot_(solid)", "angel", "bunny", "column"),
    *("dragon", "eg07_dragon_original", "flower", "galera", "hand", "happy", "horse", "netsuke", "serapis", "tortuga"),
    *("xyzrgb_dragon_clean", "xyzrgb_statuette", "yoda"),
)


@dataclass(frozen=True)
class Scan:
    """One shape: a scan and, where there is one, its truth.

    Attributes:
        name: What to ask for.
        path: The scan.
        truth: Mesh or clean cloud.
        layout: What the files must be, for messages.
        columns: How many numbers a point of the scan has; None: at least 3.
        count: How many points the scan must have; None: any number.
        largest: What the longest edge of the scan's box stays below; None: any size.
        is_mesh: Whether `path` is a mesh, which is the truth itself.
        in_unit_box: Whether the scan may be stored with the truth's box moved to the origin and its longest edge at 1.
    """

    name: str
    path: Path
    truth: Path | None
    layout: str
    columns: int | None = None
    count: int | None = None
    largest: float | None = None
    is_mesh: bool = False
    in_unit_box: bool = False


@dataclass(frozen=True)
class Part:
    """One folder of a benchmark: a variant, or the whole.

    Attributes:
        label: Name of the variant; else of the benchmark.
        folder: Where it is, or where it would be.
        scans: What is there, in official order.
        expected: How many shapes are official; None if that is not known.
        absent: Official shapes that are not here, as far as their names are known.
        with_truth: Whether the benchmark has a truth beside each scan.
        problems: What is wrong with the folder itself, one line each.
        optional: Whether the benchmark is complete without.
    """

    label: str
    folder: Path
    scans: tuple[Scan, ...] = ()
    expected: int | None = None
    absent: tuple[str, ...] = ()
    with_truth: bool = False
    problems: tuple[str, ...] = ()
    optional: bool = False


def data_folder(root: str | Path | None = None) -> Path:
    """Return the folder of all benchmarks: `root`, else the environment's N2N_DATA, else ./data."""
    return Path(root or os.environ.get("N2N_DATA") or "data")


def points2surf(root: Path, variant: str) -> Part:
    """Find `<variant>/{testset.txt, 04_pts/NAME.xyz.npy, 03_meshes/NAME.ply}`."""
    folder = folder_of(root, variant)
    layout = f"{variant}/04_pts/NAME.xyz.npy float32 (n, 3), {variant}/03_meshes/NAME.ply, {variant}/testset.txt"
    expected = next(count for family, count in _COUNTS.items() if variant.startswith(family))
    optional = variant == "abc_minimal"
    official = FAMOUS_SHAPES if variant.startswith("famous") else ()
    part = Part(variant, folder, (), expected, official, with_truth=True, optional=optional)
    if not folder.is_dir():
        return part
    names, problems = [], []
    for file in [folder / name for name in _LISTS]:
        if file.is_file():
            listed, wrong = read_list(file)
            names += listed
            problems += wrong
        elif file.name == _LISTS[0]:
            problems.append(f"{file}: is missing; expected {layout}")
    if not names:
        names = sorted(path.name.removesuffix(".xyz.npy") for path in (folder / "04_pts").glob("*.xyz.npy"))
    scans = []
    for name in dict.fromkeys(names):
        path = folder / "04_pts" / f"{name}.xyz.npy"
        if path.is_file():
            scans.append(Scan(name, path, folder / "03_meshes" / f"{name}.ply", layout, columns=3))
        else:
            problems.append(f"{path}: is missing though a list in {folder} names it; expected {layout}")
    missing = _missing(scans, official or tuple(dict.fromkeys(names)))
    return replace(part, scans=tuple(scans), absent=missing, problems=tuple(problems))


def dfaust(root: Path) -> Part:
    """Find the selection of SAP, `dfaust/NAME.ply`, else raw, `[dfaust/]scans/SUBJECT/ACTION/ACTION.FRAME.ply`."""
    folder = folder_of(root, "dfaust", "DFAUST", "D-FAUST")
    layout = "dfaust/NAME.ply or dfaust/scans/SUBJECT/ACTION/ACTION.FRAME.ply, truth in dfaust/ground_truth/NAME.ply"
    places = [(folder, "*.ply"), (folder / "scans", _RAW), (folder_of(root, "scans"), _RAW)]
    top, paths = next(((top, found) for top, ending in places if (found := sorted(top.glob(ending)))), (folder, []))
    names = [path.relative_to(top).as_posix().removesuffix(".ply") for path in paths]
    truths = [folder / "ground_truth", folder]
    scans = [Scan(name, path, _truth(truths, [name], path), layout) for name, path in zip(names, paths, strict=True)]
    return Part("dfaust", top, tuple(scans), 5, with_truth=True)


def srb(root: Path) -> Part:
    """Find `{scans | input}/NAME.ply` (or NAME.ply itself, the copy of SAP) and `ground_truth/NAME.{xyz, ply}`."""
    folder = folder_of(root, "srb", "deep_geometric_prior_data")
    layout = "srb/scans/NAME.ply with x y z, srb/ground_truth/NAME.xyz"
    inside = next((f for f in (folder / "scans", folder / "input") if f.is_dir()), folder)
    paths = _official(inside.glob("*.ply"), SRB_SHAPES)
    scans = [Scan(path.stem, path, _truth([folder / "ground_truth"], [path.stem], path), layout) for path in paths]
    return Part("srb", folder, tuple(scans), len(SRB_SHAPES), _missing(scans, SRB_SHAPES), with_truth=True)


def scene3d(root: Path) -> Part:
    """Find `input/NAME_1000.{ply, xyz.npy}` and `ground_truth/NAME.ply`."""
    folder = folder_of(root, "3dscene", "scene3d")
    layout = "3dscene/input/NAME_1000.ply, 3dscene/ground_truth/NAME.ply"
    inputs = {
        path.name.removesuffix(ending).removesuffix("_1000"): path
        for ending in (".xyz.npy", ".ply")
        for path in sorted((folder / "input").glob(f"*_1000{ending}"))
    }
    names = sorted(inputs, key=lambda name: (SCENES.index(name) if name in SCENES else len(SCENES), name))
    scans = [
        Scan(name, inputs[name], _truth([folder / "ground_truth"], [name], inputs[name]), layout, in_unit_box=True)
        for name in names
    ]
    return Part("scene3d", folder, tuple(scans), len(SCENES), _missing(scans, SCENES), with_truth=True)


def paris(root: Path) -> Part:
    """Find `rueMadame_database/GT_Madame1_{2,3}.ply`."""
    folder = folder_of(root, "rueMadame_database", "paris")
    layout = "rueMadame_database/GT_Madame1_2.ply with x y z"
    scans = [Scan(path.stem, path, None, layout) for path in _official(folder.glob("*.ply"), STREETS)]
    return Part("paris", folder, tuple(scans), len(STREETS), _missing(scans, STREETS))


def kitti(root: Path, split: str = "training") -> Part:
    """Find `{training,testing}/velodyne/FRAME.bin` of the object benchmark."""
    places = [f"{place}{split}" for place in ("kitti/object/", "kitti/", "KITTI/object/", "KITTI/", "object/", "")]
    folder = folder_of(root, *places)
    layout = f"kitti/object/{split}/velodyne/000000.bin, little-endian float32 x y z reflectance"
    paths = sorted((folder / "velodyne").glob("*.bin"))
    scans = tuple(Scan(path.stem, path, None, layout) for path in paths)
    return Part(split, folder, scans, optional=split != "training")


def pick(part: Part, shape: str | None, how: str) -> Scan:
    """Return a scan by name; None takes the first.

    Args:
        part: What was found.
        shape: Its name.
        how: How to get what is missing, for messages.

    Raises:
        InputError: It is not there, or a list in the folder names it twice.
    """
    if not part.scans:
        raise InputError(absent(part, how))
    found = {scan.name: scan for scan in part.scans}
    name = part.scans[0].name if shape is None else str(shape)
    if name not in found:
        present = ", ".join(list(found)[:8]) + (", ..." if len(found) > 8 else "")
        raise InputError(f"{part.folder}: shape {name!r} is not there; present: {present}; {how}")
    for problem in part.problems:
        if f"{name!r} twice" in problem:
            raise InputError(problem)
    return found[name]


def absent(part: Part, how: str) -> str:
    """Say in one line that a folder or most of it is not there."""
    if part.problems:
        return f"{part.problems[0]}; {how}"
    count = f"{len(part.scans)} of {part.expected} scans" if part.scans else "no scan"
    return f"{part.folder}: {count} found there; {how}"


def read_list(path: Path) -> tuple[list[str], list[str]]:
    """Return the names in a list, one a line, and what is wrong with it."""
    try:
        names = [line.strip() for line in path.read_text().splitlines() if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        return [], [f"{path}: cannot be read as text ({error}); expected one name a line, without extension"]
    twice = sorted({name for name in names if names.count(name) > 1})
    problems = [f"{path}: names {name!r} twice; expected every name once, without extension" for name in twice]
    if not names:
        problems.append(f"{path}: is empty; expected one name a line, without extension")
    outside = [name for name in names if "/" in name or "\\" in name]
    problems += [f"{path}: {name!r} is a path; expected a name without folder and extension" for name in outside]
    return [name for name in names if name not in outside], problems


def folder_of(root: Path, *names: str) -> Path:
    """Return the first of the named folders that exists below the root; if none does, the first one's usual place."""
    places = [root / base / name for base in _BASES for name in names]
    return next((place for place in places if place.is_dir()), places[0])


def folder_with(root: Path, pattern: str, *names: str) -> Path:
    """Return the first of the named folders that holds something of that pattern; if none does, as `folder_of`.

    One benchmark's files may come in several archives, which unpack beside each other.
    """
    places = [root / base / name for base in _BASES for name in names]
    return next((place for place in places if any(place.glob(pattern))), folder_of(root, *names))


def _truth(folders: Iterable[Path], names: Iterable[str], scan: Path) -> Path | None:
    """Return the file of the truth, if there is one beside the scan."""
    names = list(names)
    places = [folder / f"{name}{ending}" for folder in folders for name in names for ending in _TRUTHS]
    return next((place for place in places if place.is_file() and place != scan), None)


def _missing(scans: Iterable[Scan], official: tuple[str, ...]) -> tuple[str, ...]:
    here = {scan.name for scan in scans}
    return tuple(name for name in official if name not in here)


def _official(paths: Iterable[Path], order: tuple[str, ...]) -> list[Path]:
    """Return the files with official names, in official order."""
    found = {path.stem: path for path in paths}
    return [found[name] for name in order if name in found]
