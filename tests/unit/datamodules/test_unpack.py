"""Archives unpack below the folder and nowhere else."""

import io
import tarfile
import zipfile

import pytest

from n2n.datamodules.unpack import unpack
from n2n.errors import InputError, OutputError

FILES = {"set/a.txt": b"a" * 5000, "set/deep/b.txt": b"b"}


def write_zip(path, files=FILES, compression=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", compression) as archive:
        archive.writestr("set/", b"")
        for name, content in files.items():
            archive.writestr(name, content)
    return path


def write_tar(path, members):
    with tarfile.open(path, "w:gz") as archive:
        for member, content in members:
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return path


def tree(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("kind", ["zip", "tar"])
def test_files_come_out_as_they_went_in(tmp_path, kind):
    path = tmp_path / "archive"  # without extension: told by content
    if kind == "zip":
        write_zip(path)
    else:
        write_tar(path, [(tarfile.TarInfo(name), content) for name, content in FILES.items()])
    told = []
    assert unpack(path, tmp_path / "out", lambda done, total: told.append((done, total))) == 2
    assert tree(tmp_path / "out") == FILES
    assert told[-1] == (5001, 5001)


def test_what_is_there_already_stays(tmp_path):
    archive = write_zip(tmp_path / "a.zip")
    (tmp_path / "out/set").mkdir(parents=True)
    (tmp_path / "out/set/a.txt").write_bytes(b"A" * 5000)
    (tmp_path / "out/set/own.txt").write_bytes(b"mine")
    unpack(archive, tmp_path / "out")
    assert tree(tmp_path / "out") == {**FILES, "set/a.txt": b"A" * 5000, "set/own.txt": b"mine"}


@pytest.mark.parametrize("name", ["../evil.txt", "/evil.txt", "set/../../evil.txt", "..\\evil.txt", "C:\\evil.txt"])
@pytest.mark.parametrize("kind", ["zip", "tar"])
def test_members_that_lead_out_are_refused_before_anything_is_written(tmp_path, kind, name):
    path, files = tmp_path / "in" / "archive", {**FILES, name: b"evil"}
    path.parent.mkdir()
    if kind == "zip":
        write_zip(path, files)
    else:
        write_tar(path, [(tarfile.TarInfo(key), content) for key, content in files.items()])
    with pytest.raises(InputError, match="leads out of the folder; nothing was unpacked"):
        unpack(path, tmp_path / "in" / "out")
    assert [p.name for p in tmp_path.rglob("*") if p.is_file()] == ["archive"]


def test_links_in_archives_are_refused(tmp_path):
    link = tarfile.TarInfo("set/link")
    link.type, link.linkname = tarfile.SYMTYPE, "/etc"
    with pytest.raises(InputError, match="link or a device"):
        unpack(write_tar(tmp_path / "a.tar.gz", [(link, b"")]), tmp_path / "out")
    info = zipfile.ZipInfo("set/link")
    info.external_attr = 0o120777 << 16
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr(info, "/etc")
    with pytest.raises(InputError, match="link or a device"):
        unpack(tmp_path / "a.zip", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_link_in_the_folder_is_not_followed(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out/set").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match="leads elsewhere"):
        unpack(write_zip(tmp_path / "a.zip"), tmp_path / "out")
    assert not any((tmp_path / "elsewhere").iterdir())


@pytest.mark.parametrize("content", [b"<html>sign in</html>", b""])
def test_a_web_page_is_no_archive(tmp_path, content):
    (tmp_path / "a.zip").write_bytes(content)
    with pytest.raises(InputError, match="no zip or tar archive"):
        unpack(tmp_path / "a.zip", tmp_path / "out")


def test_damage_leaves_no_half_file(tmp_path):
    archive = write_zip(tmp_path / "a.zip", compression=zipfile.ZIP_STORED)
    content = bytearray(archive.read_bytes())
    content[content.index(b"a" * 100) + 50] ^= 1
    archive.write_bytes(content)
    with pytest.raises(InputError, match="is damaged"):
        unpack(archive, tmp_path / "out")
    assert tree(tmp_path / "out") == {}
    whole = write_tar(tmp_path / "b.tar.gz", [(tarfile.TarInfo("set/c"), bytes(range(256)) * 4000)])
    whole.write_bytes(whole.read_bytes()[:-2000])
    with pytest.raises(InputError, match=r"is damaged|no zip or tar"):
        unpack(whole, tmp_path / "out")
    assert tree(tmp_path / "out") == {}
