from .read import read_gltf as read_gltf
