"""`n2n data`: what a person sees, downloads, prepares and checks."""

import hashlib
import io
import json
import subprocess
import sys
import zipfile

import numpy as np
import pytest
import trimesh

from n2n.cli import fetch
from n2n.cli.main import main
from n2n.datamodules import catalog
from n2n.datamodules.catalog import DATASETS, Link, dataset
from n2n.datamodules.pointcleannet import PCDataModule
from n2n.datamodules.punet import PUDataModule
from n2n.registry import DATAMODULES
from tests.unit.datamodules.server import Site, serve


def ball(count=400, seed=0):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return 0.5 * points / np.linalg.norm(points, axis=1, keepdims=True)


def famous():
    """Return the content of an archive in the layout of Points2Surf: two shapes."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("famous_original/testset.txt", "bunny\nhorse\n")
        for name in ("bunny", "horse"):
            scan = io.BytesIO()
            np.save(scan, ball().astype(np.float32))
            mesh = trimesh.creation.icosphere(2, 0.5).export(file_type="ply")
            archive.writestr(f"famous_original/04_pts/{name}.xyz.npy", scan.getvalue())
            archive.writestr(f"famous_original/03_meshes/{name}.ply", mesh)
    return content.getvalue()


@pytest.fixture
def n2n(tmp_path, monkeypatch, capsys):
    """Run a command with an empty data folder `data`; return exit code, standard output and standard error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("N2N_DATA", raising=False)
    monkeypatch.delenv("N2N_TRACEBACK", raising=False)

    def run(*arguments):
        capsys.readouterr()
        return main(["data", *map(str, arguments)]), *capsys.readouterr()

    return run


@pytest.fixture
def site(monkeypatch):
    """Serve the archive of FAMOUS in the place of its true address."""
    with serve(Site(famous=famous())) as running:
        entry = dataset("famous")
        local = Link(f"{running.url}/famous", "famous.zip", "", "test")
        changed = catalog.Dataset(**{**entry.__dict__, "links": (local,)})
        monkeypatch.setattr(fetch, "dataset", lambda name: changed if name == "famous" else dataset(name))
        yield running


def row(output, name):
    return next(line for line in output.splitlines() if line.startswith(name))


def test_every_dataset_is_a_data_module_and_names_its_way(n2n):
    known = {entry.name for entry in DATASETS}
    assert known == set(DATAMODULES.names()) - {"files", "generated"}
    for entry in DATASETS:
        assert entry.licence and entry.layout and (entry.links or entry.steps)
        assert all(link.url.startswith("https://") for link in entry.links)
        assert all("{folder}" in " ".join(entry.steps) for _ in entry.steps)
        assert all(step.format(folder="X") for step in entry.steps)


def test_list_without_data(n2n):
    code, output, _ = n2n("list")
    assert code == 0 and "no such folder" in output
    assert [row(output, entry.name).split()[1] for entry in DATASETS] == ["missing"] * len(DATASETS)
    assert "data/famous_original" in row(output, "famous")


def test_list_imports_no_torch():
    code = "import sys; from n2n.cli.main import main; main(['data', 'list']); sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0


def test_fetch_then_list_then_verify(n2n, site, tmp_path):
    code, output, error = n2n("fetch", "famous")
    assert code == 0, error
    assert "licence:" in output and "famous: partial, famous_original 2 of 22" in output
    assert not list((tmp_path / "data").glob("*.zip"))
    record = json.loads((tmp_path / "data/n2n-checksums.json").read_text())
    assert record[f"{site.url}/famous"]["sha256"] == hashlib.sha256(site.files["/famous"]).hexdigest()
    code, output, _ = n2n("list")
    assert row(output, "famous").split()[1] == "partial" and "2 of 22" in row(output, "famous")
    code, output, _ = n2n("verify", "famous")
    assert code == 0 and "famous_original: 2 read, 0 bad" in output and "all good" in output


def test_fetch_to_another_folder_says_how_to_use_it(n2n, site, tmp_path):
    code, output, _ = n2n("fetch", "famous", "-o", tmp_path / "big disk")
    assert code == 0 and f"N2N_DATA={tmp_path / 'big disk'}" in output
    assert (tmp_path / "big disk/famous_original/testset.txt").exists()


def test_an_interrupted_fetch_goes_on(n2n, site, tmp_path):
    half = len(site.files["/famous"]) // 2
    site.breaks = [half, 0, 0, 0]
    code, _, error = n2n("fetch", "famous")
    assert code == 2 and error.splitlines()[-1].startswith("n2n: error:") and "run the same command again" in error
    site.asked.clear()
    assert n2n("fetch", "famous")[0] == 0
    assert site.asked == [f"bytes={half}-"]


def test_a_sign_in_page_instead_of_the_archive(n2n, site, tmp_path):
    site.files["/famous"] = b"<html>please sign in</html>"
    code, _, error = n2n("fetch", "famous")
    assert code == 2 and "no zip or tar archive" in error.splitlines()[-1]


@pytest.mark.parametrize("name", ["pu", "scene3d", "paris", "kitti"])
def test_what_needs_a_person_is_told_in_steps(n2n, name):
    code, output, _ = n2n("fetch", name)
    assert code == 1
    steps = [line.split(".")[0].strip() for line in output.splitlines() if line.startswith("  ")]
    assert steps == [str(number + 1) for number in range(len(dataset(name).steps))]
    assert "http" in output and "data" in output


def test_a_complete_dataset_is_left_alone(n2n, tmp_path):
    path = tmp_path / "data/kitti/object/training/velodyne/000000.bin"
    path.parent.mkdir(parents=True)
    np.column_stack([20 * ball(), np.ones(400)]).astype("<f4").tofile(path)
    code, output, _ = n2n("fetch", "kitti")
    assert code == 0 and "nothing to do" in output


def scene(root, name, truth):
    for folder, is_here in (("input", True), ("ground_truth", truth)):
        path = root / f"data/3dscene/{folder}/{name}{'_1000' if folder == 'input' else ''}.ply"
        path.parent.mkdir(parents=True, exist_ok=True)
        if is_here:
            trimesh.creation.icosphere(3).export(path)


def test_scans_without_their_truth_are_not_all_there_is(n2n, tmp_path):
    scene(tmp_path, "lounge", True)
    scene(tmp_path, "copyroom", False)
    assert row(n2n("list")[1], "scene3d").split()[1] == "partial"
    code, output, _ = n2n("fetch", "scene3d")
    assert code == 1 and "nothing to do" not in output and "(1 with truth)" in output and "  1. open http" in output
    scene(tmp_path, "copyroom", True)
    code, output, _ = n2n("fetch", "scene3d")
    assert code == 0 and "nothing to do" in output


def test_what_brings_no_truth_is_not_downloaded_for_it(n2n, tmp_path, monkeypatch):
    """All scans of SRB are here; only the ground truth is to be got, by hand."""
    for name in ("anchor", "daratech", "dc", "gargoyle", "lord_quas"):
        path = tmp_path / f"data/srb/scans/{name}.ply"
        path.parent.mkdir(parents=True, exist_ok=True)
        trimesh.PointCloud(ball()).export(path)
    monkeypatch.setattr(fetch, "download", lambda *_: pytest.fail("downloaded"))
    code, output, _ = n2n("fetch", "srb")
    assert code == 1 and "srb: partial, 5 of 5 (0 with truth)" in output and "dense ground truth" in output


def test_an_archive_may_unpack_to_a_folder_of_its_own_name(n2n, monkeypatch, tmp_path):
    content = {name: io.BytesIO() for name in ("clouds", "meshes")}
    with zipfile.ZipFile(content["clouds"], "w") as archive:
        text = "".join(f"{x:.5f} {y:.5f} {z:.5f}\n" for x, y, z in ball(100_000))
        archive.writestr("pointCleanNetDataset/galera100k.xyz", text)
    with zipfile.ZipFile(content["meshes"], "w") as archive:
        archive.writestr("all/galera.off", trimesh.creation.icosphere(4, 0.5).export(file_type="off"))
    entry = dataset("pc")
    with serve(Site(**{name: data.getvalue() for name, data in content.items()})) as running:
        links = [link._replace(url=f"{running.url}/{name}") for name, link in zip(content, entry.links, strict=True)]
        changed = catalog.Dataset(**{**entry.__dict__, "links": tuple(links)})
        monkeypatch.setattr(fetch, "dataset", lambda name: changed)
        code, output, error = n2n("fetch", "pc")
    assert code == 0, error
    assert "clean 1 of 10" in output and "meshes 1 of 10" in output
    data = PCDataModule(points=500)
    assert data.name == "galera" and len(data.reference.faces) == 5120


def test_verify_names_every_bad_file_and_reads_the_rest(n2n, site, tmp_path):
    n2n("fetch", "famous")
    folder = tmp_path / "data/famous_original"
    (folder / "04_pts/bunny.xyz.npy").write_bytes(b"\x93NUMPY broken")
    (folder / "testset.txt").write_text("bunny\nhorse\nhorse\nyoda\n")
    code, output, _ = n2n("verify")
    bad = [line for line in output.splitlines() if line.startswith("BAD")]
    assert code == 2 and len(bad) == 3
    for told in ("bunny.xyz.npy", "'horse' twice", "yoda.xyz.npy: is missing"):
        assert sum(told in line for line in bad) == 1
    assert all("expected" in line for line in bad)
    assert "famous famous_original: 2 read, 3 bad" in output


def test_mistakes_are_one_line(n2n, tmp_path):
    (tmp_path / "locked").mkdir(mode=0o555)
    for arguments, told in [
        (["fetch", "famos"], "Did you mean 'famous'"),
        (["fetch"], "NAME"),
        ([], "ACTION"),
        (["verify"], "nothing of any dataset"),
        (["verify", "srb"], "n2n data fetch srb"),
        (["prepare", "srb"], "'pu', 'pc'"),
        (["prepare", "pu"], "no shapes to prepare"),
        (["prepare", "pu", "--noise", "much"], "--noise much"),
        (["prepare", "pu", "--points", "3"], "--points 3"),
        (["prepare", "pu", "--seed", "-1"], "--seed -1"),
        (["prepare", "pu", "-o", tmp_path / "locked"], "read-only"),
        (["fetch", "abc", "-o", tmp_path / "locked"], "read-only"),
        (["list", "--nonsense"], "--nonsense"),
    ]:
        code, _, error = n2n(*arguments)
        assert code == 2, arguments
        assert len(error.splitlines()) == 1 and error.startswith("n2n: error:") and told in error, error


def test_prepare_writes_exact_counts_that_the_data_module_reads(n2n, tmp_path, monkeypatch):
    meshes = tmp_path / "data/PUNet/meshes/test"
    meshes.mkdir(parents=True)
    for name, scale in (("duck", 1.0), ("star", 30.0)):
        trimesh.creation.torus(1.0 * scale, 0.4 * scale).export(meshes / f"{name}.off")
    (meshes / "cow.off").write_text("OFF\n3 1 0\n0 0 0\n")
    drawn = PUDataModule("duck", points=1000, noise=0.02, seed=4, num_observations=2)
    code, output, _ = n2n("prepare", "pu", "--points", 1000, "--noise", "0.02", "0.03", "--seed", 4, "-o", "out")
    assert code == 2 and "BAD" in row(output, "BAD") and "cow.off" in output and "2 shapes, 6 files" in output
    clean = np.loadtxt("out/PUNet/pointclouds/test/1000_poisson/star.xyz")
    noisy = np.loadtxt("out/examples/PUNet_1000_poisson_0.03/star.xyz")
    assert clean.shape == noisy.shape == (1000, 3)
    centre = (clean.min(axis=0) + clean.max(axis=0)) / 2
    radius = np.linalg.norm(clean - centre, axis=1).max()
    assert 40 < radius < 43
    assert np.std(noisy - clean) == pytest.approx(0.03 * radius, rel=0.05)
    assert (tmp_path / "out/PUNet/meshes/test/duck.off").read_bytes() == (meshes / "duck.off").read_bytes()
    record = json.loads((tmp_path / "out/n2n-prepared-pu.json").read_text())
    assert record["seed"] == 4 and record["points"] == [1000] and record["noise"] == ["0.02", "0.03"]
    entry = record["shapes"]["duck"]
    assert entry["sha256"] == hashlib.sha256((meshes / "duck.off").read_bytes()).hexdigest()
    assert all(len(np.loadtxt(tmp_path / "out" / path)) == count for path, count in entry["files"].items())
    # What is prepared is what a fit without it would draw.
    noisy = np.loadtxt("out/examples/PUNet_1000_poisson_0.02/duck.xyz")
    clean = np.loadtxt("out/PUNet/pointclouds/test/1000_poisson/duck.xyz")
    centre = (clean.min(axis=0) + clean.max(axis=0)) / 2
    unit = (noisy - centre) / np.linalg.norm(clean - centre, axis=1).max()
    np.testing.assert_allclose(unit, drawn.noisy, atol=1e-7)


@pytest.mark.parametrize("place", ["PCNet", "pointCleanNetDataset"])
def test_prepare_thins_the_clouds_of_pc(n2n, tmp_path, monkeypatch, place):
    folder = tmp_path / "data" / place
    folder.mkdir(parents=True)
    points = ball(100_000)
    np.savetxt(folder / "happy100k.xyz", points, fmt="%.7f")
    np.savetxt(folder / "happy100k_noise_white_1.00e-02.xyz", points + 0.01 * ball(100_000, 1), fmt="%.7f")
    drawn = PCDataModule("happy", points=500, noise=0.02, seed=3)
    for output in ("out", "data"):
        told = [] if output == "data" else ["-o", output]
        code, _, error = n2n("prepare", "pc", "--points", 500, "--noise", "0.01", "0.02", "--seed", 3, *told)
        assert code == 0, error
        chosen = np.loadtxt(tmp_path / output / "PCNet/pointclouds/test/500_poisson/happy.xyz")
        stored = {tuple(point) for point in np.round(points, 7)}
        assert chosen.shape == (500, 3) and all(tuple(point) in stored for point in np.round(chosen, 7))
        # What was written is read again, and hides nothing.
        read = PCDataModule("happy", points=500, noise=0.02, seed=3, official=True, root=output)
        np.testing.assert_allclose(read.noisy, drawn.noisy, atol=1e-6)
        assert "happy.xyz (made by n2n data prepare)" in read.source
    assert row(n2n("list")[1], "pc").split()[2:6] == ["clean", "1", "of", "10;"]
    assert "happy100k.xyz, 600 of" in PCDataModule("happy", points=600).source
    # The benchmark's own noise goes before what was made here.
    assert "happy100k_noise_white" in PCDataModule("happy", points=500, official=True).source


def test_prepare_knows_what_it_made_and_leaves_the_rest_alone(n2n, tmp_path):
    mesh = tmp_path / "data/data/PUNet/meshes/test/duck.off"
    mesh.parent.mkdir(parents=True)
    trimesh.creation.torus(1.0, 0.4).export(mesh)
    arguments = ("prepare", "pu", "--noise", "0.01", "--points")
    official = tmp_path / "data/data/PUNet/pointclouds/test/300_poisson/duck.xyz"
    official.parent.mkdir(parents=True)
    official.write_text("0 0 0\n")
    code, output, _ = n2n(*arguments, 300)
    assert code == 2 and "not made by this command; write to another folder" in row(output, "BAD")
    assert official.read_text() == "0 0 0\n"
    assert n2n(*arguments, 400)[0] == n2n(*arguments, 500)[0] == n2n(*arguments, 400, 500)[0] == 0
    assert n2n(*arguments, 500)[0] == 0
    assert (official.parents[1] / "400_poisson/duck.xyz").exists()
    for count in (400, 500):
        source = PUDataModule(points=count, official=True).source
        assert source.count("(made by n2n data prepare)") == 2
