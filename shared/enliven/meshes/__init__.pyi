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
from .mesh import Axis, Mesh, fit_height, refine, submesh, weld

__all__ = [
    "Axis",
    "Entry",
    "Mesh",
    "corner_sums",
    "edge_lengths",
    "face_areas",
    "face_vectors",
    "first_of_position",
    "fit_height",
    "gltf_document",
    "load_mesh",
    "longest_edge",
    "normals_of",
    "refine",
    "save_mesh",
    "shells",
    "space_curve",
    "split_long_edges",
    "submesh",
    "weld",
]
