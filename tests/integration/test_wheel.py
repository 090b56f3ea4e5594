"""What a user gets from `pip install`: the wheel, away from the checkout."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", str(folder)]
    subprocess.run([*build, str(ROOT)], check=True)
    (wheel,) = folder.glob("n2n-*.whl")
    zipfile.ZipFile(wheel).extractall(folder / "site")
    return folder / "site"


def run(site, code, folder):
    environment = {**os.environ, "PYTHONPATH": str(site)}
    return subprocess.run(
        [sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True, check=True
    ).stdout


def test_the_configuration_is_inside(unpacked, tmp_path):
    code = "from n2n.compose import conf_dir, compose; compose(['recipe=paper', 'distance=cd']); print(conf_dir())"
    assert run(unpacked, code, tmp_path).strip() == str(unpacked / "n2n" / "conf")
    shipped = {path.relative_to(unpacked / "n2n") for path in (unpacked / "n2n" / "conf").rglob("*.yaml")}
    assert shipped == {path.relative_to(ROOT) for path in (ROOT / "conf").rglob("*.yaml")}


def test_the_demo_scan_is_inside(unpacked, tmp_path):
    code = "from n2n.cli.demo import sample_path; print(sample_path())"
    path = Path(run(unpacked, code, tmp_path).strip())
    assert path.is_relative_to(unpacked) and path.stat().st_size < 1_000_000


def test_nothing_of_the_tests_or_the_runs_is_inside(unpacked):
    assert {path.name for path in unpacked.iterdir()} == {
        "n2n",
        "hydra_plugins",
        next(unpacked.glob("n2n-*.dist-info")).name,
    }
