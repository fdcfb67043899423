"""Takes, and how they drive a skeleton: rotations along arc length, layered and never baked (AniMesh, 5)."""
