"""Text clouds of every layout people write, against numpy and plain expectations."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from hypothesis.extra.numpy import arrays

from n2n.formats import Cloud, read_cloud, write_cloud

TWO = [[1, 2, 3], [4, 5, 6]]


LAYOUTS = [
    ("plain.xyz", "1 2 3\n4 5 6\n", TWO, {}),
    ("no_last_newline.xyz", "1 2 3\n4 5 6", TWO, {}),
    ("windows.xyz", "1 2 3\r\n4 5 6\r\n", TWO, {}),
    ("byte_order_mark.txt", "\ufeff1 2 3\n4 5 6\n", TWO, {}),
    ("tabs.txt", "1\t2\t3\n4\t5\t6\n", TWO, {}),
    ("aligned.xyz", "   1   2  3\n   4   5  6  \n", TWO, {}),
    ("every_way.xyz", "+1 2. 3e0\n4.0 .5E+1 6\n", TWO, {}),
    ("commas.csv", "1,2,3\n4,5,6\n", TWO, {}),
    ("commas_and_spaces.csv", "1, 2, 3\n4, 5, 6\n", TWO, {}),
    ("semicolons.csv", "1;2;3\n4;5;6\n", TWO, {}),
    ("more.txt", "1 2 3 7\n4 5 6 8\n", TWO, {"column3": [7, 8]}),
    ("header.csv", "x,y,z,label\n1,2,3,7\n4,5,6,8\n", TWO, {"label": [7, 8]}),
    ("quoted.csv", '"label", "Z", "Y", "X"\n7,3,2,1\n8,6,5,4\n', TWO, {"label": [7, 8]}),
    ("named.txt", "i X Y Z\n0 1 2 3\n1 4 5 6\n", TWO, {"i": [0, 1]}),
    ("short_header.txt", "scan\n1 2 3 7\n4 5 6 8\n", TWO, {"column3": [7, 8]}),
    ("index.csv", ",x,y,z\n0,1,2,3\n1,4,5,6\n", TWO, {"column0": [0, 1]}),
    ("twice.csv", "x,y,z,a,a\n1,2,3,7,8\n4,5,6,9,0\n", TWO, {"a_3": [7, 9], "a_4": [8, 0]}),
    ("comments.xyz", "# by hand\n\n1 2 3 # first\n// then, at last\n4 5 6 // second\n\n", TWO, {}),
    ("commented_header.txt", "# x y z intensity\n1 2 3 7\n4 5 6 8\n", TWO, {"intensity": [7, 8]}),
    ("cloudcompare.asc", "//X Y Z R\n2\n1 2 3 7\n4 5 6 8\n", TWO, {"R": [7, 8]}),
    ("leica.pts", "2\n1 2 3 7\n4 5 6 8\n", TWO, {"column3": [7, 8]}),
    ("count_and_header.pts", "2\nx y z i\n1 2 3 7\n4 5 6 8\n", TWO, {"i": [7, 8]}),
    ("no_count.pts", "1 2 3\n4 5 6\n", TWO, {}),
    ("prose.txt", "# my nice scan\n1 2 3\n4 5 6\n", TWO, {}),
    ("prose_of_four.txt", "# my nice long scan\n1 2 3 7\n4 5 6 8\n", TWO, {"column3": [7, 8]}),
    ("prose_then_header.txt", "# made by x\n# in metres\nx y z i\n1 2 3 7\n4 5 6 8\n", TWO, {"i": [7, 8]}),
    ("header_stays.txt", "i x y z\n# x y z w\n7 1 2 3\n8 4 5 6\n", TWO, {"i": [7, 8]}),
    ("title_of_numbers.txt", "scan of 2020 05 12\n1 2 3\n4 5 6\n", TWO, {}),
    ("texts.csv", "x,y,z,label,i\n1,2,3,wall,7\n4,5,6,roof,8\n", TWO, {"label": ["wall", "roof"], "i": [7, 8]}),
    ("texts_first.csv", "label,x,y,z\nwall,1,2,3\nroof,4,5,6\n", TWO, {"label": ["wall", "roof"]}),
    ("texts_unnamed.xyz", "1 2 3 wall\n4  5\t6  roof\n", TWO, {"column3": ["wall", "roof"]}),
    ("texts_later.csv", "x,y,z,i\n1,2,3,7\n\n4,5,6,\n", TWO, {"i": ["7", ""]}),
    (
        "texts_quoted.csv",
        '"x","y","z","what, where"\n1,2,3,"wall, outer" # a\n4,5,6,"#1 ""A"""\n',
        TWO,
        {"what, where": ["wall, outer", '#1 "A"']},
    ),
    ("gaps.xyz", "1 nan 3\ninf -INF NaN\n", [[1, np.nan, 3], [np.inf, -np.inf, np.nan]], {}),
    ("utm.xyz", "500000.1234 5000000.5678 100.25\n", [[500000.1234, 5000000.5678, 100.25]], {}),
]


@pytest.mark.parametrize(("name", "content", "points", "attributes"), LAYOUTS, ids=[row[0] for row in LAYOUTS])
def test_layouts(tmp_path, name, content, points, attributes):
    (tmp_path / name).write_bytes(content.encode())
    cloud = read_cloud(tmp_path / name)
    np.testing.assert_array_equal(cloud.points, points)
    assert cloud.points.dtype == np.float64
    assert {key: values.tolist() for key, values in cloud.attributes.items()} == attributes


@pytest.mark.parametrize(
    "content",
    [
        "1 2 3\n4 5 6\n",
        "1;2;3\n4;5;6\n",
        "label,z,y,x\n7,3,2,1\n8,6,5,4\n",
        "x,y,z,a,a\n1,2,3,7,8\n4,5,6,9,0\n",
        "2\n1 2 3 7\n4 5 6 8\n",
        "1 2 3 0.125\n4 5 6 nan\n",
        "# x y z intensity\n1 2 3 7\n4 5 6 8\n",
        "#label;x;y;z\n7;1;2;3\n",
        "//X Y Z R\n1 2 3 7\n4 5 6 8\n",
        "x,y,z,label,i\n1,2,3,wall,7.5\n4,5,6,,8.5\n",
        'label,x,y,z\n"wall, outer",1,2,3\nroof,4,5,6\n',
        "1 2 3 wall\n4 5 6 roof\n",
        # GPS time needs more digits than coordinates.
        "1 2 3 1234567890.12345\n4 5 6 1234567890.12346\n",
    ],
)
def test_a_text_file_is_written_back_in_its_own_layout(tmp_path, content):
    (tmp_path / "in.txt").write_text(content)
    write_cloud(tmp_path / "out.txt", read_cloud(tmp_path / "in.txt"))
    assert (tmp_path / "out.txt").read_text() == content


def test_a_new_csv_names_its_columns_and_a_new_pts_counts_its_points(tmp_path):
    cloud = Cloud(np.array(TWO, float), {"colour": np.array([[9, 8], [7, 6]], np.uint8), "weight": np.array([0.5, 1])})
    write_cloud(tmp_path / "new.csv", cloud)
    assert (tmp_path / "new.csv").read_text() == "x,y,z,colour_0,colour_1,weight\n1,2,3,9,8,0.5\n4,5,6,7,6,1\n"
    write_cloud(tmp_path / "new.pts", cloud)
    assert (tmp_path / "new.pts").read_text() == "2\n1 2 3 9 8 0.5\n4 5 6 7 6 1\n"


def test_numpy_reads_what_we_write(tmp_path):
    points = np.random.default_rng(0).normal(size=(100, 3)) + [5e5, 5e6, 100]
    write_cloud(tmp_path / "out.xyz", Cloud(points))
    assert np.abs(np.loadtxt(tmp_path / "out.xyz") - points).max() < 1e-8


def test_numpy_still_reads_a_file_whose_header_is_a_comment(tmp_path):
    table = np.arange(8.0).reshape(2, 4)
    np.savetxt(tmp_path / "in.txt", table, header="x y z intensity")
    write_cloud(tmp_path / "out.txt", read_cloud(tmp_path / "in.txt"))
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "out.txt"), table)
    # A table of another kind gets bare names in its first line.
    write_cloud(tmp_path / "out.csv", read_cloud(tmp_path / "in.txt"))
    assert (tmp_path / "out.csv").read_text().startswith("x,y,z,intensity\n0,1,2,3\n")


def test_prose_is_not_written_back_as_a_header(tmp_path):
    (tmp_path / "in.txt").write_text("# my nice scan\n1 2 3\n")
    write_cloud(tmp_path / "out.txt", read_cloud(tmp_path / "in.txt"))
    assert (tmp_path / "out.txt").read_text() == "1 2 3\n"


def test_single_precision_is_not_padded_with_noise(tmp_path):
    write_cloud(tmp_path / "out.xyz", Cloud(np.zeros((1, 3)), {"r": np.array([0.1], np.float32)}))
    assert (tmp_path / "out.xyz").read_text() == "0 0 0 0.100000001\n"


coordinates = some.floats(-1e8, 1e8) | some.sampled_from([np.nan, np.inf, -np.inf])
rows = some.integers(1, 8)


@settings(max_examples=60, deadline=None)
@given(
    rows.flatmap(lambda n: some.tuples(arrays(np.float64, (n, 3), elements=coordinates), arrays(np.int32, n))),
    some.sampled_from([".xyz", ".csv", ".pts"]),
)
def test_text_brings_points_back_to_nine_digits_and_labels_exactly(cloud, extension):
    points, label = cloud
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"cloud{extension}"
        write_cloud(path, Cloud(points, {"label": label}))
        back = read_cloud(path)
    np.testing.assert_allclose(back.points, points, rtol=0, atol=5.001e-9)
    (values,) = back.attributes.values()
    assert values.tolist() == label.tolist()
