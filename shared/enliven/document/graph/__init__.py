"""Possessed meshes in the document: the deformation graph, the motion streams that its nodes play, and
additional layers."""
