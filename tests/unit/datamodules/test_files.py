"""The user's own files, with and without a truth."""

import numpy as np
import pytest
import trimesh

from n2n.datamodules.files import FilesDataModule
from n2n.errors import InputError
from n2n.registry import DATAMODULES


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Two noisy spheres, clean points and the mesh of one, in names with blanks."""
    random = np.random.default_rng(0)
    clean = random.normal(size=(300, 3))
    clean /= np.linalg.norm(clean, axis=1, keepdims=True)
    for name in ("a 1", "a 2"):
        np.savetxt(tmp_path / f"{name}.xyz", clean + 0.01 * random.normal(size=clean.shape))
    np.savetxt(tmp_path / "clean.xyz", clean)
    trimesh.creation.icosphere(2).export(tmp_path / "true.off")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_truth_is_told_apart_by_its_content(folder):
    clean = np.loadtxt("clean.xyz")
    for given in (["clean.xyz", "true.off"], ["true.off", "clean.xyz"]):
        data = FilesDataModule(["a 1.xyz", "a 2.xyz"], given)
        assert np.array_equal(data.reference.points, clean) and data.reference.faces.shape == (320, 3)
        assert np.array_equal(data.noisy, np.loadtxt("a 1.xyz")) and len(data.shapes[0]) == 2
        assert (data.name, data.source) == ("a 1", f"files a 1.xyz, a 2.xyz; truth: {', '.join(given)}")
    only = FilesDataModule(["a 1.xyz"], ["true.off"], shape="ball")
    assert only.reference.points is None and only.reference.vertices is not None and only.name == "ball"
    assert FilesDataModule(["a 1.xyz"]).reference is None


def test_the_truth_is_no_part_of_what_is_fitted(folder):
    without, given = FilesDataModule(["a 1.xyz"]), FilesDataModule(["a 1.xyz"], ["clean.xyz"], "ball")
    assert without.fingerprint() == given.fingerprint()


def test_only_the_observations_that_are_used_are_its_source(folder):
    spec = {"name": "files", "paths": ["a 1.xyz", "a 2.xyz"], "reference": None, "shape": None}
    data = DATAMODULES.build(spec, num_observations=1)
    assert data.source == "files a 1.xyz" and len(data.shapes[0]) == 1


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"reference": "true.off"}, "datamodule.reference must be a list of files"),
        ({"reference": ["clean.xyz", "a 2.xyz"]}, "clean.xyz and a 2.xyz are both clouds"),
        ({"reference": ["none.off"]}, "none.off: no such file"),
        ({"paths": [["a 1.xyz"], ["a 2.xyz"]], "reference": ["clean.xyz"]}, "is the truth of one shape, but"),
        ({"paths": "a 1.xyz"}, "datamodule.paths must be a list of files"),
    ],
)
def test_mistakes_are_one_line(folder, arguments, expected):
    with pytest.raises(InputError) as caught:
        FilesDataModule(**{"paths": ["a 1.xyz"], **arguments})
    assert expected in str(caught.value) and "\n" not in str(caught.value)
