"""A download is whole or absent, resumes where that is safe, and is the same file as the first time."""

import hashlib
import json
import socket

import numpy as np
import pytest

from n2n.datamodules.download import CHECKSUMS, download
from n2n.errors import InputError, OutputError
from tests.unit.datamodules.server import Site, serve

CONTENT = np.random.default_rng(0).bytes(300_000)


@pytest.fixture
def site():
    with serve(Site(file=CONTENT)) as running:
        yield running


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_download_is_whole_and_its_checksum_recorded(site, tmp_path):
    told = []
    download(f"{site.url}/file", tmp_path / "new" / "a.zip", lambda done, total: told.append((done, total)))
    assert (tmp_path / "new" / "a.zip").read_bytes() == CONTENT
    assert told[0] == (0, len(CONTENT)) and told[-1] == (len(CONTENT), len(CONTENT))
    record = json.loads((tmp_path / "new" / CHECKSUMS).read_text())
    assert record == {f"{site.url}/file": {"sha256": hashlib.sha256(CONTENT).hexdigest(), "bytes": len(CONTENT)}}
    assert names(tmp_path / "new") == ["a.zip", CHECKSUMS]


def test_a_broken_transfer_goes_on_from_where_it_stopped(site, tmp_path):
    site.breaks = [100_000, 50_000]
    download(f"{site.url}/file", tmp_path / "a.zip")
    assert (tmp_path / "a.zip").read_bytes() == CONTENT
    assert site.asked == [None, "bytes=100000-", "bytes=150000-"]


def test_the_next_call_goes_on_from_where_the_last_one_gave_up(site, tmp_path):
    site.breaks = [70_000, 0, 0, 0]
    with pytest.raises(InputError, match=r"70,000 of 300,000 bytes|70,000 bytes are kept"):
        download(f"{site.url}/file", tmp_path / "a.zip")
    assert not (tmp_path / "a.zip").exists()
    site.asked.clear()
    download(f"{site.url}/file", tmp_path / "a.zip")
    assert site.asked == ["bytes=70000-"] and (tmp_path / "a.zip").read_bytes() == CONTENT


def test_a_server_without_ranges_sends_all_again(site, tmp_path):
    site.ranges, site.breaks = False, [100_000]
    download(f"{site.url}/file", tmp_path / "a.zip")
    assert (tmp_path / "a.zip").read_bytes() == CONTENT


def test_without_a_tag_nothing_is_resumed(site, tmp_path):
    site.tag, site.breaks = "", [100_000]
    download(f"{site.url}/file", tmp_path / "a.zip")
    assert site.asked == [None, None] and (tmp_path / "a.zip").read_bytes() == CONTENT


def test_halves_of_two_versions_are_not_joined(site, tmp_path):
    site.breaks = [100_000, 0, 0, 0]
    with pytest.raises(InputError):
        download(f"{site.url}/file", tmp_path / "a.zip")
    site.files["/file"], site.tag = CONTENT[::-1], '"2"'
    download(f"{site.url}/file", tmp_path / "a.zip")
    assert (tmp_path / "a.zip").read_bytes() == CONTENT[::-1]


def test_a_part_that_is_longer_than_the_file_starts_anew(site, tmp_path):
    (tmp_path / ".a.zip.part").write_bytes(bytes(len(CONTENT) + 5))
    (tmp_path / ".a.zip.tag").write_text(site.tag)
    download(f"{site.url}/file", tmp_path / "a.zip")
    assert (tmp_path / "a.zip").read_bytes() == CONTENT


def test_another_file_than_the_first_time_is_refused(site, tmp_path):
    download(f"{site.url}/file", tmp_path / "a.zip")
    (tmp_path / "a.zip").unlink()
    site.files["/file"], site.tag = b"x" + CONTENT[1:], '"2"'
    with pytest.raises(InputError, match=rf"SHA-256 .* first download.*{CHECKSUMS}"):
        download(f"{site.url}/file", tmp_path / "a.zip")
    assert names(tmp_path) == [".a.zip.tag", CHECKSUMS]
    site.files["/file"] = CONTENT
    download(f"{site.url}/file", tmp_path / "a.zip")
    assert names(tmp_path) == ["a.zip", CHECKSUMS]


def test_a_missing_file_and_an_absent_server_are_one_line(site, tmp_path):
    with pytest.raises(InputError, match="answers 404"):
        download(f"{site.url}/other", tmp_path / "a.zip")
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{unused.getsockname()[1]}/file"
    with pytest.raises(InputError, match=r"cannot reach 127\.0\.0\.1.*check the network") as caught:
        download(url, tmp_path / "a.zip")
    assert "\n" not in str(caught.value)


def test_a_silent_server_ends_in_a_message(tmp_path):
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        with pytest.raises(InputError, match="cannot reach"):
            download(f"http://127.0.0.1:{silent.getsockname()[1]}/file", tmp_path / "a.zip", timeout=0.2)


def test_a_file_in_the_way_of_the_folder(site, tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(OutputError, match="choose another folder"):
        download(f"{site.url}/file", tmp_path / "taken" / "a.zip")


def test_a_spoilt_record_of_checksums_is_named(site, tmp_path):
    (tmp_path / CHECKSUMS).write_text("[]")
    with pytest.raises(InputError, match=CHECKSUMS):
        download(f"{site.url}/file", tmp_path / "a.zip")
