"""The glTF 2.0 reader: meshes, skins, skeletons and animations of a file become a rig."""
