from .bind import Bind as Bind
from .blob import Blob as Blob
from .file import GltfFile as GltfFile, compose_matrices as compose_matrices
from .gltf_json import GLTF_SUFFIXES as GLTF_SUFFIXES
from .motion import (
    JUMP_DURATION_S as JUMP_DURATION_S,
    MAX_NODE_SAMPLES as MAX_NODE_SAMPLES,
    animated_locals as animated_locals,
    frame_times as frame_times,
    key_times as key_times,
    world_matrices as world_matrices,
)
from .parts import GltfPart as GltfPart, moving_nodes as moving_nodes
from .scene import MeshScene as MeshScene, mesh_glb as mesh_glb
from .srgb import linear_from_srgb as linear_from_srgb
from .surface import GltfSurface as GltfSurface, gltf_surface as gltf_surface
