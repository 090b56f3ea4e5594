"""The command line as people use it: a mistake is one line and changes nothing; the main jobs do what is promised."""

import csv
import json
import re
import signal
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import SimpleNamespace

import laspy
import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import cKDTree

from n2n.cli import doctor
from n2n.cli.main import main
from n2n.formats import files, read_cloud
from n2n.tasks.field import Field

QUICK = "iterations=20"
UTM = np.array([5e5, 5e6, 100.0])
PNG = b"\x89PNG\r\n\x1a\n"


def sphere(count: int = 600, seed: int = 0, noise: float = 0.02) -> np.ndarray:
    random = np.random.default_rng(seed)
    points = random.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True) + noise * random.normal(size=(count, 3))


def off_surface(points: np.ndarray, centre=(0, 0, 0), radius: float = 1.0) -> float:
    """Return the mean distance to the sphere."""
    return float(np.abs(np.linalg.norm(points - np.asarray(centre), axis=1) - radius).mean())


def listing(folder: Path) -> dict[str, bytes | None]:
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    """Small fits on a busy machine wait for threads most of the time; with one, equal seeds give equal bytes, too."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def n2n(tmp_path, monkeypatch, capsys):
    """Run a command in an empty folder that holds scan.xyz; return exit code, standard output and standard error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("N2N_TRACEBACK", raising=False)
    np.savetxt("scan.xyz", sphere(), fmt="%.7f")

    def run(*arguments: str) -> tuple[int, str, str]:
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        return code, *capsys.readouterr()

    return run


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    """A finished run of a sphere around (500000, 5000000, 100), radius 40."""
    folder = tmp_path_factory.mktemp("fitted")
    np.savetxt(folder / "utm.xyz", 40 * sphere() + UTM, fmt="%.6f")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["fit", "datamodule=files", "datamodule.paths=[utm.xyz]", QUICK]) == 0
    (run,) = (folder / "runs").iterdir()
    return run


BAD_FILES = {
    "empty.ply": b"",
    "few.xyz": sphere(99),
    "equal.xyz": np.ones((300, 3)),
    "line.xyz": np.outer(np.arange(300.0), [1, 2, 3]),
    "rounded_line.xyz": np.outer(np.linspace(0, 1, 300), [1, 2, 3]).astype(np.float32),
    "repeated.xyz": np.tile(sphere(50), (3, 1)),
    "gaps.xyz": np.vstack([sphere(99), np.full((500, 3), np.nan)]),
    "nothing.xyz": np.full((300, 3), np.inf),
    "text.ply": b"1 2 3\n4 5 6\n",
    "words.xyz": b"1 2 3\n4 five 6\n",
    "flat.xyz": b"1 2\n3 4\n",
    "rubbish.xyz": np.random.default_rng(0).bytes(5000),
    "rubbish.ply": np.random.default_rng(1).bytes(5000),
    "rubbish.laz": np.random.default_rng(2).bytes(5000),
    "cut.ply": b"ply\nformat ascii 1.0\nelement vertex 9\n"
    + b"".join(b"property float %c\n" % c for c in b"xyz")
    + b"end_header\n",
    "none.off": b"OFF\n0 0 0\n",
    "none.obj": b"# nothing\n",
    "none.stl": b"solid none\nendsolid none\n",
    "picture.jpg": b"\xff\xd8\xff",
    "noextension": b"1 2 3\n",
    "other/scan.xyz": sphere(),
    "broken_run/field.ckpt": b"no field",
    "alien_run/field.ckpt": None,
}
DENOISE = ("denoise", "scan.xyz", "-o", "out.xyz")
MESH = ("reconstruct", "scan.xyz", "-o", "out.ply")

BAD_REQUESTS = [
    (("denoise", "empty.ply", "-o", "out.xyz"), "empty.ply: the file is empty"),
    (("denoise", "few.xyz", "-o", "out.xyz"), "few.xyz: 99 points are too few for a surface; at least 100 are needed"),
    (("upsample", "equal.xyz", "-o", "out.xyz"), "equal.xyz: all 300 points are equal"),
    (("reconstruct", "line.xyz", "-o", "out.ply"), "line.xyz: all points lie on one line"),
    (("reconstruct", "rounded_line.xyz", "-o", "out.ply"), "rounded_line.xyz: all points lie on one line"),
    (("denoise", "repeated.xyz", "-o", "out.xyz"), "only 50 of 150 points are distinct; at least 100 are needed"),
    (("denoise", "gaps.xyz", "-o", "out.xyz"), "gaps.xyz (without 500 NaN or infinite rows): 99 points are too few"),
    (("denoise", "nothing.xyz", "-o", "out.xyz"), "nothing.xyz (without 300 NaN or infinite rows): 0 points are too"),
    (("denoise", "text.ply", "-o", "out.xyz"), "text.ply: does not start with 'ply'"),
    (("denoise", "words.xyz", "-o", "out.xyz"), "words.xyz: line 2 is not numbers"),
    (("denoise", "flat.xyz", "-o", "out.xyz"), "flat.xyz: 2 column(s) found, at least x y z are needed"),
    (("denoise", "rubbish.xyz", "-o", "out.xyz"), "rubbish.xyz: is not text"),
    (("denoise", "rubbish.ply", "-o", "out.xyz"), "rubbish.ply: does not start with 'ply'"),
    (("denoise", "rubbish.laz", "-o", "out.xyz"), "rubbish.laz: is not a readable laz file"),
    (("denoise", "cut.ply", "-o", "out.xyz"), "cut.ply: the header promises 9"),
    (("denoise", "none.off", "-o", "out.xyz"), "none.off: holds no points"),
    (("denoise", "none.obj", "-o", "out.xyz"), "none.obj: holds no vertices"),
    (("denoise", "none.stl", "-o", "out.xyz"), "none.stl: holds no triangles"),
    (("denoise", "picture.jpg", "-o", "out.xyz"), "picture.jpg: unknown file type '.jpg'"),
    (("denoise", "noextension", "-o", "out.xyz"), "noextension: unknown file type"),
    (("denoise", "other", "-o", "out.xyz"), "other: is a folder; give a point cloud file"),
    (("denoise", "none.xyz", "-o", "out.xyz"), "none.xyz: no such file"),
    # The first input is sound; the second is looked at before the fit, too.
    (("denoise", "scan.xyz", "few.xyz", "-o", "clean/"), "few.xyz: 99 points are too few"),
    (("denoise", "scan.xyz", "iterations", "-o", "out.xyz"), "iterations: no such file"),
    (("denoise", "-o", "out.xyz"), "no input file given; e.g. n2n denoise scan.ply -o ..."),
    # Outputs.
    (("denoise", "scan.xyz"), "the following arguments are required: -o/--output; see `n2n denoise --help`"),
    (("denoise", "few.xyz", "-o", "none/out.xyz"), "few.xyz: 99 points are too few"),
    (("denoise", "scan.xyz", "-o", "none/out.docx"), "none/out.docx: cannot write files ending in '.docx'"),
    (("denoise", "scan.xyz", "-o", "noextension/out.xyz"), "noextension is a file, not a folder"),
    (("denoise", "scan.xyz", "-o", "out.docx"), "out.docx: cannot write files ending in '.docx'"),
    (("denoise", "scan.xyz", "-o", "out.bin"), "out.bin: cannot write files ending in '.bin'"),
    (("reconstruct", "scan.xyz", "-o", "out.xyz"), "out.xyz: cannot write files ending in '.xyz'"),
    (("denoise", "scan.xyz", "-o", "out"), "out: cannot write files ending in 'nothing'"),
    (("denoise", "scan.xyz", "-o", "scan.xyz"), "scan.xyz: is an input; choose another name or folder with -o"),
    (("denoise", "scan.xyz", "-o", "other/../scan.xyz"), "scan.xyz: is an input"),
    (("denoise", "scan.xyz", "-o", "link.xyz"), "link.xyz: is an input"),
    (("denoise", "scan.xyz", "-o", "."), "scan.xyz: is an input"),
    (("denoise", "scan.xyz", "other/scan.xyz", "-o", "clean/"), "clean: two inputs have the same file name"),
    (("denoise", "scan.xyz", "-o", "noextension/"), "noextension is a file, not a folder"),
    (("denoise", "scan.xyz", "-o", "noextension/deeper/"), "noextension is a file, not a folder"),
    ((*DENOISE, "--preview", "out.jpg"), "out.jpg: cannot write files ending in '.jpg'"),
    ((*DENOISE, "--preview", "none/out.png"), "none/out.png: the folder none does not exist"),
    (("demo", "-o", "scan.xyz"), "scan.xyz"),
    # Settings.
    ((*DENOISE, "iteration=5"), "Unknown configuration key 'iteration'. Did you mean 'iterations'?"),
    ((*DENOISE, "distance=emdd"), "Unknown distance 'emdd'. Did you mean 'emd'?"),
    ((*DENOISE, "architecture.name=gird"), "Unknown architecture 'gird'. Did you mean 'grid'?"),
    ((*DENOISE, "terms.zero_levl.weight=1"), "Unknown regulariser 'zero_levl'. Did you mean 'zero_level'?"),
    ((*DENOISE, "distance.pp=1"), "distance 'emd' has no argument 'pp'. Did you mean 'p'?"),
    ((*DENOISE, "recipe=papper"), "Unknown recipe 'papper'. Did you mean 'paper'?"),
    ((*DENOISE, "iterations=0"), "iterations=0 is out of range"),
    ((*DENOISE, "iterations=soon"), "iterations=soon is not a number"),
    ((*DENOISE, "seed=0,1"), "'seed=0,1' gives several values where one is needed"),
    ((*DENOISE, "seed=[1"), "cannot read the setting 'seed=[1'"),
    ((*DENOISE, "--seed", "-1"), "seed=-1 is out of range"),
    ((*DENOISE, "--seed", "99999999999999999999"), "is out of range; give a whole number from 0 to 2147483647"),
    ((*DENOISE, "seed=2147483648"), "seed=2147483648 is out of range; give a whole number from 0 to 2147483647"),
    (("denoise", "scan.xyz", "-o", "out.xyz", "--run", "none", "--seed", "-1"), "seed=-1 is out of range"),
    ((*DENOISE, "iterations=null"), "iterations=null is not a number"),
    ((*DENOISE, "plan_reuse=null"), "plan_reuse=null is not a number"),
    ((*DENOISE, f"distance={'x' * 300}"), "Unknown distance 'xxx"),
    ((*DENOISE, "--seed", "one"), "argument --seed: invalid int value: 'one'"),
    ((*DENOISE, "--device", "gpu"), "argument --device: invalid choice: 'gpu'"),
    # Numbers.
    ((*MESH, "--resolution", "7"), "--resolution 7 is out of range; give 8 to 2048 voxels"),
    ((*MESH, "--resolution", "2049"), "--resolution 2049 is out of range; give 8 to 2048 voxels"),
    ((*MESH, "--resolution", "fine"), "argument --resolution: invalid int value: 'fine'"),
    ((*MESH, "--edge", "0"), "--edge 0.0 is out of range; give a positive length in the scan's units"),
    ((*MESH, "--edge", "-1"), "--edge -1.0 is out of range"),
    ((*MESH, "--edge", "nan"), "--edge nan is out of range"),
    ((*MESH, "--edge", "inf"), "--edge inf is out of range"),
    ((*MESH, "--edge", "1"), "--edge 1 makes 2.03 voxels along the longest side"),
    ((*MESH, "--edge", "1e-9"), "--edge 1e-09 makes"),
    ((*MESH, "--edge", "short"), "argument --edge: invalid float value: 'short'"),
    (("upsample", "scan.xyz", "-o", "out.xyz", "--rate", "0"), "--rate 0 is out of range; give 1 or more"),
    (("upsample", "scan.xyz", "-o", "out.xyz", "--rate", "-4"), "--rate -4 is out of range"),
    (("upsample", "scan.xyz", "-o", "out.xyz", "--rate", "1.5"), "argument --rate: invalid int value: '1.5'"),
    # Flags and commands.
    ((*MESH, "--resolutoin", "64"), "does not know the argument '--resolutoin'. Did you mean '--resolution'?"),
    ((*DENOISE, "--rate", "4"), "n2n denoise does not know the argument '--rate'"),
    ((*MESH, "-x"), "n2n reconstruct does not know the argument '-x'"),
    (("doctor", "scan.xyz"), "n2n doctor does not know the argument 'scan.xyz'"),
    (("reconstrcut", "scan.xyz"), "Unknown command 'reconstrcut'. Did you mean 'reconstruct'?"),
    (
        (),
        "no command given; choose one of: reconstruct, denoise, upsample, fit, sweep, evaluate, data, tables, figure, "
        "dashboard, demo, list, doctor",
    ),
    (("list", "distanse"), "Unknown kind 'distanse'. Did you mean 'distance'?"),
    # Runs.
    (("reconstruct", "--run", ".", "-o", "out.ply"), ". holds no finished run (field.ckpt is missing)"),
    (("reconstruct", "--run", "none", "-o", "out.ply"), "none holds no finished run"),
    (("reconstruct", "--run", "broken_run", "-o", "out.ply"), "cannot be read as an n2n field"),
    (("reconstruct", "--run", "alien_run", "-o", "out.ply"), "cannot be read as an n2n field"),
    (("denoise", "--run", ".", "-o", "out.xyz"), "no input file given"),
    ((*MESH, "--run", ".", "seed=1"), "seed=1 has no effect on a finished run"),
    ((*MESH, "--run", ".", "--quality", "best"), "--quality best has no effect on a finished run"),
    ((*MESH, "--quality", "ultra"), "invalid choice: 'ultra'"),
    ((*DENOISE, "--shape", "1"), "--shape 1 chooses a shape of a run; give the run with --run"),
    # n2n fit.
    (("fit", "distance=emdd"), "Unknown distance 'emdd'. Did you mean 'emd'?"),
    (("fit", "iteration=5"), "Unknown configuration key 'iteration'. Did you mean 'iterations'?"),
    (("fit", "--multirum"), "n2n fit: unrecognized arguments: --multirum. Did you mean '--multirun'?"),
    (("fit", "seed=0,1"), "'seed=0,1' gives several values where one is needed"),
    (("fit", "-m", "seed=0,one"), "seed=one: Value 'one' of type 'str' could not be converted to Integer"),
    (("fit", "datamodule=files"), "datamodule.paths is not set; give it as datamodule.paths=..."),
    (("fit", "datamodule=files", "datamodule.paths=[none.xyz]"), "none.xyz: no such file"),
    (("fit", "datamodule=files", "datamodule.paths=[few.xyz]"), "few.xyz: 99 points are too few"),
]


@pytest.fixture
def bad_files(n2n, tmp_path):
    """The folder also holds whatever can be wrong with an input."""
    for name, content in BAD_FILES.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        if isinstance(content, np.ndarray):
            np.savetxt(path, content)
        elif content is not None:
            path.write_bytes(content)
    torch.save({"weights": {}}, tmp_path / "alien_run" / "field.ckpt")
    (tmp_path / "link.xyz").symlink_to(tmp_path / "scan.xyz")
    return tmp_path


@pytest.mark.parametrize(("words", "expected"), BAD_REQUESTS, ids=[" ".join(words) for words, _ in BAD_REQUESTS])
def test_a_mistake_is_one_line_and_changes_nothing(n2n, bad_files, words, expected):
    before = listing(bad_files)
    code, out, error = n2n(*words)
    assert code == 2
    assert error.startswith("n2n: error: ") and error.count("\n") == 1 and error.endswith("\n")
    assert expected in error
    assert "Traceback" not in error and out == ""
    assert listing(bad_files) == before


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a folder that nobody can write to")
@pytest.mark.parametrize("target", ["/proc/out.xyz", "/proc/", "/proc/none/out.xyz", "/proc/none/"])
def test_an_unwritable_place_is_found_before_the_fit(n2n, tmp_path, target):
    code, _, error = n2n("denoise", "scan.xyz", "-o", target)
    assert code == 2 and error.count("\n") == 1 and "cannot write there" in error
    assert list(tmp_path.iterdir()) == [tmp_path / "scan.xyz"]


@pytest.mark.skipif(torch.cuda.is_available(), reason="needs a machine without CUDA")
def test_a_missing_device_is_found_before_the_fit(n2n, tmp_path):
    code, _, error = n2n(*DENOISE, "--device", "cuda")
    assert code == 2 and error.startswith("n2n: error: ") and error.count("\n") == 1 and "cuda" in error
    assert list(tmp_path.iterdir()) == [tmp_path / "scan.xyz"]


def test_the_installed_program_fails_in_one_line_and_works_without_warnings(n2n, tmp_path):
    """Once for real: nothing that a library prints reaches the screen."""

    def program(*arguments):
        command = [sys.executable, "-m", "n2n.cli.main", *arguments]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    (tmp_path / "cut.laz").write_bytes(b"LASF" + bytes(3000))
    failed = program("denoise", "cut.laz", "-o", "out.xyz")
    assert failed.returncode == 2
    assert failed.stderr.startswith("n2n: error: cut.laz: is not a readable laz file")
    assert failed.stderr.count("\n") == 1 and failed.stdout == ""
    worked = program("denoise", "scan.xyz", "-o", "out.xyz", QUICK)
    assert worked.returncode == 0 and worked.stdout == ""
    assert [line.split()[0] for line in worked.stderr.splitlines()] == ["fitting", "600", "denoise:"]


def test_an_unforeseen_error_is_told_as_such(n2n, tmp_path, monkeypatch):
    def fail(*_):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(Field, "denoise", fail)
    code, _, error = n2n(*DENOISE, QUICK, "-q")
    assert code == 3
    assert error.startswith("n2n: error: ZeroDivisionError at cli/work.py:") and error.count("\n") == 1
    assert "please report it with what N2N_TRACEBACK=1 prints" in error
    assert list(tmp_path.iterdir()) == [tmp_path / "scan.xyz"]


def test_interrupting_leaves_nothing(n2n, tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Field, "denoise", stop)
    code, _, error = n2n(*DENOISE, QUICK, "-q")
    assert code == 130 and error == "n2n: interrupted; no unfinished file was left\n"
    assert list(tmp_path.iterdir()) == [tmp_path / "scan.xyz"]


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.skipif(sys.platform == "win32", reason="sends signals")
def test_an_impatient_second_interruption_changes_nothing(name, tmp_path):
    program = f"""
import os, signal, sys
from n2n.cli import main as module

def wait(_):
    os.kill(os.getpid(), signal.{name})

def tell(advice=""):
    os.kill(os.getpid(), signal.{name})
    print("told")
    return 130

module._dispatch, module._interrupted = wait, tell
sys.argv = ["n2n", "list"]
sys.exit(module.main())
"""
    stopped = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (stopped.returncode, stopped.stdout, stopped.stderr) == (130, "told\n", "")


def test_a_caller_keeps_its_own_interruptions(n2n, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr("n2n.cli.main._dispatch", stop)
    assert n2n("list")[0] == 130 and signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize("target", ["new/deeper/out.xyz", "new/deeper/"])
def test_missing_folders_are_made(n2n, target):
    code, _, _ = n2n("denoise", "scan.xyz", "-o", target, "--preview", "new/deeper/picture.png", QUICK, "-q")
    assert code == 0
    name = "scan.xyz" if target.endswith("/") else "out.xyz"
    assert {path.name for path in Path("new/deeper").iterdir()} == {name, "picture.png"}


@pytest.mark.parametrize("target", ["new/deeper/out.xyz", "new/deeper/"])
def test_a_fit_that_fails_makes_no_folder(n2n, tmp_path, monkeypatch, target):
    def fail(*_):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(Field, "denoise", fail)
    assert n2n("denoise", "scan.xyz", "-o", target, QUICK, "-q")[0] == 3
    assert list(tmp_path.iterdir()) == [tmp_path / "scan.xyz"]


def test_labels_that_are_texts_come_back(n2n):
    rows = [f"{x},{y},{z},{label}" for (x, y, z), label in zip(sphere().round(6), ["wall", "roof"] * 300, strict=True)]
    Path("labels.csv").write_text("x,y,z,label\n" + "\n".join(rows) + "\n")
    assert n2n("denoise", "labels.csv", "-o", "clean.csv", QUICK, "-q") == (0, "", "")
    lines = Path("clean.csv").read_text().splitlines()
    assert lines[0] == "x,y,z,label" and [line.split(",")[3] for line in lines[1:]] == ["wall", "roof"] * 300
    code, _, error = n2n("denoise", "labels.csv", "-o", "clean.ply", QUICK)
    assert code == 0 and "ply cannot store texts: label left out; write csv or npz to keep them" in error


def test_reconstruct_makes_a_closed_mesh_around_the_sphere(n2n):
    code, out, error = n2n("reconstruct", "scan.xyz", "-o", "mesh.ply", "--resolution", "32", QUICK)
    assert code == 0 and out == "" and "watertight -> mesh.ply" in error
    mesh = trimesh.load("mesh.ply")
    assert mesh.is_watertight and mesh.volume == pytest.approx(4 / 3 * np.pi, rel=0.05)
    assert off_surface(mesh.vertices) < 0.02


def test_edge_is_a_length_in_the_scans_units(n2n):
    code, _, _ = n2n("reconstruct", "scan.xyz", "-o", "mesh.obj", "--edge", "0.2", QUICK, "-q")
    edges = trimesh.load("mesh.obj").edges_unique_length
    assert code == 0 and 0.08 < np.median(edges) < 0.25


def test_denoise_moves_points_in_their_order_onto_the_surface(n2n):
    noisy = np.loadtxt("scan.xyz")
    code, out, error = n2n(*DENOISE, QUICK)
    clean = np.loadtxt("out.xyz")
    assert code == 0 and out == "" and "denoise: 600 points -> out.xyz" in error
    assert clean.shape == noisy.shape and np.linalg.norm(clean - noisy, axis=1).max() < 0.2
    assert off_surface(clean) < 0.9 * off_surface(noisy)


def test_even_spreads_the_points_along_the_surface_in_their_order(run_folder, n2n):
    scan = str(run_folder.parents[1] / "utm.xyz")
    spacing = 40 * np.sqrt(4 * np.pi / 600)
    for flags, rate in ((("denoise",), 1), (("upsample", "--rate", "2"), 2)):
        for name, even in (("plain.xyz", ()), ("even.xyz", ("--even",))):
            assert n2n(*flags, scan, "--run", run_folder, "-o", name, "-q", *even) == (0, "", "")
        plain, spread = np.loadtxt("plain.xyz"), np.loadtxt("even.xyz")
        assert spread.shape == plain.shape == (600 * rate, 3)
        assert np.linalg.norm(spread - plain, axis=1).mean() < spacing and off_surface(spread, UTM, 40) < 0.8
        gaps = [cKDTree(points).query(points, 2)[0][:, 1].mean() / spacing * rate**0.5 for points in (plain, spread)]
        assert gaps[0] < 0.65 and gaps[1] > 0.85  # a hexagonal packing has 1.07


@pytest.mark.parametrize(("quality", "iterations"), [("draft", 64), ("normal", 160)])
def test_quality_decides_how_long_it_takes(n2n, quality, iterations):
    code, _, error = n2n("denoise", "scan.xyz", "-o", "out.xyz", "--quality", quality)
    assert code == 0 and f"{iterations} iterations" in error


def test_even_is_no_flag_of_reconstruct(n2n):
    code, _, error = n2n("reconstruct", "scan.xyz", "-o", "mesh.ply", "--even")
    assert code == 2 and "n2n reconstruct does not know the argument '--even'" in error


def test_the_same_seed_gives_the_same_file(n2n):
    for name, seed in (("a.xyz", "3"), ("b.xyz", "3"), ("c.xyz", "4")):
        assert n2n("denoise", "scan.xyz", "-o", name, "--seed", seed, QUICK, "-q")[0] == 0
    assert Path("a.xyz").read_bytes() == Path("b.xyz").read_bytes() != Path("c.xyz").read_bytes()


def test_quiet_says_nothing_and_settings_may_stand_anywhere(n2n):
    assert n2n("denoise", QUICK, "scan.xyz", "-q", "-o", "out.xyz", "seed=1") == (0, "", "")


def test_denoise_keeps_further_columns_header_and_rows_that_are_not_finite(n2n):
    points = 40 * sphere() + UTM
    points[5], points[599, 1] = np.nan, np.inf
    intensity, label = np.random.default_rng(0).random(600).round(6), np.arange(600) % 7
    table = np.column_stack([label, points, intensity])
    np.savetxt("survey.csv", table, "%.12g", ",", header="label,x,y,z,intensity", comments="")
    code, _, error = n2n("denoise", "survey.csv", "-o", "clean.csv", QUICK)
    assert code == 0 and "survey.csv: 2 of 600 rows are NaN or infinite; they are kept as they are" in error
    assert Path("clean.csv").read_text().startswith("label,x,y,z,intensity\n0,")
    clean = np.loadtxt("clean.csv", delimiter=",", skiprows=1)
    assert np.array_equal(clean[:, 0], label) and np.array_equal(clean[:, 4], intensity)
    np.testing.assert_allclose(clean[[5, 599], 1:4], table[[5, 599], 1:4], rtol=0, atol=1e-6)
    finite = np.isfinite(points).all(axis=1)
    assert np.linalg.norm(clean[finite, 1:4] - points[finite], axis=1).max() < 8
    assert off_surface(clean[finite, 1:4], UTM, 40) < 0.9 * off_surface(points[finite], UTM, 40)


def test_reconstruct_and_upsample_leave_such_rows_out(n2n):
    with Path("scan.xyz").open("a") as file:
        file.write("nan nan nan\n1 inf 2\n")
    code, _, error = n2n("upsample", "scan.xyz", "-o", "dense.xyz", "--rate", "2", QUICK)
    assert code == 0 and "scan.xyz: 2 of 602 rows are NaN or infinite; they are left out" in error
    assert np.loadtxt("dense.xyz").shape == (1200, 3)


def test_duplicates_are_told_and_kept(n2n):
    np.savetxt("twice.xyz", np.repeat(sphere(), 2, axis=0))
    code, _, error = n2n("denoise", "twice.xyz", "-o", "out.xyz", QUICK)
    assert code == 0 and "twice.xyz: 600 of 1,200 points are duplicates" in error
    clean = np.loadtxt("out.xyz")
    assert clean.shape == (1200, 3) and np.array_equal(clean[::2], clean[1::2])


def test_a_stray_point_far_away_does_not_set_the_scale(n2n):
    stray = np.concatenate([sphere(), [[700.0, 0, 0]]])
    np.savetxt("stray.xyz", stray)
    code, _, error = n2n("denoise", "stray.xyz", "-o", "out.xyz", QUICK)
    assert code == 0 and "1 points look like outliers and took no part in the fit" in error
    clean = np.loadtxt("out.xyz")
    assert clean.shape == stray.shape
    assert off_surface(clean[:-1], np.zeros(3), 1) < 0.9 * off_surface(stray[:-1], np.zeros(3), 1)


def with_strays() -> tuple[np.ndarray, np.ndarray]:
    """Return rows x y z label, some of them halfway to the centre and one not a number, and which are strays."""
    points, stray = sphere(), np.zeros(600, bool)
    stray[5::60] = True
    points[stray] *= 0.4
    points[100] = np.nan
    return np.column_stack([points, np.arange(600)]), stray


def test_outliers_are_told_and_moved_like_all_points(n2n):
    table, stray = with_strays()
    np.savetxt("strays.xyz", table)
    code, _, error = n2n("denoise", "strays.xyz", "-o", "out.xyz", QUICK)
    assert code == 0 and f"{stray.sum()} points look like outliers and took no part in the fit" in error
    clean = np.loadtxt("out.xyz")
    assert np.array_equal(clean[:, 3], table[:, 3])
    assert off_surface(np.delete(clean[:, :3], 100, 0)) < 0.5 * off_surface(np.delete(table[:, :3], 100, 0))


@pytest.mark.parametrize("extra", [(), ("--even",)])
def test_denoise_can_remove_outliers_and_keeps_the_rest(n2n, extra):
    table, stray = with_strays()
    np.savetxt("strays.xyz", table)
    code, _, error = n2n("denoise", "strays.xyz", "-o", "out.xyz", "--remove-outliers", *extra, QUICK)
    assert code == 0 and f"strays.xyz: {stray.sum()} outliers removed" in error
    clean = np.loadtxt("out.xyz")
    assert np.array_equal(clean[:, 3], np.flatnonzero(~stray)) and np.isnan(clean[clean[:, 3] == 100, :3]).all()
    assert off_surface(clean[clean[:, 3] != 100, :3]) < 0.02


def test_upsample_can_start_without_outliers(n2n):
    table, stray = with_strays()
    np.savetxt("strays.xyz", table)
    code, _, error = n2n("upsample", "strays.xyz", "-o", "out.xyz", "--rate", "2", "--remove-outliers", QUICK)
    assert code == 0 and "outliers removed" in error
    stray[100] = True
    assert np.array_equal(np.loadtxt("out.xyz")[:, 3], np.tile(np.flatnonzero(~stray), 2))


def test_a_scan_without_outliers_is_written_whole(n2n):
    code, _, error = n2n(*DENOISE, "--remove-outliers", QUICK)
    assert code == 0 and "0 outliers removed" in error and "look like outliers" not in error
    assert np.loadtxt("out.xyz").shape == (600, 3)


@pytest.mark.parametrize("setting", ["logger=wandb", "datamodule.shape=torus", "checkpoint_every=5"])
def test_settings_of_kept_runs_are_refused_where_none_is_kept(n2n, setting):
    code, _, error = n2n("denoise", "scan.xyz", "-o", "out.xyz", setting)
    assert code == 2 and f"{setting} has no effect here" in error and not Path("out.xyz").exists()


def test_upsample_gives_rate_times_the_points_on_the_surface_with_attributes(n2n):
    np.savetxt("labels.txt", np.column_stack([sphere(), np.arange(600)]), header="x y z label")
    code, _, error = n2n("upsample", "labels.txt", "-o", "dense.txt", "--rate", "3", QUICK)
    dense = np.loadtxt("dense.txt")
    assert code == 0 and "upsample: 1,800 points -> dense.txt" in error
    assert dense.shape == (1800, 4) and len(np.unique(dense[:, :3], axis=0)) == 1800
    assert off_surface(dense[:, :3]) < 0.02
    # Every point takes the label of one nearby.
    assert np.linalg.norm(dense[:, :3] - sphere()[dense[:, 3].astype(int)], axis=1).max() < 1
    assert np.bincount(dense[:, 3].astype(int)).tolist() == [3] * 600


def test_several_observations_make_one_result_each_in_a_folder(n2n):
    np.savetxt("a.xyz", sphere(300, 1))
    np.save("b.npy", sphere(400, 2))
    np.hstack([sphere(500, 3), np.ones((500, 1))]).astype("<f4").tofile("c.bin")
    code, _, error = n2n("denoise", "a.xyz", "b.npy", "c.bin", "-o", "clean/", QUICK)
    assert code == 0 and "1,200 points in 3 files -> clean " in error and "in 3 observations" in error
    # KITTI scans are only read.
    assert sorted(path.name for path in Path("clean").iterdir()) == ["a.xyz", "b.npy", "c.ply"]
    assert np.loadtxt("clean/a.xyz").shape == (300, 3) and np.load("clean/b.npy").shape == (400, 3)
    assert trimesh.load("clean/c.ply").vertices.shape == (500, 3)
    assert off_surface(np.load("clean/b.npy")) < 0.9 * off_surface(np.load("b.npy"))


def test_several_observations_into_a_file_write_the_first(n2n):
    np.savetxt("second.xyz", sphere(300, 1))
    code, _, error = n2n("denoise", "scan.xyz", "second.xyz", "-o", "out.xyz", QUICK)
    assert code == 0 and "only the first of 2 inputs was written; -o FOLDER/ writes one result for each" in error
    assert np.loadtxt("out.xyz").shape == (600, 3)


def test_several_observations_make_one_mesh_in_a_folder(n2n):
    np.savetxt("second.xyz", sphere(300, 1))
    code, _, error = n2n("reconstruct", "scan.xyz", "second.xyz", "-o", "made/here/", "--resolution", "16", QUICK)
    assert code == 0 and "-> made/here/scan.ply" in error
    assert [path.name for path in Path("made/here").iterdir()] == ["scan.ply"]


def test_preview_draws_before_and_after(n2n):
    code, _, _ = n2n(*DENOISE, "--preview", "picture.png", QUICK)
    assert code == 0 and Path("out.xyz").exists()
    picture = Path("picture.png").read_bytes()
    assert picture.startswith(PNG)
    width, height = (int.from_bytes(picture[i : i + 4]) for i in (16, 20))
    assert width > 1.5 * height > 300


def test_fit_leaves_a_run_that_is_found_finished_the_next_time(run_folder, n2n, monkeypatch):
    assert {"config.yaml", "metrics.csv", "summary.json", "field.ckpt"} <= {path.name for path in run_folder.iterdir()}
    assert len(run_folder.name) == 10 and int(run_folder.name, 16) >= 0
    assert "iterations: 20\n" in (run_folder / "config.yaml").read_text()
    summary = json.loads((run_folder / "summary.json").read_text())
    assert summary["iterations"] == 20 and summary["points"] == [600] and summary["config"]["iterations"] == 20
    with (run_folder / "metrics.csv").open() as file:
        steps = [int(row["step"]) for row in csv.DictReader(file)]
    assert steps and max(steps) == 20
    before = listing(run_folder)
    monkeypatch.chdir(run_folder.parents[1])
    code, _, error = n2n("fit", "datamodule=files", "datamodule.paths=[utm.xyz]", QUICK)
    assert code == 0 and f"fit: runs/{run_folder.name} is finished already" in error
    assert listing(run_folder) == before and len(list(run_folder.parent.iterdir())) == 1


def test_a_run_makes_a_mesh_where_the_scan_was(run_folder, n2n):
    code, _, error = n2n("reconstruct", "--run", run_folder, "-o", "mesh.ply", "--resolution", "32")
    assert code == 0 and "fitting" not in error
    mesh = trimesh.load("mesh.ply")
    assert off_surface(mesh.vertices, UTM, 40) < 0.8 and mesh.is_watertight
    code, _, error = n2n("reconstruct", "--run", run_folder, "-o", "mesh.stl", "--resolution", "32")
    assert code == 0 and "stl stores 32-bit coordinates, which moves vertices by up to" in error


def test_a_run_has_the_shapes_it_was_fitted_to(run_folder, n2n, tmp_path):
    code, _, error = n2n("reconstruct", "--run", run_folder, "--shape", "1", "-o", "mesh.ply")
    assert code == 2 and error == "n2n: error: --shape 1 is out of range; this run holds shapes 0 to 0\n"
    assert not Path("mesh.ply").exists()


@pytest.mark.parametrize("extension", [".ply", ".xyz", ".csv", ".npy", ".npz", ".pcd", ".las", ".laz"])
def test_a_run_denoises_into_every_format_with_colours_far_from_the_origin(run_folder, n2n, extension):
    points = np.loadtxt(run_folder.parents[1] / "utm.xyz")
    colours = np.random.default_rng(0).integers(0, 256, (600, 3), dtype=np.uint8)
    header = laspy.LasHeader(point_format=2, version="1.2")
    header.scales, header.offsets = np.full(3, 1e-4), UTM
    survey = laspy.LasData(header)
    survey.x, survey.y, survey.z = points.T
    survey.red, survey.green, survey.blue = colours.T
    survey.write("survey.las")
    assert n2n("denoise", "--run", run_folder, "survey.las", "-o", f"clean{extension}", "-q") == (0, "", "")
    clean = read_cloud(f"clean{extension}")
    assert np.linalg.norm(clean.points - points, axis=1).max() < 8
    assert off_surface(clean.points, UTM, 40) < 0.9 * off_surface(points, UTM, 40)
    if extension in (".xyz", ".npy"):
        assert sum(np.array_equal(values, colours[:, 0]) for values in clean.attributes.values()) == 1
    else:
        kept = np.stack([clean.attributes[name] for name in ("red", "green", "blue")], axis=1)
        assert np.array_equal(kept, colours)


def test_las_says_what_it_cannot_store(run_folder, n2n):
    points = np.loadtxt(run_folder.parents[1] / "utm.xyz")
    points[7] = np.nan
    np.savetxt("gaps.xyz", points)
    code, _, error = n2n("denoise", "--run", run_folder, "gaps.xyz", "-o", "clean.las")
    assert code == 0 and "las cannot store the 1 rows that are NaN or infinite" in error
    assert len(laspy.read("clean.las").points) == 600


def test_a_sweep_goes_on_after_a_failure_and_lists_it(n2n, tmp_path):
    paths = "datamodule.paths=[scan.xyz],[none.xyz],[scan.xyz,scan.xyz]"
    code, _, error = n2n("fit", "-m", "sweep=x", "datamodule=files", paths, QUICK, "hydra/launcher=basic")
    assert code == 2
    lines = error.splitlines()
    assert any("/3 failed: datamodule.paths=[none.xyz]: none.xyz: no such file" in line for line in lines)
    assert "sweep x: 2 of 3 done, 1 failed" in lines
    assert lines[-2].startswith("  failed: ") and "[none.xyz]" in lines[-2] and "no such file" in lines[-2]
    assert lines[-1] == "next: n2n sweep retry x"
    assert len(list(tmp_path.glob("sweeps/x/runs/*/field.ckpt"))) == 2


def test_fit_prints_the_configuration_and_does_nothing(n2n, tmp_path):
    code, out, _ = n2n("fit", "seed=7", "--cfg", "job", "-p", "distance")
    assert code == 0 and out.endswith("name: emd\np: 2\n")
    assert list(tmp_path.iterdir()) == [tmp_path / "scan.xyz"]


def test_list_names_every_kind_or_one(n2n):
    code, out, error = n2n("list")
    assert code == 0 and error == ""
    kinds = [line[:-1] for line in out.splitlines() if not line.startswith(" ")]
    swapped = ["architecture", "distance", "pairing", "regulariser", "datamodule", "metric"]
    assert kinds == [*swapped, "protocol", "baseline"]
    assert "  emd                  earth mover's distance" in out
    for kind in ("distance", "distances"):
        code, one, _ = n2n("list", kind)
        assert code == 0 and one.startswith("distance:\n  approx ") and "architecture" not in one and one in out


def test_doctor_names_versions_and_what_is_missing(n2n, monkeypatch):
    code, out, error = n2n("doctor")
    assert code == 0 and error == ""
    assert f"torch              {torch.__version__}" in out and "ready: try `n2n demo`" in out
    for package in (*pyproject_names(), "lazrs"):
        assert f"  {package:<18} {version(package)}\n" in out
    assert "pytest" not in out and "optional" not in out
    known = {"scipy": None, "laspy": None, "rich": "12.0.0"}
    found = doctor._version
    monkeypatch.setattr(doctor, "_version", lambda package: known[package] if package in known else found(package))
    code, out, _ = n2n("doctor")
    assert code == 1
    assert "scipy              MISSING: pip install 'scipy>=1.12'" in out
    assert "laspy              MISSING: pip install 'laspy[lazrs]>=2.5'" in out
    assert "rich               12.0.0 DOES NOT FIT: pip install 'rich>=13'" in out
    assert "not ready: laspy, rich, scipy missing or broken" in out


def test_doctor_works_without_what_it_reads(n2n, monkeypatch):
    def missing(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(doctor, "requires", missing)
    monkeypatch.setattr(doctor, "_version", lambda _: None)
    code, out, _ = n2n("doctor")
    assert code == 1 and "n2n                MISSING: pip install 'n2n'" in out


def pyproject_names() -> list[str]:
    """Return what pyproject.toml lists for every machine."""
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    return [re.match(r"[\w-]+", text).group() for text in project["dependencies"] if ";" not in text]


def test_doctor_chooses_the_first_of_several_cards(n2n, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda index: f"card {index}")
    monkeypatch.setattr(torch.cuda, "get_device_properties", lambda _: SimpleNamespace(total_memory=2**34))
    _, out, _ = n2n("doctor")
    assert "  cuda:0             card 0, 16 GiB; chosen by device=auto\n" in out
    assert "  cuda:1             card 1, 16 GiB\n" in out


@pytest.mark.parametrize("command", ["reconstruct", "denoise", "upsample"])
def test_help_of_a_task_explains_settings(n2n, capsys, command):
    with pytest.raises(SystemExit):
        n2n(command, "--help")
    out = " ".join(capsys.readouterr().out.split())
    assert "key=value a setting of the fit" in out and "`n2n fit --cfg job` lists the keys" in out
    assert ("a tenth wider than the scan" in out) == (command == "reconstruct")


def test_examples_survive_zsh(n2n, capsys):
    with pytest.raises(SystemExit):
        n2n("--help")
    examples = [line for line in capsys.readouterr().out.splitlines() if "[scan.ply]" in line]
    assert examples and all("'datamodule.paths=[scan.ply]'" in line for line in examples)


@pytest.mark.parametrize("command", [[], ["reconstruct"], ["denoise"], ["upsample"], ["demo"], ["list"], ["doctor"]])
def test_help_is_there(n2n, capsys, command):
    with pytest.raises(SystemExit) as stop:
        n2n(*command, "--help")
    assert stop.value.code == 0
    assert capsys.readouterr().out.startswith(f"usage: {' '.join(['n2n', *command])} ")


def test_help_of_fit_is_there(n2n):
    code, out, _ = n2n("fit", "--help")
    assert code == 0 and out.startswith("usage: n2n fit ")


def test_python_does_the_same_in_three_lines():
    import n2n

    points = 40 * sphere() + UTM
    field = n2n.fit(points, overrides=[QUICK])
    mesh, clean = field.reconstruct(32), field.denoise(points)
    assert mesh.is_watertight and off_surface(mesh.vertices, UTM, 40) < 0.8
    assert clean.shape == points.shape and off_surface(clean, UTM, 40) < 0.9 * off_surface(points, UTM, 40)


def test_a_new_folder_is_taken_away_again_when_nothing_can_be_written(n2n, monkeypatch):
    before = listing(Path())

    def full(path, cloud):
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(files._WRITERS, ".xyz", full)
    code, _, error = n2n("denoise", "scan.xyz", "-o", "new/deep/out.xyz", QUICK)
    assert code == 2 and "No space left on device" in error
    assert listing(Path()) == before
