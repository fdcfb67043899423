"""Soft constraints on a deformation graph: the floor, planes, the observed surface, and the mesh itself."""
