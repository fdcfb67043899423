"""Rigged models: a performer chooses a part of the skeleton by posing, and then drives it (AniMesh)."""
