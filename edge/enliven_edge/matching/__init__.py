"""Rigged characters, of which a performer chooses a part by posing and then drives it (AniMesh)."""
