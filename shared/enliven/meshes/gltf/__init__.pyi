from .bind import Bind as Bind
from .blob import Blob as Blob
from .file import GltfFile as GltfFile, matrices_of as matrices_of
from .gltf_json import GLTF_SUFFIXES as GLTF_SUFFIXES
from .motion import (
    JUMP as JUMP,
    MOST_PLACES as MOST_PLACES,
    animated_locals as animated_locals,
    frame_times as frame_times,
    key_times as key_times,
    world_matrices as world_matrices,
)
from .parts import GltfPart as GltfPart, moving_nodes as moving_nodes
from .scene import MeshScene as MeshScene, mesh_glb as mesh_glb
from .srgb import linear_of as linear_of
from .surface import GltfSurface as GltfSurface, gltf_surface as gltf_surface
