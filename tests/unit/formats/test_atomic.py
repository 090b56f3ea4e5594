"""Results appear whole or not at all, and what cannot be written is known beforehand."""

import os
import tempfile

import numpy as np
import pytest
import trimesh

from n2n.errors import OutputError
from n2n.formats import Cloud, atomic_path, check_writable, files, write_cloud, write_mesh

KNOWN = (".ply", ".xyz")


@pytest.mark.parametrize("failure", [ValueError("no"), KeyboardInterrupt(), SystemExit(1)])
@pytest.mark.parametrize("before", [None, "old"])
def test_a_failure_leaves_what_was_there(tmp_path, before, failure):
    target = tmp_path / "out.xyz"
    if before:
        target.write_text(before)
    with pytest.raises(type(failure)), atomic_path(target) as temporary:
        temporary.write_text("half")
        raise failure
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == ({"out.xyz": "old"} if before else {})


def test_success_replaces_what_was_there(tmp_path):
    target = tmp_path / "out.xyz"
    target.write_text("old")
    with atomic_path(target) as temporary:
        assert temporary.parent == tmp_path and temporary.suffix == ".xyz"
        temporary.write_text("new")
        assert target.read_text() == "old"
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"out.xyz": "new"}


def test_a_full_disk_is_told_in_one_line(tmp_path):
    with (
        pytest.raises(OutputError, match=r"out.xyz: writing failed \(No space left on device\); nothing was left"),
        atomic_path(tmp_path / "out.xyz"),
    ):
        raise OSError(28, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_told_in_one_line(tmp_path):
    with pytest.raises(OutputError, match="cannot write there"), atomic_path(tmp_path / "none" / "out.xyz"):
        pytest.fail("there is nowhere to write")


def test_results_have_the_permissions_of_other_files(tmp_path):
    previous = os.umask(0o027)
    try:
        with atomic_path(tmp_path / "out.xyz") as temporary:
            temporary.write_text("new")
        assert os.umask(0o027) == 0o027
    finally:
        os.umask(previous)
    assert (tmp_path / "out.xyz").stat().st_mode & 0o777 == 0o640


def test_a_writer_that_fails_half_way_leaves_no_cloud(tmp_path, monkeypatch):
    def broken(path, cloud):
        path.write_text("half")
        raise RuntimeError("no")

    monkeypatch.setitem(files._WRITERS, ".xyz", broken)
    with pytest.raises(RuntimeError):
        write_cloud(tmp_path / "out.xyz", Cloud(np.zeros((1, 3))))
    assert list(tmp_path.iterdir()) == []


def test_an_export_that_fails_leaves_no_mesh(tmp_path, monkeypatch):
    mesh = trimesh.creation.box()
    monkeypatch.setattr(mesh, "export", lambda **_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        write_mesh(tmp_path / "out.stl", mesh)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["out.docx", "out"])
def test_clouds_of_an_unknown_kind_are_not_written(tmp_path, name):
    with pytest.raises(OutputError, match=r"unknown file type .*; choose one of: .ply, .xyz"):
        write_cloud(tmp_path / name, Cloud(np.zeros((1, 3))))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("out.plyy", "cannot write files ending in '.plyy'; Did you mean '.ply'? choose one of: .ply, .xyz"),
        ("out", "cannot write files ending in 'nothing'; choose one of: .ply, .xyz"),
        ("none/out.ply", "does not exist; create it first"),
        ("folder.ply", "is a folder; give a file name"),
        ("file.txt/out.ply", "does not exist; create it first"),
    ],
)
def test_what_cannot_be_written_is_known_beforehand(tmp_path, name, message):
    (tmp_path / "folder.ply").mkdir()
    (tmp_path / "file.txt").write_text("")
    with pytest.raises(OutputError) as caught:
        check_writable(tmp_path / name, KNOWN)
    assert str(caught.value).startswith(f"{tmp_path / name}: ") and message in str(caught.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file.txt", "folder.ply"]


@pytest.mark.parametrize("name", ["out.ply", "OUT.PLY", "old.xyz"])
def test_what_can_be_written_passes_and_nothing_is_made(tmp_path, name):
    (tmp_path / "old.xyz").write_text("old")
    check_writable(tmp_path / name, KNOWN)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"old.xyz": "old"}


# Permission bits do not stop an administrator, as tests in containers are run, so the system's answers are set.
def test_folders_without_permission_are_known_beforehand(tmp_path, monkeypatch):
    def denied(**_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(tempfile, "TemporaryFile", denied)
    with pytest.raises(OutputError, match=r"cannot write there \(Permission denied\); choose another folder with -o"):
        check_writable(tmp_path / "out.ply", KNOWN)


def test_read_only_files_are_known_beforehand(tmp_path, monkeypatch):
    (tmp_path / "out.ply").write_text("old")
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
    with pytest.raises(OutputError, match="exists and is read-only; choose another name"):
        check_writable(tmp_path / "out.ply", KNOWN)


def test_a_folder_that_will_be_made_is_no_mistake_where_it_can_be(tmp_path):
    (tmp_path / "file.txt").write_text("")
    check_writable(tmp_path / "new" / "deeper" / "out.ply", KNOWN, new_folder=True)
    with pytest.raises(OutputError, match=r"out.ply: .*file.txt is a file, not a folder; choose another folder"):
        check_writable(tmp_path / "file.txt" / "deeper" / "out.ply", KNOWN, new_folder=True)
    assert [path.name for path in tmp_path.iterdir()] == ["file.txt"]
