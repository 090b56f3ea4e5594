"""Files that are not what their name says: one line that names the file, no warning, no guess."""

import io
import logging
import warnings
from pathlib import Path

import laspy
import numpy as np
import pytest
import trimesh

from n2n.errors import InputError
from n2n.formats import CLOUD_EXTENSIONS_READ, read_cloud

TEXT = (".xyz", ".txt", ".csv", ".pts", ".asc")
PLY = "ply\nformat {} 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty {}\nproperty uchar red\n"
PCD = "FIELDS x y z label\nSIZE 8 8 8 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA {}\n"


def message(path, caplog) -> str:
    """Read a file that cannot be read; return the complaint without the file's name."""
    with warnings.catch_warnings(record=True) as caught, caplog.at_level(logging.WARNING):
        warnings.simplefilter("always")
        with pytest.raises(InputError) as refused:
            read_cloud(path)
    text = str(refused.value)
    assert text.startswith(f"{path}: ")
    assert len(text.splitlines()) == 1 and len(text) < len(str(path)) + 300
    # They would stand beside the error on the screen.
    assert [str(w.message) for w in caught] == [] and caplog.records == []
    return text.removeprefix(f"{path}: ")


def sound() -> dict[str, bytes]:
    """Return a file of every kind with 60 points, made without n2n."""
    points = np.random.default_rng(0).normal(size=(60, 3)) + 10
    lines = [" ".join(f"{value:.4f}" for value in row) for row in points]
    npy, npz, las = io.BytesIO(), io.BytesIO(), {}
    np.save(npy, points)
    np.savez(npz, points=points)
    for extension in (".las", ".laz"):
        file = laspy.create(point_format=6, file_version="1.4")
        file.header.scales = np.full(3, 1e-4)
        file.x, file.y, file.z = points.T
        las[extension] = io.BytesIO()
        file.write(las[extension], do_compress=extension == ".laz")
    mesh = trimesh.convex.convex_hull(points)
    rows = np.zeros(60, "<f8, <f8, <f8, u1")
    for name, axis in zip(rows.dtype.names, points.T, strict=False):
        rows[name] = axis
    return {
        ".ply": (PLY.format("binary_little_endian", 60, "double z") + "end_header\n").encode() + rows.tobytes(),
        **dict.fromkeys(TEXT, "\n".join(lines).encode()),
        ".csv": "\n".join(lines).replace(" ", ",").encode(),
        ".pts": "\n".join(["60", *lines]).encode(),
        ".npy": npy.getvalue(),
        ".npz": npz.getvalue(),
        ".off": mesh.export(file_type="off").encode(),
        ".obj": "".join(f"v {line}\n" for line in lines).encode(),
        ".stl": mesh.export(file_type="stl"),
        ".pcd": b"FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nPOINTS 60\nDATA binary\n" + points.astype("<f8").tobytes(),
        ".las": las[".las"].getvalue(),
        ".laz": las[".laz"].getvalue(),
        ".bin": np.hstack([points, points[:, :1]]).astype("<f4").tobytes(),
    }


SOUND = sound()


@pytest.mark.parametrize("extension", CLOUD_EXTENSIONS_READ)
def test_sound_files_are_read(tmp_path, extension):
    (tmp_path / f"scan{extension}").write_bytes(SOUND[extension])
    assert len(read_cloud(tmp_path / f"scan{extension}")) > 20


@pytest.mark.parametrize("extension", CLOUD_EXTENSIONS_READ)
def test_empty_files(tmp_path, extension, caplog):
    (tmp_path / f"scan{extension}").write_bytes(b"")
    assert message(tmp_path / f"scan{extension}", caplog) == "the file is empty"


@pytest.mark.parametrize("size", [16, 1600, 20_000])
@pytest.mark.parametrize("extension", CLOUD_EXTENSIONS_READ)
def test_binary_rubbish(tmp_path, extension, size, caplog):
    (tmp_path / f"scan{extension}").write_bytes(np.random.default_rng(size).bytes(size))
    message(tmp_path / f"scan{extension}", caplog)


@pytest.mark.parametrize("extension", CLOUD_EXTENSIONS_READ)
def test_prose(tmp_path, extension, caplog):
    # 640 bytes: a whole number of KITTI points.
    (tmp_path / f"scan{extension}").write_text("Roses are red,\nviolets are blue.\n".ljust(40, "\n") * 16)
    message(tmp_path / f"scan{extension}", caplog)


@pytest.mark.parametrize("extension", CLOUD_EXTENSIONS_READ)
def test_files_of_another_kind(tmp_path, extension, caplog):
    same = {".las": (".laz",), ".laz": (".las",), **dict.fromkeys(TEXT, TEXT)}.get(extension, ())
    for other in set(CLOUD_EXTENSIONS_READ) - {extension, *same}:
        path = tmp_path / f"in_truth_{other[1:]}{extension}"
        path.write_bytes(SOUND[other])
        message(path, caplog)


@pytest.mark.parametrize("part", [0.02, 0.3, 0.9, 0.97])
@pytest.mark.parametrize("extension", [".ply", ".pts", ".npy", ".npz", ".off", ".stl", ".pcd", ".las", ".laz"])
def test_files_cut_off(tmp_path, extension, part, caplog):
    content = SOUND[extension]
    if extension == ".off":
        # Only vertices are read, so only there a cut is felt.
        content = content[: content.index(b"\n3 ")]
    (tmp_path / f"scan{extension}").write_bytes(content[: int(part * len(content))])
    message(tmp_path / f"scan{extension}", caplog)


CASES = {
    "blank.xyz": (" \n\n", "holds no points"),
    "comment.xyz": ("# x y z\n", "holds no points"),
    "count.pts": ("5\n", "holds no points"),
    "header.csv": ("x,y,z\n", "holds no points"),
    "two_columns.xyz": ("1 2\n3 4\n", "2 column(s) found, at least x y z are needed"),
    "short_row.xyz": ("# by hand\n1 2 3\n4 5\n", "line 3 has another number of columns than the first"),
    "long_row.xyz": ("1 2 3\n4 5 6\n7 8 9 10\n", "line 3 has another number of columns than the first"),
    "letter.xyz": ("1 2 3\n4 5 x\n", "line 2 is not numbers ('x' in column 3, which is taken for z); mend"),
    "two_headers.xyz": ("scan of\na house\n1 2 3\n", "line 2 is not numbers ('a house'); expected x y z per line"),
    "missing_value.csv": ("x,y,z\n1,2,3\n4,,6\n", "line 3 is not numbers"),
    "text_first.csv": (
        "wall,1,2,3\nroof,4,5,6\n",
        "line 1 is not numbers ('wall' in column 1, which is taken for x); mend it, or name the columns",
    ),
    "wide_text.csv": (
        "x,y,z,label\n1,2,3,wall\n\n4,5,6,7,roof\n",
        "line 4 has another number of columns than the first",
    ),
    "page.csv": ("<html>\n<body>\n", "line 2 is not numbers ('<body>')"),
    "decimal_comma.csv": ("1,5;2,5;3,5\n", "line 1 is not numbers"),
    "cut.pts": ("5\n1 2 3\n4 5 6\n", "the first line promises 5 points, the file holds 2; it is cut off"),
    "latin.txt": (b"H\xf6he 1 2 3\n", "is not text (byte 1 cannot be decoded)"),
    "nul.txt": (b"1 2 3\x00\n", "is binary, not text"),
    "flat.npy": (np.arange(9.0), "expected numbers of shape (n, 3 or more), got float64 (9,)"),
    "two_columns.npy": (np.zeros((5, 2)), "expected numbers of shape (n, 3 or more), got float64 (5, 2)"),
    "words.npy": (np.array([["a", "b", "c"]]), "expected numbers of shape (n, 3 or more), got <U1 (1, 3)"),
    "no_rows.npy": (np.zeros((0, 3)), "holds no points"),
    "old.npy": (b"\x93NUMPY" + bytes(100), "is not a readable npy file"),
    "archive.npz": (b"PK", "is no .npz archive, or cut off"),
    "unfinished.ply": (PLY.format("ascii", 2, "double z"), "is not a readable ply file"),
    "no_z.ply": (PLY.format("ascii", 1, "double w") + "end_header\n1 2 3 4\n", "has no vertex property 'z'"),
    "no_vertex.ply": (PLY.format("ascii", 0, "double z") + "end_header\n", "holds no vertices"),
    "words.ply": (PLY.format("ascii", 1, "double z") + "end_header\n1 2 c 4\n", "is not a readable ply file"),
    "type.ply": (PLY.format("ascii", 1, "quad z") + "end_header\n1 2 3 4\n", "is not a readable ply file ('quad')"),
    "count.ply": (PLY.format("ascii", "two", "double z") + "end_header\n1 2 3 4\n", "is not a readable ply file"),
    "magic.ply": ("plx\n" + PLY.format("ascii", 1, "double z"), "does not start with 'ply', so it is no PLY file"),
    "few_rows.ply": (PLY.format("ascii", 3, "double z") + "end_header\n1 2 3 4\n", "it is cut off"),
    "cut_row.ply": (PLY.format("ascii", 2, "double z") + "end_header\n1 2 3 4\n1 2", "it is cut off"),
    # Only an attribute is missing, but what else is?
    "cut_label.ply": (PLY.format("ascii", 2, "double z") + "end_header\n1 2 3 4\n1 2 3\n", "it is cut off"),
    "no_labels.ply": (PLY.format("ascii", 2, "double z") + "end_header\n1 2 3\n1 2 3\n", "is not a readable ply file"),
    "no_data.pcd": (PCD.split("DATA")[0], "has no PCD header (no DATA line)"),
    "no_encoding.pcd": (PCD.format(""), "is not a readable pcd file"),
    "encoding.pcd": (PCD.format("zip"), "DATA zip is no PCD encoding; known: ascii, binary, binary_compressed"),
    "no_sizes.pcd": (PCD.replace("SIZE", "SIZES").format("binary"), "the PCD header has no SIZE line"),
    "few_sizes.pcd": (PCD.replace("8 8 8", "8 8").format("binary"), "is not a readable pcd file"),
    "type.pcd": (PCD.replace("F F F U", "F F F Q").format("binary"), "is not a readable pcd file"),
    "no_z.pcd": (PCD.replace("y z", "y w").format("ascii") + "1 2 3 4\n" * 2, "has no field 'z'; fields: x, y, w"),
    "no_rows.pcd": (PCD.format("ascii"), "the header promises 2 points, the file holds 0; it is cut off"),
    "few_rows.pcd": (
        PCD.format("ascii") + "1 2 3 4\n",
        "the header promises 2 points, the file holds 1; it is cut",
    ),
    "narrow.pcd": (PCD.format("ascii") + "1 2 3\n" * 2, "the header promises 4 values a point, the lines hold 3"),
    "wide.pcd": (PCD.format("ascii") + "1 2 3 4 5\n" * 2, "the header promises 4 values a point, the lines hold 5"),
    "words.pcd": (PCD.format("ascii") + "a b c d\n" * 2, "is not a readable pcd file"),
    "packed.pcd": (PCD.format("binary_compressed").encode() + bytes([3, 0, 0, 0, 56, 0, 0, 0, 5, 1, 2]), "56 expected"),
    "before.pcd": (PCD.format("binary_compressed").encode() + bytes([3, 0, 0, 0, 56, 0, 0, 0, 32, 9, 9]), "corrupt"),
    "magic.off": ("OFG\n1 0 0\n1 2 3\n", "does not start with OFF"),
    "alone.off": ("OFF", "is not a readable off file"),
    "words.off": ("OFF\n1 0 0\n1 b 3\n", "is not a readable off file"),
    "flat.off": ("OFF\n3 0 0\n1 2\n3 4\n5 6\n", "has vertices of fewer than three coordinates"),
    "none.off": ("OFF\n0 0 0\n", "holds no points"),
    "faces.obj": ("f 1 2 3\n", "holds no vertices (no line starts with 'v ')"),
    "flat.obj": ("v 1 2\nv 3 4\n", "has vertices of fewer than three coordinates"),
    "words.obj": ("v 1 2 x\n", "is not a readable obj file"),
    "none.stl": ("solid none\nendsolid none\n", "holds no triangles, is cut off or is no STL file"),
    "cut.stl": ("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n", "holds no triangles"),
    "odd.bin": (b"\0" * 17, "17 bytes are no whole number of 16-byte KITTI points"),
    "origin.bin": (b"\0" * 160, "the bytes are no KITTI points"),
    "numbers.bin": ("1.25 2.50 3.75 4.00\n" * 4, "the bytes are no KITTI points"),
    "gaps.bin": (np.full((5, 4), np.nan, "<f4").tobytes(), "the bytes are no KITTI points"),
    "picture.jpg": (b"\xff\xd8\xff", "unknown file type '.jpg'"),
    "scan": ("1 2 3\n", "unknown file type 'without extension'"),
    "scan.xzy": ("1 2 3\n", "unknown file type '.xzy'; Did you mean '.xyz'?"),
}


@pytest.mark.parametrize("name", CASES)
def test_complaints(tmp_path, name, caplog):
    content, expected = CASES[name]
    path = tmp_path / name
    if isinstance(content, np.ndarray):
        np.save(path, content)
    else:
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    assert expected in message(path, caplog)


def test_an_archive_without_points(tmp_path, caplog):
    np.savez(tmp_path / "empty.npz")
    assert message(tmp_path / "empty.npz", caplog).endswith("it holds nothing")
    np.savez(tmp_path / "other.npz", weights=np.zeros((5, 4)))
    assert message(tmp_path / "other.npz", caplog).endswith("it holds weights (5, 4)")


@pytest.mark.parametrize("extension", [".las", ".laz"])
def test_a_survey_without_points(tmp_path, extension, caplog):
    laspy.create().write(tmp_path / f"none{extension}")
    assert message(tmp_path / f"none{extension}", caplog) == "holds no points"


def test_folders_and_missing_files(tmp_path, caplog):
    (tmp_path / "folder.ply").mkdir()
    assert message(tmp_path / "folder.ply", caplog) == "is a folder; give a point cloud file"
    assert message(tmp_path / "none.ply", caplog) == "no such file"


def test_a_folder_that_may_not_be_entered(tmp_path, caplog, monkeypatch):
    def denied(self):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "is_dir", denied)
    assert message(tmp_path / "scan.ply", caplog) == "cannot be read (Permission denied)"
