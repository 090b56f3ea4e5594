"""NumPy files, against numpy itself."""

import numpy as np
import pytest

from n2n.errors import InputError
from n2n.formats import Cloud, read_cloud, write_cloud

UTM = np.array([[500000.1234, 5000000.5678, 100.25], [500001.5, np.nan, 99.0]])


@pytest.mark.parametrize("dtype", ["<f8", ">f8", "<f4", "<i4", "u1"])
def test_npy_of_any_number_type_becomes_float64(tmp_path, dtype):
    table = np.arange(15).reshape(3, 5).astype(dtype)
    np.save(tmp_path / "cloud.npy", table)
    cloud = read_cloud(tmp_path / "cloud.npy")
    assert cloud.points.dtype == np.float64 and cloud.points.tolist() == [[0, 1, 2], [5, 6, 7], [10, 11, 12]]
    assert {name: values.tolist() for name, values in cloud.attributes.items()} == {
        "column3": [3, 8, 13],
        "column4": [4, 9, 14],
    }
    assert cloud.attributes["column3"].dtype == np.dtype(dtype)


def test_npy_in_columns_first_order(tmp_path):
    np.save(tmp_path / "cloud.npy", np.asfortranarray(UTM))
    np.testing.assert_array_equal(read_cloud(tmp_path / "cloud.npy").points, UTM)


def test_npy_is_written_as_one_table(tmp_path):
    attributes = {"rgb": np.array([[1, 2], [3, 4]], np.uint8), "inside": np.array([True, False])}
    write_cloud(tmp_path / "out.npy", Cloud(UTM, attributes))
    table = np.load(tmp_path / "out.npy")
    assert table.dtype == np.float64
    np.testing.assert_array_equal(table, np.column_stack([UTM, [[1, 2], [3, 4]], [1, 0]]))


@pytest.mark.parametrize("key", ["points", "pos", "xyz", "noisy", "vertices", "anything"])
def test_npz_keeps_names_types_and_shapes(tmp_path, key):
    others = {
        "rgb": np.array([[1, 2, 3, 4], [4, 5, 6, 7]], np.uint8),
        "label": np.array([3, 2**40]),
        "inside": np.array([True, False]),
        "station": np.array(["north", "south"]),
    }
    np.savez(tmp_path / "in.npz", **{key: UTM}, **others, scale=2.0, triangles=np.zeros((7, 4)))
    cloud = read_cloud(tmp_path / "in.npz")
    np.testing.assert_array_equal(cloud.points, UTM)
    write_cloud(tmp_path / "out.npz", cloud.replace(cloud.points + 1))
    with np.load(tmp_path / "out.npz") as out:
        assert set(out.files) == {key, *others}
        np.testing.assert_array_equal(out[key], UTM + 1)
        for name, values in others.items():
            assert out[name].dtype == values.dtype and np.array_equal(out[name], values)


def test_npz_with_two_candidates_takes_the_one_with_a_known_name(tmp_path):
    np.savez(tmp_path / "in.npz", normals=np.ones((2, 3)), points=UTM)
    cloud = read_cloud(tmp_path / "in.npz")
    np.testing.assert_array_equal(cloud.points, UTM)
    assert cloud.attributes["normals"].tolist() == np.ones((2, 3)).tolist()


def test_npz_with_two_unknown_candidates_is_refused_with_what_it_holds(tmp_path):
    np.savez(tmp_path / "in.npz", a=UTM, b=UTM)
    with pytest.raises(InputError, match=r"no array named points, pos, .* it holds a \(2, 3\), b \(2, 3\)"):
        read_cloud(tmp_path / "in.npz")


def test_pickles_are_not_run(tmp_path):
    class Trap:
        def __reduce__(self):
            return (pytest.fail, ("the pickle was run",))

    trap = np.array([[Trap(), 1, 2]], dtype=object)
    np.save(tmp_path / "trap.npy", trap)
    np.savez(tmp_path / "trap.npz", points=trap)
    for name in ("trap.npy", "trap.npz"):
        with pytest.raises(InputError, match="Object arrays cannot be loaded"):
            read_cloud(tmp_path / name)
