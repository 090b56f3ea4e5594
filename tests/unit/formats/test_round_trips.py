"""What every format keeps: coordinates, rows and their order, attributes."""

import numpy as np
import pytest

from n2n.formats import CLOUD_EXTENSIONS_READ, CLOUD_EXTENSIONS_WRITE, Cloud, read_cloud, write_cloud

UNNAMED = (".xyz", ".txt", ".pts", ".asc", ".npy")
WITH_TEXTS = (".xyz", ".txt", ".csv", ".pts", ".asc", ".npz")
TYPED = (".ply", ".npz", ".pcd", ".las", ".laz")


def survey() -> Cloud:
    random = np.random.default_rng(0)
    points = random.normal(size=(300, 3)) * [40, 30, 5] + [5e5, 5e6, 100]
    attributes = {
        "red": random.integers(0, 256, 300, dtype=np.uint8),
        "label": random.integers(-9, 9, 300, dtype=np.int32),
        "reflectance": random.random(300, dtype=np.float32),
        "seconds": 1.5e9 + random.random(300).round(5),
    }
    return Cloud(points, attributes)


def test_what_is_written_can_be_read():
    assert set(CLOUD_EXTENSIONS_WRITE) < set(CLOUD_EXTENSIONS_READ)


@pytest.mark.parametrize("extension", CLOUD_EXTENSIONS_WRITE)
def test_utm_coordinates_rows_and_attributes_are_kept(tmp_path, extension):
    cloud = survey()
    write_cloud(tmp_path / f"scan{extension}", cloud)
    back = read_cloud(tmp_path / f"scan{extension}")
    assert back.points.dtype == np.float64
    assert np.abs(back.points - cloud.points).max() < 1e-6
    names = [f"column{i}" for i in range(3, 7)] if extension in UNNAMED else list(cloud.attributes)
    for name, values in zip(names, cloud.attributes.values(), strict=True):
        np.testing.assert_allclose(back.attributes[name], values, rtol=1e-8 if values.dtype == np.float32 else 1e-15)
        if extension in TYPED and not (extension in (".las", ".laz") and name == "red"):
            assert back.attributes[name].dtype == values.dtype, name


@pytest.mark.parametrize("extension", sorted(set(CLOUD_EXTENSIONS_WRITE) - {".las", ".laz"}))
def test_rows_that_are_not_finite_stay_where_they_are(tmp_path, extension):
    cloud = survey()
    cloud.points[[0, 7]], cloud.points[299, 2] = np.nan, -np.inf
    write_cloud(tmp_path / f"scan{extension}", cloud)
    back = read_cloud(tmp_path / f"scan{extension}")
    assert len(back) == 300 and np.flatnonzero(~back.finite()).tolist() == [0, 7, 299]
    assert back.points[299, 2] == -np.inf and np.isnan(back.points[7]).all()


@pytest.mark.parametrize("extension", CLOUD_EXTENSIONS_WRITE)
def test_an_attribute_called_like_a_coordinate_does_not_replace_it(tmp_path, extension):
    cloud = Cloud(np.array([[1.0, 2, 3], [4, 5, 6]]), {"x": np.array([7.0, 8]), "Z": np.array([9.0, 9])})
    write_cloud(tmp_path / f"scan{extension}", cloud)
    back = read_cloud(tmp_path / f"scan{extension}")
    np.testing.assert_allclose(back.points, cloud.points, atol=1e-8)
    assert any(values.tolist() == [7, 8] for values in back.attributes.values())


@pytest.mark.parametrize("extension", sorted(set(CLOUD_EXTENSIONS_WRITE) - set(WITH_TEXTS)))
def test_texts_are_left_out_where_a_format_has_none(tmp_path, extension):
    with pytest.warns(UserWarning, match=f"{extension[1:]} cannot store texts: station left out; write csv or npz"):
        write_cloud(tmp_path / f"scan{extension}", Cloud(np.eye(3), {"station": np.array(["a", "b", "c"])}))
    np.testing.assert_allclose(read_cloud(tmp_path / f"scan{extension}").points, np.eye(3), atol=1e-8)


@pytest.mark.parametrize("extension", WITH_TEXTS)
def test_texts_are_kept_whatever_is_in_them(tmp_path, extension):
    texts = ["wall", "", "two words", " blanks ", "a,b", "a;b", '5" pipe', '"quoted"', "# 7", "http://x", "nan", "Höhe"]
    cloud = Cloud(np.arange(36.0).reshape(12, 3), {"label": np.array(texts), "number": np.arange(12)})
    write_cloud(tmp_path / f"scan{extension}", cloud)
    back = read_cloud(tmp_path / f"scan{extension}")
    names = ["column3", "column4"] if extension in UNNAMED else ["label", "number"]
    assert [text.strip() for text in back.attributes[names[0]].tolist()] == [text.strip() for text in texts]
    np.testing.assert_array_equal(back.attributes[names[1]], np.arange(12))
    np.testing.assert_array_equal(back.points, cloud.points)


@pytest.mark.parametrize("extension", CLOUD_EXTENSIONS_WRITE)
def test_the_case_of_an_extension_does_not_matter(tmp_path, extension):
    write_cloud(tmp_path / f"scan{extension.upper()}", Cloud(np.eye(3)))
    np.testing.assert_allclose(read_cloud(tmp_path / f"scan{extension.upper()}").points, np.eye(3), atol=1e-8)


def test_replacing_points_repeats_the_attributes_of_their_rows():
    cloud = Cloud(np.zeros((2, 3)), {"label": np.array([7, 8]), "rgb": np.array([[1, 2, 3], [4, 5, 6]])}, {"k": 1})
    more = cloud.replace(np.ones((3, 3)), np.array([1, 0, 1]))
    assert more.attributes["label"].tolist() == [8, 7, 8]
    assert more.attributes["rgb"].tolist() == [[4, 5, 6], [1, 2, 3], [4, 5, 6]]
    assert more.meta == {"k": 1} and more.points.tolist() == np.ones((3, 3)).tolist()
    assert cloud.points.tolist() == np.zeros((2, 3)).tolist()
