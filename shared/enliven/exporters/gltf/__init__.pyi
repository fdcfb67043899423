from .scene import GltfScene as GltfScene
from .write import GLB as GLB, glb_of as glb_of, write_gltf as write_gltf
