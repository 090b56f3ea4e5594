"""The benchmarks: what they are, where they come from, how their folders look. Imports no torch."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from n2n.datamodules import clean_layouts, layouts
from n2n.datamodules.layouts import Part
from n2n.errors import ConfigError
from n2n.registry import suggest

_P2S = "https://www.cg.tuwien.ac.at/research/publications/2020/erler-2020-p2s/erler-2020-p2s-"
_AVG = "https://s3.eu-central-1.amazonaws.com/avg-projects/"
_NUAGE = "https://nuage.lix.polytechnique.fr/index.php/s/"


class Link(NamedTuple):
    """An archive that can be downloaded without registration.

    Attributes:
        url: Its address.
        file: What to call it here.
        folder: Where it unpacks to, below the data folder.
        note: What it is.
        brings_truth: Whether it brings all there is; False: the scans without their ground truth.
    """

    url: str
    file: str
    folder: str
    note: str
    brings_truth: bool = True


@dataclass(frozen=True)
class Dataset:
    """A benchmark.

    Attributes:
        name: As in the registry of data modules.
        title: One line.
        licence: Who owns it and what is allowed.
        layout: The folders the loaders read, below the data folder.
        find: Data folder -> its parts, present or not.
        links: What `n2n data fetch` downloads.
        steps: What only a person can do: registration, Google Drive.
    """

    name: str
    title: str
    licence: str
    layout: str
    find: Callable[[Path], list[Part]]
    links: tuple[Link, ...] = ()
    steps: tuple[str, ...] = ()

    def how(self) -> str:
        """Say in a few words how to get it."""
        return f"get it with `n2n data fetch {self.name}`"


DATASETS = (
    Dataset(
        "pu",
        "PU-Net test shapes: 20 meshes, Poisson-disk clouds",
        "research use; the meshes belong to their authors (AIM@SHAPE, Stanford, ...)",
        "PUNet/meshes/test/NAME.off, PUNet/pointclouds/test/{10000,50000}_poisson/NAME.xyz, "
        "examples/PUNet_{10000,50000}_poisson_{0.01,0.02,0.03}/NAME.xyz",
        clean_layouts.punet,
        steps=(
            "open https://drive.google.com/drive/folders/1--MvLnP7dsBgBZiu46H0S32Y1eBa_j6P (score-denoise)",
            "download data.zip and unpack it in {folder}: it brings data/PUNet and data/examples",
            "meshes alone: https://drive.google.com/file/d/1lp2HWU78tx_-tz8cxE8PSxb-M7ZQCMOq/view (PU-Net), put the "
            "20 test files *.off into {folder}/PUNet/meshes/test; `n2n data prepare pu` then makes the clouds",
        ),
    ),
    Dataset(
        "pc",
        "PointCleanNet test shapes: 10 clouds of 100,000 points, without and with noise",
        "research use; cite PointCleanNet (Rakotosaona et al. 2020)",
        "PCNet/NAME100k.xyz, PCNet/NAME100k_noise_white_{2.50e-03,5.00e-03,1.00e-02,1.50e-02,2.50e-02}.xyz (or "
        "pointCleanNetDataset/...), PCNet/meshes/NAME.off; or as pu, with PCNet in place of PUNet",
        clean_layouts.pcnet,
        (
            Link(
                f"{_NUAGE}3ZcFtqKm6Z27ZJ6/download", "pointCleanNetDataset.archive", "", "clouds of the denoising task"
            ),
            Link(f"{_NUAGE}9CrHe259zaJEMb8/download", "pointCleanNetMeshes.archive", "PCNet/meshes", "meshes, for P2M"),
        ),
    ),
    Dataset(
        "shapenet",
        "ShapeNet as in Occupancy Networks: 13 classes, 100,000 surface points each",
        "ShapeNet terms of use: research only, registration at shapenet.org",
        "ShapeNet/CLASS/test.lst, ShapeNet/CLASS/ID/pointcloud.npz (points, normals, loc, scale)",
        clean_layouts.shapenet,
        (Link(f"{_AVG}occupancy_networks/data/dataset_small_v1.1.zip", "dataset_small_v1.1.zip", "", "73.4 GB"),),
    ),
    Dataset(
        "abc",
        "ABC of Points2Surf: 100 CAD shapes, simulated range scans",
        "ABC: each model belongs to its author (Onshape public domain terms)",
        "{abc,abc_noisefree,abc_extra_noisy}/{testset.txt,04_pts/NAME.xyz.npy,03_meshes/NAME.ply}",
        lambda root: [layouts.points2surf(root, variant) for variant in layouts.ABC],
        (Link(f"{_P2S}abc.zip", "erler-2020-p2s-abc.zip", "", "test sets of ABC"),),
    ),
    Dataset(
        "famous",
        "FAMOUS of Points2Surf: 22 well-known shapes, simulated range scans",
        "research use; the meshes belong to their authors (Stanford, AIM@SHAPE, ...)",
        "famous_{original,noisefree,dense,sparse,extra_noisy}/{testset.txt,04_pts/NAME.xyz.npy,03_meshes/NAME.ply}",
        lambda root: [layouts.points2surf(root, variant) for variant in layouts.FAMOUS],
        (Link(f"{_P2S}famous.zip", "erler-2020-p2s-famous.zip", "", "all FAMOUS sets"),),
    ),
    Dataset(
        "dfaust",
        "D-FAUST human scans: the five of SAP, or raw scans",
        "MPI licence: non-commercial research, registration at dfaust.is.tue.mpg.de",
        "dfaust/NAME.ply (SAP) or dfaust/scans/SUBJECT/ACTION/ACTION.FRAME.ply (raw), dfaust/ground_truth/NAME.ply",
        lambda root: [layouts.dfaust(root)],
        (
            Link(
                f"{_AVG}shape_as_points/data/optim_data.zip",
                "optim_data.zip",
                "",
                "the selection of SAP, 200 MB",
                False,
            ),
        ),
        (
            "raw scans: register at http://dfaust.is.tue.mpg.de and accept the licence",
            "download the scans and unpack them so that {folder}/dfaust/scans/50002/ACTION/ACTION.000001.ply exists",
            "ground truth comes with neither: put a clean mesh of each scan at {folder}/dfaust/ground_truth/NAME.ply",
        ),
    ),
    Dataset(
        "srb",
        "Surface Reconstruction Benchmark: 5 simulated range scans",
        "research use; cite Berger et al. 2013 and Williams et al. 2019 (Deep Geometric Prior)",
        "srb/scans/NAME.ply, srb/ground_truth/NAME.xyz (or deep_geometric_prior_data/...)",
        lambda root: [layouts.srb(root)],
        (Link(f"{_AVG}shape_as_points/data/optim_data.zip", "optim_data.zip", "", "the copy of SAP, 200 MB", False),),
        (
            "dense ground truth: https://drive.google.com/file/d/1PVzQ-kTrQwkEqwQg3weSMMlpx2RLRrUq/view (1.12 GB)",
            "unpack it in {folder}: it brings deep_geometric_prior_data/{{scans,ground_truth}}",
        ),
    ),
    Dataset(
        "scene3d",
        "3D Scene of Zhou and Koltun: indoor scans, 1000 points per square metre",
        "research use; cite Zhou and Koltun 2013",
        "3dscene/input/NAME_1000.ply, 3dscene/ground_truth/NAME.ply",
        lambda root: [layouts.scene3d(root)],
        steps=(
            "open https://drive.google.com/file/d/1BNzmd_OX0s4lxta3FFeRWRYwfGQOALS_/view (processed data of CAP-UDF)",
            "unpack it in {folder}: it brings data/3dscene/input and data/3dscene/ground_truth (and data/srb)",
        ),
    ),
    Dataset(
        "paris",
        "Paris-rue-Madame: 160 m of street, mobile laser scanner, 20 million points",
        "MINES ParisTech: research use; cite Serna et al. 2014",
        "rueMadame_database/{GT_Madame1_2,GT_Madame1_3}.ply with x y z",
        lambda root: [layouts.paris(root)],
        steps=(
            "open http://cmm.ensmp.fr/~serna/rueMadameDataset.html and ask for the data as described there",
            "unpack it so that {folder}/rueMadame_database/GT_Madame1_2.ply exists",
        ),
    ),
    Dataset(
        "kitti",
        "KITTI object benchmark: frames of a rotating laser scanner",
        "CC BY-NC-SA 3.0, registration at cvlibs.net",
        "kitti/object/{training,testing}/velodyne/000000.bin, float32 x y z reflectance",
        lambda root: [layouts.kitti(root, split) for split in ("training", "testing")],
        steps=(
            "register at https://www.cvlibs.net/datasets/kitti/eval_object.php?obj_benchmark=3d",
            "download `Velodyne point clouds` (29 GB) and unpack it in {folder}/kitti/object",
        ),
    ),
)


def dataset(name: str) -> Dataset:
    """Return a benchmark by name.

    Raises:
        ConfigError: Unknown name, with the nearest known one.
    """
    known = {entry.name: entry for entry in DATASETS}
    if name not in known:
        raise ConfigError(f"Unknown dataset {name!r}.{suggest(name, list(known))}")
    return known[name]
