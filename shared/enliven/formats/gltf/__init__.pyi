from .read import read_gltf, with_materials

__all__ = ["read_gltf", "with_materials"]
