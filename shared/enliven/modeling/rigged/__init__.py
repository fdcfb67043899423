"""Edits of rigged shapes (AniMesh) that keep their motion: bones and nodes, cutting, merging, mirroring and
posing."""
