from .files import (
    WRITABLE as WRITABLE,
    load_mesh as load_mesh,
    load_upright as load_upright,
    save_mesh as save_mesh,
)
from .gltf.gltf_json import GLTF_SUFFIXES as GLTF_SUFFIXES
from .kernels import (
    corner_sums as corner_sums,
    edge_lengths as edge_lengths,
    face_areas as face_areas,
    face_vectors as face_vectors,
    first_of_position as first_of_position,
    longest_edge as longest_edge,
    normals_of as normals_of,
    shells as shells,
    space_curve as space_curve,
    split_long_edges as split_long_edges,
)
from .mesh import (
    Axis as Axis,
    Mesh as Mesh,
    Paint as Paint,
    fit_height as fit_height,
    guess_up as guess_up,
    split_paint as split_paint,
    refine as refine,
    extract_submesh as extract_submesh,
    rotate_upright as rotate_upright,
    weld as weld,
    stiffness_error as stiffness_error,
)
from .materials import (
    MeshMaterials as MeshMaterials,
    Texture as Texture,
    barycentric as barycentric,
    join_materials as join_materials,
    materials_within as materials_within,
    renumber_textures as renumber_textures,
    textures_in as textures_in,
)
from .pictures import open_picture as open_picture
from .tokens import (
    WrongWordError as WrongWordError,
    split_into_blocks as split_into_blocks,
    word_lines as word_lines,
    parse_numbers as parse_numbers,
    word_starts as word_starts,
)
