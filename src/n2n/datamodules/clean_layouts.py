"""Where the clean shapes of PU, PC and ShapeNet lie in their official layouts; imports no torch."""

from dataclasses import replace
from pathlib import Path

from n2n.datamodules.layouts import Part, Scan, folder_of, read_list

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
_PU_NOISE = ("0.01", "0.02", "0.03")
_PC_NOISE = ("5.00e-03", "1.00e-02", "2.50e-02")


def punet(root: Path) -> list[Part]:
    """Find the test meshes, and where somebody made them the Poisson-disk clouds and the noisy examples."""
    folder = folder_of(root, "PUNet")
    layout = "PUNet/meshes/test/NAME.off, triangles"
    parts = [_part("meshes", folder / "meshes/test", PU_SHAPES, ".off", Scan("", folder, None, layout, is_mesh=True))]
    for count in _DENSITIES:
        places = {f"{count}_poisson": f"PUNet/pointclouds/test/{count}_poisson"}
        places |= {f"{count}_poisson_{noise}": f"examples/PUNet_{count}_poisson_{noise}" for noise in _PU_NOISE}
        for label, place in places.items():
            like = Scan("", folder, None, f"{place}/NAME.xyz, x y z a line, {count} lines", columns=3, count=count)
            part = _part(label, folder.parent / place, PU_SHAPES, ".xyz", like, optional=True)
            parts.append(_with_truth(part, parts[0]))
    return parts


def pcnet(root: Path) -> list[Part]:
    """Find the clean test clouds and their noisy twins."""
    folder = folder_of(root, "PCNet", "pointCleanNetDataset")
    parts = []
    for label, noise in [("clean", ""), *((f"noise {level}", f"_noise_white_{level}") for level in _PC_NOISE)]:
        ending = f"100k{noise}.xyz"
        layout = f"PCNet/NAME{ending}, x y z a line, 100000 lines"
        like = Scan("", folder, None, layout, count=100_000)
        part = _part(label, folder, PC_SHAPES, ending, like, optional=bool(noise))
        parts.append(_with_truth(part, parts[0]) if parts else part)
    return parts


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


def _with_truth(part: Part, truths: Part) -> Part:
    """Return the part with what is known of each shape beside it, so that both are seen to lie in one frame."""
    known = {scan.name: scan.path for scan in truths.scans}
    return replace(part, scans=tuple(replace(scan, truth=known.get(scan.name)) for scan in part.scans))
