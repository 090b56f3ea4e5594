"""`n2n evaluate`: files in, a table and a JSON file out; mistakes are one line and leave nothing behind."""

import hashlib
import json

import numpy as np
import pytest
import trimesh

from n2n.cli.main import main
from n2n.formats import write_mesh


@pytest.fixture
def evaluate(tmp_path, monkeypatch, capsys):
    """Run the command in a folder with a clean cloud, a mesh and a noisy cloud; return exit code, out, err."""
    monkeypatch.chdir(tmp_path)
    mesh = trimesh.creation.icosphere(subdivisions=2)
    clean = np.asarray(trimesh.sample.sample_surface(mesh, 300, seed=1)[0])
    np.savetxt("clean.xyz", clean, fmt="%.17g")
    np.savetxt("noisy.xyz", clean + 0.02 * np.random.default_rng(0).standard_normal(clean.shape), fmt="%.17g")
    write_mesh("mesh.off", mesh)
    write_mesh("mesh.stl", mesh)

    def command(*arguments):
        code = main(["evaluate", *arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return command


def test_a_cloud_against_cloud_and_mesh(evaluate, tmp_path):
    both = ("--reference", "mesh.off", "--reference", "clean.xyz")
    code, out, error = evaluate("noisy.xyz", *both, "--protocol", "sbp", "--noisy", "noisy.xyz", "--json", "a.json")
    assert (code, error) == (0, "")
    rows = {line.split()[0]: line.split() for line in out.splitlines()}
    assert {"cd_sum2", "cd_mean2", "p2m", "p2m_forward", "p2m_backward", "hausdorff"} <= set(rows)
    record = json.loads((tmp_path / "a.json").read_text())
    printed = float(rows["cd_sum2"][3])
    assert printed == pytest.approx(1e4 * record["values"]["cd_sum2"], rel=1e-3)
    # The prediction is the noisy cloud: doing nothing is as good, the oracle is better.
    assert record["floors"]["do_nothing"]["cd_sum2"] == record["values"]["cd_sum2"]
    assert record["floors"]["oracle"]["p2m"] < record["values"]["p2m"]
    assert record["protocol"] == "sbp" and record["settings"]["p2m"]["min_triangle_area"] == 0
    assert record["n2n"] and {"commit", "modified", "definitions", "blanks", "samples"} <= set(record)
    files = {(f["role"], f["path"]): f["sha256"] for f in record["files"]}
    assert files[("noisy", "noisy.xyz")] == hashlib.sha256((tmp_path / "noisy.xyz").read_bytes()).hexdigest()
    assert {role for role, _ in files} == {"prediction", "reference", "noisy"} and len(files) == 4
    assert evaluate("noisy.xyz", *both, "--protocol", "sbp", "--noisy", "noisy.xyz")[1] == out


@pytest.mark.parametrize("name", ["mesh.off", "mesh.stl"])
def test_a_mesh_is_known_by_its_faces(evaluate, name):
    code, out, _ = evaluate(name, "--reference", "mesh.off", "--protocol", "neuralpull")
    assert code == 0 and "10,000 points, uniform samples" in out
    rows = {line.split()[0]: line.split() for line in out.splitlines()}
    assert rows["watertight"][1] == "1" and rows["components"][1] == "1"


def test_a_ply_without_faces_is_a_cloud(evaluate):
    trimesh.PointCloud(np.loadtxt("clean.xyz")).export("cloud.ply")
    code, out, _ = evaluate("cloud.ply", "--reference", "mesh.off", "--protocol", "neuralpull")
    assert code == 0 and "prediction: 300 points, all points" in out
    assert "nc, nc_inflated: blank, the prediction is points, without normals" in out


def test_stored_normals_are_used(evaluate):
    points = np.loadtxt("clean.xyz")
    np.savez("pointcloud.npz", points=points, normals=points / np.linalg.norm(points, axis=1, keepdims=True))
    code, out, _ = evaluate("mesh.off", "--reference", "pointcloud.npz", "--protocol", "sap")
    rows = {line.split()[0]: line.split() for line in out.splitlines()}
    assert code == 0 and float(rows["nc"][1]) > 0.95
    assert "note: sap compares with 50,000 points; the reference has only 300" in out


def test_a_run_knows_its_reference(evaluate, tmp_path):
    settings = ["datamodule=generated", "datamodule.shape=sphere", "datamodule.points=400", "iterations=5"]
    assert main(["fit", *settings, "task=denoise"]) == 0
    (folder,) = (tmp_path / "runs").iterdir()
    code, out, _ = evaluate(f"runs/{folder.name}", "--protocol", "sbp", "--json", "run.json")
    assert code == 0 and "denoise of sphere" in out and "prediction: 400 points" in out
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["run"]["config"]["datamodule"]["shape"] == "sphere"
    assert set(record["floors"]) == {"oracle", "resample", "do_nothing"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("noisy.xyz", "--reference", "clean.xyz"), "the following arguments are required: --protocol"),
        (("noisy.xyz", "--reference", "clean.xyz", "--protocol", "spb"), "Unknown protocol 'spb'. Did you mean 'sbp'?"),
        (("noisy.xyz", "--protocol", "sbp"), "nothing to compare with; give a clean cloud or a mesh with --reference"),
        (("none.xyz", "--reference", "clean.xyz", "--protocol", "sbp"), "none.xyz: no such file"),
        (("noisy.xyz", "--reference", "none.off", "--protocol", "sbp"), "none.off: no such file"),
        (("noisy.xyz", "--reference", "nan.xyz", "--protocol", "sbp"), "nan.xyz: 1 of 2 rows are NaN or infinite"),
        (("noisy.xyz", "--reference", "cut.off", "--protocol", "sbp"), "cut.off: promises 320 faces"),
        (("noisy.xyz", "--reference", "odd.off", "--protocol", "sbp"), "odd.off: "),
        (
            ("noisy.xyz", "--reference", "clean.xyz", "--reference", "noisy.xyz", "--protocol", "sbp"),
            "clean.xyz and noisy.xyz are both clouds",
        ),
        (("runs", "--reference", "clean.xyz", "--protocol", "sbp"), "runs holds no finished run"),
        (("mesh.off", "--reference", "mesh.off", "--protocol", "sbp"), "give a clean cloud as reference, too"),
        (("noisy.xyz", "--reference", "clean.xyz", "--protocol", "sbp", "--json", "no/a.json"), "the folder no does"),
        (("noisy.xyz", "--reference", "clean.xyz", "--protocol", "sbp", "--json", "a.txt"), "cannot write files"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(evaluate, tmp_path, arguments, message):
    (tmp_path / "nan.xyz").write_text("0 0 0\nnan 1 1\n")
    lines = (tmp_path / "mesh.off").read_text().splitlines()
    (tmp_path / "cut.off").write_text("\n".join(lines[:-100]) + "\n")
    (tmp_path / "odd.off").write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n")
    (tmp_path / "runs").mkdir()
    before = sorted(tmp_path.iterdir())
    code, out, error = evaluate(*arguments, *(() if "--json" in arguments else ("--json", "a.json")))
    assert code == 2 and out == ""
    assert error.startswith("n2n: error: ") and error.count("\n") == 1 and message in error
    assert sorted(tmp_path.iterdir()) == before
