"""The glTF 2.0 reader: meshes, skins, skeletons and animations of a file become a rig."""

from enliven.formats.gltf.read import read_gltf

__all__ = ["read_gltf"]
