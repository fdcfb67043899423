from .read import read_gltf as read_gltf, with_materials as with_materials
