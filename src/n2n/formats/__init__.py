"""Read and write point clouds and meshes; numpy only, float64 coordinates, attributes kept."""

from n2n.formats.atomic import atomic_path, check_writable
from n2n.formats.cloud import Cloud
from n2n.formats.files import CLOUD_EXTENSIONS_READ, CLOUD_EXTENSIONS_WRITE, read_cloud, write_cloud
from n2n.formats.meshes import MESH_EXTENSIONS_WRITE, write_mesh

__all__ = [
    "CLOUD_EXTENSIONS_READ",
    "CLOUD_EXTENSIONS_WRITE",
    "MESH_EXTENSIONS_WRITE",
    "Cloud",
    "atomic_path",
    "check_writable",
    "read_cloud",
    "write_cloud",
    "write_mesh",
]
