"""The example plugin is installed as a stranger would install it, and used by name."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PLUGIN = Path(__file__).parents[2] / "examples" / "plugin"


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """An environment in which the plugin is installed into a folder of its own."""
    target = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*command, "--target", str(target), str(PLUGIN)], check=True)
    return {**os.environ, "PYTHONPATH": str(target)}


def n2n(environment, folder, *arguments):
    command = [sys.executable, "-m", "n2n.cli.main", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_listed_with_its_package(installed, tmp_path):
    listing = n2n(installed, tmp_path, "list", "distance").stdout
    assert "huber" in listing and "[n2n-example-plugin]" in listing and "emd" in listing


def test_its_option_composes_and_its_name_is_suggested(installed, tmp_path):
    composed = n2n(
        installed, tmp_path, "fit", "--cfg", "job", "distance=huber", "distance.delta=0.02", "-p", "distance"
    )
    assert composed.returncode == 0, composed.stderr
    assert "name: huber\ndelta: 0.02" in composed.stdout
    typo = n2n(installed, tmp_path, "fit", "distance=hubert")
    assert typo.returncode == 2
    assert "Unknown distance 'hubert'. Did you mean 'huber'?" in typo.stderr
    argument = n2n(installed, tmp_path, "fit", "distance=huber", "distance.detla=1")
    assert "distance 'huber' has no argument 'detla'. Did you mean 'delta'?" in argument.stderr


def test_fits_with_it(installed, tmp_path):
    small = ["iterations=4", "plan_reuse=2", "datamodule.shape=sphere", "datamodule.points=500", "logger=none"]
    result = n2n(installed, tmp_path, "fit", "distance=huber", *small)
    assert result.returncode == 0, result.stderr
    (field,) = tmp_path.glob("runs/*/field.ckpt")
    assert field.stat().st_size > 1000


def test_its_own_tests_pass(installed):
    command = [sys.executable, "-m", "pytest", "-q", "-c", os.devnull, "-p", "no:cacheprovider", str(PLUGIN / "tests")]
    result = subprocess.run(command, env=installed, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout
    assert "6 passed" in result.stdout
