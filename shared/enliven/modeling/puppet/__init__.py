"""Edits of meshes that example poses move: control points, key poses, layers, cuts, merges and baking."""
