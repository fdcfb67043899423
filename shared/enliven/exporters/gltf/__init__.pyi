from .write import GLB, glb_of, write_gltf

__all__ = ["GLB", "glb_of", "write_gltf"]
