"""Points and meshes to a picture."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from n2n.report.camera import Camera
from n2n.report.raster import Seen, nearest_sphere, nearest_triangle
from n2n.report.shading import KEY, shade

_SUPERSAMPLING = 2


@dataclass(frozen=True)
class Spheres:
    """A cloud drawn as small spheres.

    Attributes:
        points: (n, 3) world.
        colour: (3,) or (n, 3), 0 to 1.
        radius: World units.
    """

    points: NDArray[np.float64]
    colour: NDArray[np.float64]
    radius: float


@dataclass(frozen=True)
class Surface:
    """A triangle mesh with smooth shading.

    Attributes:
        vertices: (v, 3) world.
        faces: (f, 3).
        colour: (3,) or (v, 3), 0 to 1.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    colour: NDArray[np.float64]


Layer = Spheres | Surface


def render(layers: list[Layer], camera: Camera, size: int, shadow: bool = True) -> NDArray[np.uint8]:
    """Return a picture (h, w, 3) of layers that hide each other.

    Args:
        layers: What to draw.
        camera: From where.
        size: Pixels of the longer side.
        shadow: Draw the shadow on the ground.
    """
    height, width = camera.shape(size)
    shape = (_SUPERSAMPLING * height, _SUPERSAMPLING * width)
    seen, dark = Seen.nothing(shape), np.zeros(shape, bool)
    for layer in layers:
        if isinstance(layer, Spheres):
            radius = max(0.75, layer.radius * shape[1] / camera.extent[0])
            colour = np.broadcast_to(layer.colour, layer.points.shape)
            seen.add_spheres(camera.project(layer.points, shape), colour, radius)
            cast = nearest_sphere(camera.project(camera.on_ground(layer.points, KEY), shape), radius, shape)
        else:
            colour = np.broadcast_to(layer.colour, layer.vertices.shape)
            normal = vertex_normals(layer.vertices, layer.faces) @ camera.rotation.T
            seen.add_triangles(camera.project(layer.vertices, shape), normal, colour, layer.faces)
            fallen = camera.project(camera.on_ground(layer.vertices, KEY), shape)
            cast = nearest_triangle(fallen, layer.faces, shape)
        dark.reshape(-1)[cast[0]] = True
    image = shade(seen, dark if shadow else None)
    image = image.reshape(height, _SUPERSAMPLING, width, _SUPERSAMPLING, 3).mean(axis=(1, 3))
    return (255 * image).round().astype(np.uint8)


def vertex_normals(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return area-weighted normals (v, 3), not of unit length."""
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return np.stack(
        [
            sum(np.bincount(faces[:, k], weights=normal[:, axis], minlength=len(vertices)) for k in range(3))
            for axis in range(3)
        ],
        axis=1,
    )
