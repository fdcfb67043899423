from .read import read_gltf

__all__ = ["read_gltf"]
