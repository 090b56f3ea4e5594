"""Where the clean shapes of PU, PC and ShapeNet lie in their official layouts; imports no torch."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from n2n.datamodules.layouts import Part, Scan, folder_of, folder_with, read_list

PU_SHAPES = (
    *("Icosahedron", "Octahedron", "camel", "casting", "chair", "coverrear_Lp", "cow", "duck", "eight", "elephant"),
    *("elk", "fandisk", "genus3", "horse", "kitten", "moai", "pig", "quadric", "sculpt", "star"),
)
PC_SHAPES = (
    *("cylinder", "galera", "netsuke", "boxunion2", "box_push", "dragon", "icosahedron", "happy", "column_head"),
    "star_smooth",
)
SHAPENET_CLASSES = (
    *("02691156", "02828884", "02933112", "02958343", "03001627", "03211117", "03636649", "03691459", "04090263"),
    *("04256520", "04379243", "04401088", "04530566"),
)
_UNIT_CUBE = 1.1  # half precision, and meshes that were closed, reach a little beyond 1
_DENSITIES = (10_000, 50_000)
_NOISE = ("0.01", "0.02", "0.03")
_PC_NOISE = ("2.50e-03", "5.00e-03", "1.00e-02", "1.50e-02", "2.50e-02")
_MESHES = (".off", ".ply", ".obj")


def punet(root: Path) -> list[Part]:
    """Find the meshes, then clean clouds and noisy examples of score-denoise."""
    folder = folder_with(root, "meshes/test/*.off", "PUNet")
    layout = "PUNet/meshes/test/NAME.off, triangles"
    meshes = _part("meshes", folder / "meshes/test", PU_SHAPES, ".off", Scan("", folder, None, layout, is_mesh=True))
    return [meshes, *(_with_truth(part, [meshes, clean]) for part, clean in _poisson(root, "PUNet", PU_SHAPES))]


def pcnet(root: Path) -> list[Part]:
    """Find the clean test clouds, their noisy twins and meshes, then clouds and examples of score-denoise."""
    folder = folder_with(root, "*100k.xyz", "PCNet", "pointCleanNetDataset")
    parts = []
    for label, noise in [("clean", ""), *((f"noise {level}", f"_noise_white_{level}") for level in _PC_NOISE)]:
        ending = f"100k{noise}.xyz"
        layout = f"PCNet/NAME{ending}, x y z a line, 100000 lines"
        like = Scan("", folder, None, layout, count=100_000)
        part = _part(label, folder, PC_SHAPES, ending, like, optional=bool(noise))
        parts.append(_with_truth(part, parts[:1]))
    return [
        *parts,
        _pc_meshes(root),
        *(_with_truth(part, [clean]) for part, clean in _poisson(root, "PCNet", PC_SHAPES)),
    ]


def poisson_folder(root: Path, name: str) -> Path:
    """Return the folder of score-denoise's files, PUNet or PCNet; `examples` lies beside it."""
    return folder_with(root, "pointclouds/test/*_poisson/*.xyz", name)


def is_clean(label: str) -> bool:
    """Tell parts of clean clouds from those of meshes and noisy clouds."""
    return label == "clean" or label.endswith("_poisson")


def together(parts: Iterable[Part], order: tuple[str, ...]) -> Part:
    """Return every shape once, in order, with the file of the first part that has it."""
    parts = list(parts)
    found = {scan.name: scan for part in reversed(parts) for scan in part.scans}
    first = next((part for part in parts if part.scans), parts[0])
    return replace(first, scans=tuple(found[name] for name in order if name in found))


def shapenet(root: Path) -> list[Part]:
    """Find the test shapes of every class."""
    folder = folder_of(root, "ShapeNet")
    parts = []
    for label in SHAPENET_CLASSES:
        layout = f"ShapeNet/{label}/ID/pointcloud.npz with points and normals (100000, 3), ShapeNet/{label}/test.lst"
        place = folder / label
        names, problems = read_list(place / "test.lst") if (place / "test.lst").is_file() else ([], [])
        if place.is_dir() and not names and not problems:
            problems = [f"{place / 'test.lst'}: is missing; expected {layout}"]
        like = Scan("", place, None, layout, columns=6, count=100_000, largest=_UNIT_CUBE)
        part = _part(label, place, tuple(dict.fromkeys(names)), "/pointcloud.npz", like)
        parts.append(replace(part, expected=part.expected or None, problems=tuple(problems)))
    return parts


def _part(label: str, folder: Path, names: tuple[str, ...], ending: str, like: Scan, optional: bool = False) -> Part:
    """Return the part whose files are NAME + ending; the scans are like `like`."""
    paths = {name: folder / f"{name}{ending}" for name in names}
    scans = tuple(replace(like, name=name, path=path) for name, path in paths.items() if path.is_file())
    absent = tuple(name for name, path in paths.items() if not path.is_file())
    return Part(label, folder, scans, len(names), absent, optional=optional)


def _poisson(root: Path, name: str, shapes: tuple[str, ...]) -> list[tuple[Part, Part]]:
    """Find `NAME/pointclouds/test/COUNT_poisson` and `examples/NAME_COUNT_poisson_NOISE`, official ones and others.

    Returns:
        Each part, labelled COUNT_poisson or COUNT_poisson_NOISE, and the part of the clean clouds of that density.
    """
    folder = poisson_folder(root, name)
    clouds, examples = folder / "pointclouds/test", folder.parent / "examples"
    there = {path.name.removesuffix("_poisson") for path in clouds.glob("*_poisson")}
    parts = []
    for count in sorted({*_DENSITIES, *(int(text) for text in there if text.isdecimal())}):

        def part(label: str, place: Path, count: int = count) -> Part:
            layout = f"{place.relative_to(folder.parent)}/NAME.xyz, x y z a line, {count} lines"
            like = Scan("", folder, None, layout, columns=3, count=count)
            return _part(label, place, shapes, ".xyz", like, optional=True)

        clean = part(f"{count}_poisson", clouds / f"{count}_poisson")
        prefix = f"{name}_{count}_poisson_"
        levels = {_level(path.name.removeprefix(prefix)): path for path in sorted(examples.glob(f"{prefix}*"))}
        levels = {level: examples / f"{prefix}{level}" for level in _NOISE} | levels
        noisy = [part(f"{count}_poisson_{level}", place) for level, place in levels.items() if level]
        parts += [(found, clean) for found in (clean, *noisy)]
    return parts


def _level(text: str) -> str:
    """Return a folder's noise level as `:g` writes it; empty if it is none."""
    try:
        return f"{float(text):g}"
    except ValueError:
        return ""


def _pc_meshes(root: Path) -> Part:
    """Find NAME.{off,ply,obj} anywhere below `meshes`: the archive's own folders are not known."""
    folder = folder_with(root, "meshes/*", "PCNet", "pointCleanNetDataset") / "meshes"
    found = {path.stem: path for path in sorted(folder.rglob("*"), reverse=True) if path.suffix.lower() in _MESHES}
    like = Scan("", folder, None, "PCNet/meshes/NAME.off, triangles", is_mesh=True)
    scans = tuple(replace(like, name=name, path=found[name]) for name in PC_SHAPES if name in found)
    absent = tuple(name for name in PC_SHAPES if name not in found)
    return Part("meshes", folder, scans, len(PC_SHAPES), absent, optional=True)


def _with_truth(part: Part, truths: Iterable[Part]) -> Part:
    """Return the part with what is known of each shape beside it, so that both are seen to lie in one frame."""
    known = {scan.name: scan.path for truth in reversed(list(truths)) for scan in truth.scans}
    truth = {scan.path: known.get(scan.name) for scan in part.scans}
    scans = (replace(scan, truth=None if truth[scan.path] == scan.path else truth[scan.path]) for scan in part.scans)
    return replace(part, scans=tuple(scans))
