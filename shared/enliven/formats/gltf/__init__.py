"""The glTF 2.0 reader: converts meshes, skins, skeletons and animations of a file to a rig."""
