"""LAS and LAZ, against laspy."""

import laspy
import numpy as np
import pytest

from n2n.formats import Cloud, read_cloud, write_cloud

UTM = np.array([[500000.123, 5000000.568, 100.25], [500001.5, 5000040.0, 99.0], [500020.0, 5000010.0, 101.0]])


@pytest.fixture(params=["las", "laz"])
def survey(tmp_path, request):
    """A file as a surveyor's software writes it: scaled integers, standard and own dimensions, coordinate system."""
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = np.full(3, 0.001), np.array([5e5, 5e6, 0])
    header.system_identifier = "drone 7"
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "keys", np.array([1, 1, 0, 0], "<u2").tobytes()))
    header.add_extra_dim(laspy.ExtraBytesParams("reflectance", "f4"))
    header.add_extra_dim(laspy.ExtraBytesParams("range", "i4", scales=np.array([0.01]), offsets=np.array([0.0])))
    file = laspy.LasData(header)
    file.x, file.y, file.z = UTM.T
    file.intensity, file.red = np.array([7, 65535, 0]), np.array([1, 2, 3])
    file.return_number, file.classification = np.array([1, 2, 1]), np.array([2, 5, 6])
    file.gps_time = np.array([1.5e9 + 0.25, 1.5e9, 0])
    file.reflectance = np.array([0.5, -1.25, 0], np.float32)
    file["range"] = np.array([12.34, 5, 0])
    path = tmp_path / f"survey.{request.param}"
    file.write(path)
    return path


def test_points_and_dimensions_are_read_with_their_types(survey):
    cloud = read_cloud(survey)
    assert cloud.points.dtype == np.float64
    np.testing.assert_allclose(cloud.points, UTM, rtol=0, atol=1e-8)
    expected = {
        "intensity": ("uint16", [7, 65535, 0]),
        "red": ("uint16", [1, 2, 3]),
        "return_number": ("uint8", [1, 2, 1]),
        "classification": ("uint8", [2, 5, 6]),
        "gps_time": ("float64", [1.5e9 + 0.25, 1.5e9, 0]),
        "reflectance": ("float32", [0.5, -1.25, 0]),
    }
    for name, (dtype, values) in expected.items():
        assert (str(cloud.attributes[name].dtype), cloud.attributes[name].tolist()) == (dtype, values)
    np.testing.assert_allclose(cloud.attributes["range"], [12.34, 5, 0])


@pytest.mark.parametrize("extension", ["las", "laz"])
def test_a_survey_is_written_back_with_all_it_had(survey, tmp_path, extension):
    cloud = read_cloud(survey)
    write_cloud(tmp_path / f"out.{extension}", cloud.replace(cloud.points + [0.0001, 0, 0]))
    before, after = laspy.read(survey), laspy.read(tmp_path / f"out.{extension}")
    assert np.abs(after.xyz - UTM - [0.0001, 0, 0]).max() < 1e-7
    assert list(after.point_format.dimension_names) == list(before.point_format.dimension_names)
    for name in before.point_format.dimension_names:
        if name not in ("X", "Y", "Z"):
            assert np.array_equal(after[name], before[name]), name
    assert (after.header.version, after.header.point_format.id) == (before.header.version, 3)
    assert after.header.system_identifier == "drone 7"
    # Without it the same GPS times mean other days.
    assert after.header.global_encoding.gps_time_type == laspy.header.GpsTimeType.STANDARD
    assert [vlr.record_id for vlr in after.header.vlrs if vlr.user_id == "LASF_Projection"] == [34735]
    np.testing.assert_allclose(after.header.mins, after.xyz.min(axis=0))


def test_more_points_than_were_read_can_be_written(survey, tmp_path):
    cloud = read_cloud(survey)
    rows = np.array([0, 1, 2, 2, 0])
    write_cloud(tmp_path / "out.las", cloud.replace(cloud.points[rows], rows))
    after = laspy.read(tmp_path / "out.las")
    assert list(after.classification) == [2, 5, 6, 6, 2]
    assert read_cloud(survey).points.shape == (3, 3)


@pytest.mark.parametrize("extension", ["las", "laz"])
def test_a_cloud_from_elsewhere_gets_colours_and_own_dimensions(tmp_path, extension):
    attributes = {
        "red": np.array([1, 2, 255], np.uint8),
        "green": np.array([4, 5, 6], np.uint8),
        "blue": np.array([7, 8, 9], np.uint8),
        "classification": np.array([2, 5, 6]),
        "weight": np.array([0.5, np.nan, 1], np.float32),
        "inside": np.array([True, False, True]),
        "half": np.array([0.5, 1, 2], np.float16),
        "normal": np.eye(3),
    }
    write_cloud(tmp_path / f"out.{extension}", Cloud(UTM, attributes))
    file = laspy.read(tmp_path / f"out.{extension}")
    assert np.abs(file.xyz - UTM).max() < 1e-7
    assert (file.red.tolist(), file.classification.tolist()) == ([1, 2, 255], [2, 5, 6])
    assert file.weight.dtype == np.float32
    np.testing.assert_array_equal(file.weight, attributes["weight"])
    assert (file.inside.tolist(), file.half.tolist(), file.normal_1.tolist()) == ([1, 0, 1], [0.5, 1, 2], [0, 1, 0])


def test_values_a_standard_dimension_cannot_hold_get_one_of_their_own(tmp_path):
    attributes = {
        "intensity": np.array([0.1, 0.5, 0.9]),
        "classification": np.array([300, -1, 2]),
        "return_number": np.array([1, 2, 15]),
    }
    write_cloud(tmp_path / "out.las", Cloud(UTM, attributes))
    file = laspy.read(tmp_path / "out.las")
    assert file["intensity_"].tolist() == [0.1, 0.5, 0.9]
    assert file["classification_"].tolist() == [300, -1, 2]
    assert list(file.return_number) == [1, 2, 15]


@pytest.mark.parametrize("extent", [1e-6, 0.05, 3.0, 4e4, 1e7])
@pytest.mark.parametrize("corner", [0.0, 0.9, -123.456, 5e6])
def test_the_integers_resolve_every_extent(tmp_path, extent, corner):
    points = corner + extent * np.random.default_rng(0).random((100, 3))
    write_cloud(tmp_path / "out.las", Cloud(points))
    assert np.abs(laspy.read(tmp_path / "out.las").xyz - points).max() < 1e-8 * extent + 1e-14 * abs(corner)


def test_rows_that_are_not_finite_stay_in_their_place_with_a_warning(tmp_path):
    points = np.vstack([UTM, [np.nan, 0, 0], [0, np.inf, 0]])[[0, 3, 1, 4, 2]]
    with pytest.warns(UserWarning, match="las cannot store the 2 rows that are NaN or infinite"):
        write_cloud(tmp_path / "out.las", Cloud(points))
    file = laspy.read(tmp_path / "out.las")
    assert len(file.points) == 5
    assert np.abs(file.xyz[[0, 2, 4]] - UTM).max() < 1e-7
