"""Which part of a skeleton does a pose mean? Abstraction, ranking, picking, symmetry (AniMesh, section 4)."""
