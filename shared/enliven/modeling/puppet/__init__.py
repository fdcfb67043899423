"""Edits of example-driven meshes (puppets): control points, key poses, layers, cuts, merges and baking."""
