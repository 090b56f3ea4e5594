import numpy as np
import trimesh

from n2n.geometry.components import drop_small_components


def test_a_speck_goes_and_the_rest_is_untouched():
    big, small = trimesh.creation.icosphere(3), trimesh.creation.icosphere(1, radius=0.02)
    both = trimesh.util.concatenate([small, big])
    vertices, faces = drop_small_components(np.asarray(both.vertices), np.asarray(both.faces), 0.01)
    kept = trimesh.Trimesh(vertices, faces, process=False)
    assert kept.body_count == 1 and kept.is_watertight and np.isclose(kept.area, big.area)


def test_fraction_zero_keeps_everything():
    both = trimesh.util.concatenate([trimesh.creation.icosphere(1, radius=0.02), trimesh.creation.icosphere(2)])
    vertices, faces = drop_small_components(np.asarray(both.vertices), np.asarray(both.faces), 0.0)
    assert len(vertices) == len(both.vertices) and len(faces) == len(both.faces)
