from .files import load_mesh, save_mesh
from .gltf_json import Entry, gltf_document
from .kernels import (
    corner_sums,
    edge_lengths,
    face_areas,
    face_vectors,
    first_of_position,
    longest_edge,
    normals_of,
    shells,
    space_curve,
    split_long_edges,
)
from .materials import (
    MeshMaterials,
    Texture,
    barycentric,
    joined_materials,
    materials_within,
    renumbered,
    textures_in,
)
from .mesh import Axis, Mesh, fit_height, refine, submesh, weld

__all__ = [
    "Axis",
    "Entry",
    "Mesh",
    "MeshMaterials",
    "Texture",
    "barycentric",
    "corner_sums",
    "edge_lengths",
    "face_areas",
    "face_vectors",
    "first_of_position",
    "fit_height",
    "gltf_document",
    "joined_materials",
    "load_mesh",
    "longest_edge",
    "materials_within",
    "normals_of",
    "refine",
    "renumbered",
    "save_mesh",
    "shells",
    "space_curve",
    "split_long_edges",
    "submesh",
    "textures_in",
    "weld",
]
